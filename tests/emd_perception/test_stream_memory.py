"""A still scene keeps its outline; whatever changes in it is looked at anew."""

import numpy as np
import pytest
from perception_scenes import BLUE, Layer, Scene, rectangle, render

from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import PerceptionConfig, SegmentationConfig
from emd_perception.glance import Glance
from emd_perception.perception import Perception
from emd_perception.pipeline import perceive
from emd_perception.stream_memory import StreamMemory

PIXELS = SegmentationConfig().working_pixels


def seen(scene: Scene, index: int, last: StreamMemory | None, most_uses: int = 30) -> Perception:
    """Perceive one frame of a stream."""
    config = PerceptionConfig(SegmentationConfig(most_uses=most_uses))
    pose, depth = scene.transform_camera_to_table, scene.depth_frames[index]
    return perceive(scene.colour, depth, PinholeCamera(), pose, config, last=last)


def cloth_at(x: float, height: float = 0.003) -> Scene:
    """A cloth whose middle lies at x, metres."""
    return render([Layer(rectangle(0.4, 0.4, (x, 0.0)), height, BLUE)], frames=2)


def test_a_still_scene_keeps_its_outline_but_not_its_depth() -> None:
    """The mask is the same array; heights are those of the new frame."""
    scene = cloth_at(0.0)
    first = seen(scene, 0, None)
    second = seen(scene, 1, first.memory)
    assert second.memory is not None and second.memory.uses == 1
    assert second.mask is first.mask
    assert not np.array_equal(second.points_in_table, first.points_in_table)


def test_an_outline_serves_no_longer_than_allowed() -> None:
    """After `most_uses` frames, and with 0 in each, it is found anew."""
    scene = cloth_at(0.0)
    memory, uses = None, []
    for _ in range(5):
        memory = seen(scene, 0, memory, most_uses=2).memory
        uses.append(memory.uses)
    assert uses == [0, 1, 2, 0, 1]
    assert seen(scene, 0, memory, most_uses=0).memory.uses == 0


def test_cloth_that_moves_by_millimetres_is_outlined_anew() -> None:
    """4 mm are about two pixels: the mask is that of the frame by itself."""
    first = seen(cloth_at(0.0), 0, None)
    moved = cloth_at(0.004)
    second = seen(moved, 0, first.memory)
    assert second.memory.uses == 0
    # The colours learnt in the first frame serve on, so a pixel here and there may differ.
    assert np.mean(second.mask != seen(moved, 0, None).mask) < 1e-3


def test_slow_motion_adds_up() -> None:
    """Steps of half a millimetre, each unseen beside the last, end in an outline found anew."""
    memory = seen(cloth_at(0.0), 0, None).memory
    uses = []
    for step in range(1, 13):
        memory = seen(cloth_at(0.0005 * step), 0, memory).memory
        uses.append(memory.uses)
    assert 0 in uses


@pytest.mark.parametrize("height", [0.015, 0.03])
def test_cloth_that_only_rises_is_seen_by_its_depth(height: float) -> None:
    """Colour may not change when cloth is lifted towards the camera."""
    scene = cloth_at(0.0)
    low = Glance.of(scene.colour, scene.depth_frames[0], PIXELS)
    lifted = scene.depth_frames[0] - np.float32(height) * scene.mask
    assert not low.shows_same(Glance.of(scene.colour, lifted, PIXELS))
    assert low.shows_same(Glance.of(scene.colour, scene.depth_frames[1], PIXELS))


def test_another_light_size_or_camera_pose_is_no_still_scene() -> None:
    """Each of them alone ends what was kept."""
    scene = cloth_at(0.0)
    memory = seen(scene, 0, None).memory
    pose, glance = scene.transform_camera_to_table, memory.glance
    assert memory.still_holds(glance, pose, 30)
    darker = (scene.colour * 0.9).astype(np.uint8)
    depth = scene.depth_frames[0]
    assert not memory.still_holds(Glance.of(darker, depth, PIXELS), pose, 30)
    halves = Glance.of(scene.colour[::2, ::2], depth[::2, ::2], PIXELS)
    assert halves.colour.shape == glance.colour.shape
    assert not memory.still_holds(halves, pose, 30)
    elsewhere = pose.copy()
    elsewhere[0, 3] += 0.01
    assert not memory.still_holds(glance, elsewhere, 30)
    assert not memory.still_holds(glance, None, 30)
