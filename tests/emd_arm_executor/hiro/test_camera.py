"""The camera on the head and the one that films."""

from __future__ import annotations

import numpy as np
import pytest

from emd_arm_executor.hiro.camera import HeadCamera
from emd_arm_executor.hiro.camera_noise import KinectNoise
from emd_arm_executor.hiro.cell_geometry import transform_camera_to_table
from emd_arm_executor.hiro.description import OBSERVE
from emd_arm_executor.hiro.overview import OverviewCamera
from emd_core.frames import transform_points


def test_frame_is_colour_depth_and_pose(world, cloth) -> None:
    """A frame has the documented types, and its pose is that of the head's joints."""
    frame = HeadCamera(world).capture(cloth)
    assert frame.colour.shape == (480, 640, 3)
    assert frame.colour.dtype == np.uint8
    assert frame.depth.shape == (480, 640)
    assert frame.depth.dtype == np.float32
    wanted = transform_camera_to_table(*OBSERVE.positions("head"))
    assert frame.transform_camera_to_table == pytest.approx(wanted, abs=1e-6)


def test_picture_follows_the_head(world, cloth) -> None:
    """When the head turns left, the cloth moves to the right of the picture."""
    camera = HeadCamera(world)
    before = camera.capture(cloth).colour
    world.set_joint_targets({"HEAD_JOINT0": 0.2})
    for _ in range(240):
        world.step()
    after = camera.capture(cloth).colour
    blue = [np.nonzero(image[..., 2] > 1.5 * image[..., 0])[1].mean() for image in (before, after)]
    assert blue[1] > blue[0] + 20


def test_noise_can_be_switched(world, cloth) -> None:
    """Without noise two frames are equal; with it they differ but agree on average."""
    clean, noisy = (
        HeadCamera(world, noise=noise) for noise in (None, KinectNoise(np.random.default_rng(0)))
    )
    truth = clean.capture(cloth)
    assert np.array_equal(truth.depth, clean.capture(cloth).depth, equal_nan=True)
    frame = noisy.capture(cloth)
    assert not np.array_equal(frame.colour, truth.colour)
    error = frame.depth - truth.depth
    assert 1e-3 < np.nanstd(error[50:400]) < 3e-3
    assert abs(np.nanmean(error[50:400])) < 2e-4


def test_frame_unprojects_to_the_cloth(world, cloth) -> None:
    """A frame's depth, intrinsics and pose put the cloth where it is, despite the noise."""
    frame = HeadCamera(world, noise=KinectNoise(np.random.default_rng(1))).capture(cloth)
    points = transform_points(frame.transform_camera_to_table, frame.camera.unproject(frame.depth))
    blue = frame.colour[..., 2] > 1.5 * frame.colour[..., 0]
    found = points[blue & np.isfinite(frame.depth)]
    assert found[:, 2].mean() == pytest.approx(cloth.thickness, abs=2e-4)
    for axis in (0, 1):
        extent = np.percentile(found[:, axis], [0.5, 99.5])
        assert extent == pytest.approx((-0.2, 0.2), abs=4e-3)


def test_overview_shows_robot_table_and_cloth(world, cloth) -> None:
    """The filming camera has the cloth in its picture."""
    camera = OverviewCamera(world, HeadCamera(world).renderer)
    image = camera.capture(cloth).astype(int)
    assert image.shape == (360, 480, 3)
    assert (image[..., 2] > 1.5 * image[..., 0]).sum() > 1000
