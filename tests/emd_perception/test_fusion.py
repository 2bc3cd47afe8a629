"""Tests of the fusion of frames."""

import numpy as np
import pytest

from emd_core.errors import InvalidInputError
from emd_perception.config import FusionConfig
from emd_perception.fusion import fuse_frames, trimmed_mean

SHAPE = (60, 80)
EVERYWHERE = np.ones(SHAPE, bool)


def frames(count: int, noise: float = 0.002, seed: int = 0) -> tuple[list, list]:
    """Noisy frames of a wall at 1 m in plain grey."""
    rng = np.random.default_rng(seed)
    depths = [(1.0 + noise * rng.normal(size=SHAPE)).astype(np.float32) for _ in range(count)]
    grey = [
        np.clip(rng.normal(120, 3, (*SHAPE, 3)), 0, 255).astype(np.uint8) for _ in range(count)
    ]
    return grey, depths


def test_noise_falls_nearly_with_the_root_of_the_frames() -> None:
    """Sixteen frames have about a quarter of the noise of one."""
    fused = fuse_frames(*frames(16))
    assert fused.depth.std() < 0.3 * 0.002


def test_depth_steps_average_out() -> None:
    """Noise dithers the sensor's steps of 3 mm: the mean comes within half a millimetre."""
    _, depths = frames(30, noise=0.002)
    stepped = [(np.round((depth + 0.0011) / 0.003) * 0.003).astype(np.float32) for depth in depths]
    fused = trimmed_mean(np.stack(stepped), FusionConfig())
    assert np.abs(fused.mean() - 1.0011) < 5e-4


def test_a_wild_frame_is_ignored() -> None:
    """One frame half a metre off does not move the mean by a millimetre."""
    grey, depths = frames(8, noise=0.001)
    depths[3] = depths[3] + np.float32(0.5)
    assert np.abs(fuse_frames(grey, depths).depth - 1.0).max() < 3e-3


def test_pixels_known_in_some_frames_are_filled_and_others_stay_unknown() -> None:
    """A pixel needs its share of frames; then the frames that know it decide."""
    grey, depths = frames(10)
    for index, depth in enumerate(depths):
        depth[0, 0] = np.nan
        depth[1, 1] = np.nan if index % 2 else depth[1, 1]
    fused = fuse_frames(grey, depths).depth
    assert np.isnan(fused[0, 0])
    assert abs(fused[1, 1] - 1.0) < 0.01


def test_one_frame_stays_itself() -> None:
    """A single frame passes unchanged, at rest."""
    grey, depths = frames(1)
    fused = fuse_frames(grey, depths)
    np.testing.assert_array_equal(fused.depth, depths[0])
    np.testing.assert_array_equal(fused.colour, grey[0])
    assert fused.motion_share(EVERYWHERE) == 0.0


def test_a_scene_at_rest_does_not_move() -> None:
    """Noise and a change of the whole picture's brightness are no motion."""
    grey, depths = frames(9)
    brighter = [
        np.clip(one.astype(int) + 5 * k, 0, 255).astype(np.uint8) for k, one in enumerate(grey)
    ]
    assert fuse_frames(brighter, depths).motion_share(EVERYWHERE) == 0.0


@pytest.mark.parametrize("kind", ["depth", "colour"])
def test_something_that_moves_is_seen_where_it_moves(kind: str) -> None:
    """A patch that changes in depth or in colour counts as motion, the rest does not."""
    grey, depths = frames(9)
    for index in range(6, 9):
        if kind == "depth":
            depths[index][20:40, 20:40] -= 0.05
        else:
            grey[index][20:40, 20:40] = (200, 40, 40)
    moving = fuse_frames(grey, depths).moving
    assert moving[24:36, 24:36].all()
    assert not moving[50:].any()
    assert not moving[:, 60:].any()


def test_frames_that_do_not_fit_together_are_refused() -> None:
    """No frame, other counts and other sizes are refused."""
    grey, depths = frames(3)
    for wrong in (([], []), (grey[:2], depths), (grey, [*depths[:2], depths[2][:50]])):
        with pytest.raises(InvalidInputError):
            fuse_frames(*wrong)
