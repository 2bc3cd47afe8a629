"""Loads and compiles what perception needs before a camera's first frame comes."""

from __future__ import annotations

import numpy as np

from emd_core.pinhole_camera import PinholeCamera
from emd_perception.depth_image import depth_in_metres
from emd_perception.open3d_library import load_open3d
from emd_perception.pipeline import perceive

_CLOTH, _TABLE, _HAND = (40, 80, 170), (190, 150, 110), (120, 120, 120)


def prepare() -> None:
    """Load Open3D and perceive a small made-up cloth and hand once.

    Numba keeps what it compiles for later processes: it takes half a minute the first time and a
    second or two afterwards.
    """
    load_open3d()
    camera = PinholeCamera(320, 240, 260.0, 260.0, 159.5, 119.5)
    shape = (camera.height, camera.width)
    transform_camera_to_table = np.diag([1.0, -1.0, -1.0, 1.0])
    transform_camera_to_table[2, 3] = 0.6
    colour = np.full((*shape, 3), _TABLE, dtype=np.uint8)
    colour[80:160, 110:210] = _CLOTH
    millimetres = np.full(shape, 600, dtype=np.uint16)
    millimetres[80:160, 110:210] = 595
    millimetres[100, 120:126] = 0
    colour[:60, :90], millimetres[:60, :90] = _HAND, 450
    perceive(colour, depth_in_metres(millimetres), camera, transform_camera_to_table)
