"""The Kinect's noise against its model."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.camera_noise import KinectNoise, KinectNoiseConfig
from emd_core.errors import InvalidInputError
from emd_core.pinhole_camera import PinholeCamera

CAMERA = PinholeCamera()
SHAPE = (CAMERA.height, CAMERA.width)


def wall(depth: float) -> np.ndarray:
    """A wall across the optical axis."""
    return np.full(SHAPE, depth, dtype=np.float32)


def slanted(angle: float, depth: float = 1.0) -> np.ndarray:
    """A plane turned by `angle` about the picture's vertical, `depth` metres away."""
    columns = (np.arange(CAMERA.width) - CAMERA.cx) / CAMERA.fx
    with np.errstate(divide="ignore"):
        row = depth / (1 - columns * np.tan(angle))
    row[(row < 0) | (row > 3)] = np.nan
    return np.tile(row, (CAMERA.height, 1)).astype(np.float32)


@pytest.mark.parametrize("depth", [0.7, 1.0, 1.5, 2.5])
def test_spread_of_a_wall_is_the_models(depth: float) -> None:
    """Deviation is that of Nguyen et al. plus the quantisation's, the mean is unbiased."""
    noise = KinectNoise(np.random.default_rng(1))
    error = noise.depth(wall(depth), CAMERA) - depth
    config = noise.config
    wanted = np.hypot(config.axial_sigma(depth), config.depth_step(depth) / np.sqrt(12))
    assert np.nanstd(error) == pytest.approx(wanted, rel=0.03)
    assert abs(np.nanmean(error)) < 0.1 * config.axial_sigma(depth)


def test_published_figures_of_the_noise() -> None:
    """At 1 m the model has 1.88 mm (Nguyen) and steps of 2.9 mm (Khoshelham)."""
    config = KinectNoiseConfig()
    assert config.axial_sigma(1.0) == pytest.approx(0.00188, abs=1e-5)
    assert config.depth_step(1.0) == pytest.approx(0.0029, abs=5e-5)


def test_depths_are_steps_of_disparity() -> None:
    """Measured depths are whole eighths of a pixel of disparity."""
    noise = KinectNoise(np.random.default_rng(2))
    measured = noise.depth(wall(1.2), CAMERA)
    config = noise.config
    disparity = config.infrared_focal_length * config.baseline / measured[np.isfinite(measured)]
    eighths = disparity / config.disparity_step
    assert np.abs(eighths - np.rint(eighths)).max() < 1e-3
    assert len(np.unique(np.rint(eighths))) > 3


def test_averaging_frames_beats_the_noise_down() -> None:
    """The mean of 30 frames is within 0.5 mm of the truth nearly everywhere."""
    noise = KinectNoise(np.random.default_rng(3))
    mean = np.nanmean([noise.depth(wall(0.72), CAMERA) for _ in range(30)], axis=0)
    error = np.abs(mean - 0.72)
    assert np.mean(error < 0.0006) > 0.9


def test_edges_jitter_by_less_than_a_pixel_on_average() -> None:
    """At a step between two walls a pixel's column errs by the lateral deviation, 0.8 px."""
    image = wall(1.0)
    image[:, 320:] = 1.5
    nothing_lost = {"grazing_angle": np.pi / 2, "grazing_softness": 1e-6, "dropout_rate": 0.0}
    config = KinectNoiseConfig(**nothing_lost)
    measured = KinectNoise(np.random.default_rng(4), config).depth(image, CAMERA)
    near = measured < 1.25
    share = [near[:, column].mean() for column in range(316, 324)]
    assert share[0] > 0.999
    assert share[-1] < 0.001
    # Column 320 is 0.5 px beyond the edge: P(0.8 x < -0.5) = 0.266.
    assert share[4] == pytest.approx(0.266, abs=0.06)


def test_flat_surfaces_lose_only_the_random_share() -> None:
    """A wall seen head-on loses 0.2 % of its pixels."""
    measured = KinectNoise(np.random.default_rng(5)).depth(wall(1.0), CAMERA)
    assert np.isnan(measured[5:-5, 5:-5]).mean() == pytest.approx(0.002, abs=0.0005)


@pytest.mark.parametrize(("degrees", "low", "high"), [(60, 0.0, 0.01), (85, 0.9, 1.0)])
def test_grazing_surfaces_drop_out(degrees: float, low: float, high: float) -> None:
    """At 60 degrees a surface is measured, at 85 it is lost."""
    measured = KinectNoise(np.random.default_rng(6)).depth(slanted(np.radians(degrees)), CAMERA)
    middle = measured[5:-5, 318:322]
    assert low <= np.isnan(middle).mean() <= high


def test_nothing_and_out_of_range_stay_unknown() -> None:
    """NaN, too near and too far give NaN."""
    for depth in (float("nan"), 0.3, 5.0):
        measured = KinectNoise(np.random.default_rng(7)).depth(wall(depth), CAMERA)
        assert np.isnan(measured).all()


def test_same_seed_gives_the_same_noise() -> None:
    """Noise comes from the generator alone; two frames of one generator differ."""
    image = wall(1.0)
    first, second = (KinectNoise(np.random.default_rng(8)) for _ in range(2))
    frame = first.depth(image, CAMERA)
    assert np.array_equal(frame, second.depth(image, CAMERA), equal_nan=True)
    assert not np.array_equal(frame, first.depth(image, CAMERA), equal_nan=True)


def test_colour_noise_is_mild_and_unbiased() -> None:
    """Channels scatter by 2.5 levels about the truth and stay in 0..255."""
    noise = KinectNoise(np.random.default_rng(9))
    image = np.full((*SHAPE, 3), 100, dtype=np.uint8)
    error = noise.colour(image).astype(float) - 100
    assert error.std() == pytest.approx(2.5, rel=0.03)
    assert abs(error.mean()) < 0.02
    white = noise.colour(np.full((*SHAPE, 3), 255, dtype=np.uint8))
    assert white.min() > 235
    assert white.max() == 255


@pytest.mark.parametrize(
    "wrong",
    [{"axial_floor": -1.0}, {"baseline": 0.0}, {"dropout_rate": 1.5}, {"nearest": 9.0}],
)
def test_impossible_constants_are_refused(wrong) -> None:
    """Negative noise, no baseline, rates above 1 and empty ranges raise."""
    with pytest.raises(InvalidInputError):
        KinectNoiseConfig(**wrong)


def test_wrong_image_size_is_refused() -> None:
    """Depth must have the camera's size."""
    with pytest.raises(InvalidInputError, match="480"):
        KinectNoise(np.random.default_rng(0)).depth(np.ones((10, 10), np.float32), CAMERA)
