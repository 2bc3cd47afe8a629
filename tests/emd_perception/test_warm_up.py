"""The warm-up compiles all that a frame needs."""

import numba
import pytest

from emd_core.pinhole_camera import PinholeCamera
from emd_perception import (
    band_cut,
    depth_to_voxel,
    hidden_columns,
    mask_morphology,
    masked_surface,
    minimum_cut,
    region,
    square_means,
    unprojection,
)
from emd_perception.frame_input import Frame
from emd_perception.session import PerceptionSession
from emd_perception.table_watch import TableWatch
from emd_perception.warm_up import prepare

MODULES = (
    band_cut,
    depth_to_voxel,
    hidden_columns,
    mask_morphology,
    masked_surface,
    minimum_cut,
    region,
    square_means,
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
        frame = Frame(hand_scene.colour, hand_scene.depth_frames[0], PinholeCamera())
        pose = hand_scene.transform_camera_to_table
        session.perceive([frame], pose, stamp, streaming=True)
    assert variants() == before
