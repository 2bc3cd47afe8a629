"""Table, floor and the robot's pedestal, in the WAIST frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from emd_arm_executor.hiro.cell_geometry import CellGeometry
from emd_arm_executor.hiro.render.mesh import Colour, Material, Mesh, Segment, box, merge
from emd_core.frames import FloatArray

LEG_WIDTH = 0.05
PEDESTAL_SIZE = (0.36, 0.50)
FLANGE_THICKNESS = 0.03
FLOOR_SIZE = 8.0
WOOD_TEXEL = 0.002

_LEG_COLOUR: Colour = (0.45, 0.46, 0.48)
_PEDESTAL_COLOUR: Colour = (0.32, 0.33, 0.36)
_FLOOR_COLOUR: Colour = (0.58, 0.58, 0.56)
_WOOD_LIGHT = np.array([0.80, 0.64, 0.45])
_WOOD_DARK = np.array([0.60, 0.43, 0.27])


def scenery(geometry: CellGeometry) -> Mesh:
    """Build everything that neither moves nor is robot or cloth."""
    return merge([_table(geometry), _pedestal(geometry), _floor(geometry)])


def wood_texture(geometry: CellGeometry, seed: int = 7) -> NDArray[np.float32]:
    """Paint the table top: planks along its width with grain, shape (rows, columns, 3), 0..1.

    Rows run along the table's depth and columns along its width, `WOOD_TEXEL` metres each.
    """
    rng = np.random.default_rng(seed)
    depth, width = geometry.table_size[:2]
    rows = np.arange(int(np.ceil(depth / WOOD_TEXEL)) + 1) * WOOD_TEXEL
    columns = np.arange(int(np.ceil(width / WOOD_TEXEL)) + 1) * WOOD_TEXEL
    plank_width = 0.117
    plank = (rows / plank_width).astype(int)
    tone = rng.uniform(-0.12, 0.12, plank.max() + 1)[plank][:, None]
    phase = rng.uniform(0, 10, plank.max() + 1)[plank][:, None]
    across, along = rows[:, None], columns[None, :]
    bend = 0.012 * np.sin(3.1 * along + phase) + 0.005 * np.sin(8.7 * along + 2 * phase)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * 55 * (across + bend) + 3 * phase)
    fibres = np.repeat(rng.uniform(-0.5, 0.5, (len(rows), len(columns) // 40 + 1)), 40, axis=1)
    shade = 0.35 * rings + 0.18 * fibres[:, : len(columns)] + tone + 0.28
    seam = (np.abs(rows % plank_width) < 0.0015)[:, None]
    shade = np.clip(shade + 0.55 * seam, 0, 1)[..., None]
    return ((1 - shade) * _WOOD_LIGHT + shade * _WOOD_DARK).astype(np.float32)


def _table(geometry: CellGeometry) -> Mesh:
    depth, width, thickness = geometry.table_size
    centre = geometry.table_centre_in_waist
    wood: Colour = (float(_WOOD_DARK[0]), float(_WOOD_DARK[1]), float(_WOOD_DARK[2]))
    top = box(geometry.table_size, wood, Segment.TABLE, Material.WOOD)
    parts = [top.moved(_at(centre))]
    height = centre[2] - thickness / 2 - geometry.floor_height
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            leg = box((LEG_WIDTH, LEG_WIDTH, height), _LEG_COLOUR, Segment.TABLE)
            x = centre[0] + side_x * (depth / 2 - LEG_WIDTH)
            y = centre[1] + side_y * (width / 2 - LEG_WIDTH)
            parts.append(leg.moved(_at(np.array([x, y, geometry.floor_height + height / 2]))))
    return merge(parts)


def _pedestal(geometry: CellGeometry) -> Mesh:
    depth, width = PEDESTAL_SIZE
    behind = geometry.table_near_edge - 0.01 - depth / 2
    height = -geometry.floor_height - FLANGE_THICKNESS
    column = box((depth, width, height), _PEDESTAL_COLOUR, Segment.ROBOT)
    # The flange carries the waist, which stands over the table's edge.
    reach = 0.064
    flange_size = (depth + 0.01 + reach, 0.13, FLANGE_THICKNESS)
    flange = box(flange_size, _PEDESTAL_COLOUR, Segment.ROBOT)
    flange_x = geometry.table_near_edge + reach - flange_size[0] / 2
    return merge(
        [
            column.moved(_at(np.array([behind, 0, geometry.floor_height + height / 2]))),
            flange.moved(_at(np.array([flange_x, 0, -FLANGE_THICKNESS / 2]))),
        ]
    )


def _floor(geometry: CellGeometry) -> Mesh:
    slab = box((FLOOR_SIZE, FLOOR_SIZE, 0.02), _FLOOR_COLOUR, Segment.FLOOR, Material.TILES)
    return slab.moved(_at(np.array([0, 0, geometry.floor_height - 0.01])))


def _at(position: FloatArray) -> FloatArray:
    transform = np.eye(4)
    transform[:3, 3] = position
    return transform
