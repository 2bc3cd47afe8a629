"""Cloths by name: a material together with the way in which hands carry it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_core.errors import InvalidInputError


@dataclass(frozen=True)
class ClothPreset:
    """A cloth and its hands' path.

    Attributes:
        cloth: The sheet; its mesh is that of `preset`'s caller.
        path: How hands without a robot carry it.
    """

    cloth: ClothConfig
    path: HandPathConfig


PRESETS: Mapping[str, ClothPreset] = MappingProxyType(
    {"towel": ClothPreset(ClothConfig(), HandPathConfig())}
)


def preset(name: str, vertices: tuple[int, int] | None = None) -> ClothPreset:
    """Give a preset, on another mesh if `vertices` along x and y are named.

    Raises:
        InvalidInputError: If there is no such preset, or it cannot have this mesh.
    """
    if name not in PRESETS:
        raise InvalidInputError(f"there is no preset '{name}'; there are {', '.join(PRESETS)}")
    found = PRESETS[name]
    if vertices is None:
        return found
    return replace(found, cloth=replace(found.cloth, vertices=vertices))
