"""Cloths by name: a material together with the way in which hands carry it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from emd_cloth_sim.config import ClothConfig, HandPathConfig
from emd_cloth_sim.reference_path import ReferencePathConfig
from emd_core.errors import InvalidInputError


@dataclass(frozen=True)
class ClothPreset:
    """A cloth and its hands' path.

    Attributes:
        cloth: The sheet; its mesh is that of `preset`'s caller.
        path: How hands without a robot carry it.
    """

    cloth: ClothConfig
    path: HandPathConfig | ReferencePathConfig


# The authors' Blender cloth, scaled to 0.40 m and a towel's weight: 10 / 0.0175 of stiffness a
# unit, vertices of mass 1 and 0.00981 of gravity become m/N by dynamic similarity.
REFERENCE = ClothPreset(
    ClothConfig(
        vertices=(81, 81),
        thickness=0.0024,
        stretch_compliance=0.035,
        shear_compliance=0.070,
        bending_rigidity=5.7e-6,
        sharpest_fold=0.4,
        desk_friction=0.6,
        cloth_friction=0.4,
        damping=0.0,
        max_speed=2.0,
        step=0.01761 / 4,
        substeps=9,
        vertices_per_substep=9.0,
        grasp_radius=0.025 * 0.40 / 1.4,
        grasp_height_tolerance=0.2,
        rigid_grip=True,
        membrane="springs",
        squeeze_ratio=0.67,
        internal_damping=0.009,
        strain_limit=0.06,
        squeeze_limit=0.5,
        spring_sweeps=4,
        bending="hinges",
        plastic=True,
        desk_gap=0.0352 * 0.40 / 1.4 - 0.0012,
        separation_speed=0.1,
        max_stretch=0.10,
    ),
    ReferencePathConfig(),
)

PRESETS: Mapping[str, ClothPreset] = MappingProxyType(
    {"towel": ClothPreset(ClothConfig(), HandPathConfig()), "reference": REFERENCE}
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
