"""How cloth, table and light of a synthetic scene look."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_arm_executor.hiro.render.renderer import RenderConfig
from emd_arm_executor.hiro.render.scenery import wood_texture
from emd_cloth_sim.config import ClothConfig
from emd_cloth_sim.mesh import build_mesh, flat_positions
from emd_core.frames import FloatArray

Colours = NDArray[np.float32]

CLOTHS = ("coloured", "white", "dark", "striped", "chequered")
TABLES = ("wood", "dark wood", "grey", "green felt")
_WHITE = (0.88, 0.87, 0.84)


@dataclass(frozen=True)
class Look:
    """What a scene is painted and lit with.

    Attributes:
        cloth: Of `CLOTHS`.
        table: Of `TABLES`.
        cloth_colours: Of the cloth's triangles, shape (T, 3), 0..1.
        table_texture: Table top, shape (rows, columns, 3), 0..1.
        render: The light.
        lamp_spot: Pixel on which a lamp is brightest, (row, column), as shares of the picture.
        lamp_fall: Share of the light that is lost at half the picture's diagonal from there.
        tint: Factors of red, green and blue: the colour of the light.
    """

    cloth: str
    table: str
    cloth_colours: Colours
    table_texture: Colours
    render: RenderConfig
    lamp_spot: tuple[float, float]
    lamp_fall: float
    tint: FloatArray

    def lit(self, colour: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Let the lamp shine on a rendered picture, shape (H, W, 3)."""
        rows, columns = (np.linspace(0.0, 1.0, count) for count in colour.shape[:2])
        aside = (columns - self.lamp_spot[1]) * colour.shape[1] / colour.shape[0]
        squared = (rows[:, None] - self.lamp_spot[0]) ** 2 + aside**2
        gain = (1.0 - self.lamp_fall * np.minimum(squared / 0.7, 1.0))[..., None] * self.tint
        return np.clip(np.rint(colour * gain), 0, 255).astype(np.uint8)


def draw_look(rng: np.random.Generator, cloth: ClothConfig, geometry: CellGeometry) -> Look:
    """Draw a cloth that can be told from its table, and a light."""
    table = TABLES[rng.integers(len(TABLES))]
    kind = CLOTHS[rng.integers(len(CLOTHS))]
    if (kind, table) == ("dark", "dark wood"):
        table = "wood"
    angle, rise = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.7, 1.3)
    ambient = rng.uniform(0.55, 0.75)
    return Look(
        kind,
        table,
        _cloth_colours(kind, rng, cloth),
        _table_texture(table, rng, geometry),
        RenderConfig(
            light_direction=(math.cos(angle), math.sin(angle), rise),
            ambient=ambient,
            lamp=1.05 - ambient,
        ),
        (rng.uniform(0.2, 0.8), rng.uniform(0.2, 0.8)),
        rng.uniform(0.0, 0.4),
        rng.uniform(0.92, 1.05, 3),
    )


def _cloth_colours(kind: str, rng: np.random.Generator, cloth: ClothConfig) -> Colours:
    triangles = build_mesh(cloth.vertices, cloth.spacing).triangles
    main, other = _saturated(rng), np.array(_WHITE)
    if kind == "white":
        main = other
    elif kind == "dark":
        main = rng.uniform(0.06, 0.16, 3)
    if kind in ("striped", "chequered"):
        middle = flat_positions(cloth.vertices, cloth.side_lengths)[triangles].mean(axis=1)
        band = np.floor(middle[:, :2] / rng.uniform(0.02, 0.06)).astype(int)
        odd = band[:, 0] % 2 if kind == "striped" else band.sum(axis=1) % 2
        return np.where(odd[:, None] == 1, main, other).astype(np.float32)
    return np.tile(main, (len(triangles), 1)).astype(np.float32)


def _saturated(rng: np.random.Generator) -> FloatArray:
    """Draw blue, green, red, violet: no colour of wood."""
    palette = np.array([(0.16, 0.34, 0.68), (0.12, 0.50, 0.36), (0.70, 0.14, 0.18)])
    chosen = palette[rng.integers(len(palette))] * rng.uniform(0.8, 1.2)
    return np.asarray(np.clip(chosen, 0.0, 1.0))


def _table_texture(kind: str, rng: np.random.Generator, geometry: CellGeometry) -> Colours:
    wood = wood_texture(geometry, int(rng.integers(1000)))
    if kind == "wood":
        return wood
    if kind == "dark wood":
        return (0.5 * wood).astype(np.float32)
    colour = {"grey": (0.50, 0.50, 0.52), "green felt": (0.30, 0.42, 0.33)}[kind]
    grain = rng.normal(0.0, 0.02, wood.shape[:2])[..., None]
    return np.clip(np.array(colour) + grain, 0.0, 1.0).astype(np.float32)
