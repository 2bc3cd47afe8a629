"""The warm-up compiles all that a frame needs."""

import numba
import numpy as np
import pytest

from emd_core.pinhole_camera import PinholeCamera
from emd_perception import (
    band_cut,
    block_means,
    colour_mixtures,
    depth_image,
    depth_to_voxel,
    graph_cut,
    hidden_columns,
    mask_morphology,
    masked_surface,
    minimum_cut,
    region,
    settled_nodes,
    square_means,
    table_appearance,
    table_plane,
    trend_fit,
    unprojection,
)
from emd_perception.depth_image import depth_in_metres
from emd_perception.frame_input import Frame
from emd_perception.session import PerceptionSession
from emd_perception.table_watch import TableWatch
from emd_perception.warm_up import prepare

MODULES = (
    band_cut,
    block_means,
    colour_mixtures,
    depth_image,
    depth_to_voxel,
    graph_cut,
    hidden_columns,
    mask_morphology,
    masked_surface,
    minimum_cut,
    region,
    settled_nodes,
    square_means,
    table_appearance,
    table_plane,
    trend_fit,
    unprojection,
)


def variants() -> dict[str, int]:
    """For how many combinations of types each kernel is compiled or loaded by now."""
    kernels = [
        one for module in MODULES for one in vars(module).values() if hasattr(one, "signatures")
    ]
    return {f"{kernel.__module__}.{kernel.__name__}": len(kernel.signatures) for kernel in kernels}


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_stream_compiles_nothing_more_after_the_warm_up(hand_scene) -> None:
    """No frame of a stream, with a hand and with missing depth, waits for the compiler."""
    prepare()
    before = variants()
    for called in ("band_cut._fill_links", "minimum_cut._cut", "hidden_columns._count_pixels"):
        assert before[f"emd_perception.{called}"] == 1
    session = PerceptionSession(TableWatch())
    for stamp in (0.0, 0.1, 0.2):
        millimetres = np.nan_to_num(1e3 * hand_scene.depth_frames[0]).astype(np.uint16)
        frame = Frame(hand_scene.colour, depth_in_metres(millimetres), PinholeCamera())
        pose = hand_scene.transform_camera_to_table
        session.perceive([frame], pose, stamp, streaming=True)
    assert variants() == before
