"""Tests of finding the cloth in synthetic scenes."""

import numpy as np
import pytest
from perception_scenes import (
    BLUE,
    DARK_WOOD,
    GREY,
    LIGHT_BLUE,
    RED,
    WHITE,
    WOOD,
    Layer,
    Scene,
    rectangle,
    render,
)

from emd_core.errors import NoClothError
from emd_core.frames import FieldOfView
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.cut_memory import CutMemory
from emd_perception.quality import combine
from emd_perception.region import field_of_view_region, observed_region, pixel_area_on_table
from emd_perception.segmentation import Segmentation, segment_cloth
from emd_perception.table_plane import fit_table_plane
from emd_perception.unprojection import height_above_plane

CAMERA = PinholeCamera()
FLAT = rectangle(0.4, 0.4, turn=0.2)


def segment(
    scene: Scene, region: np.ndarray | None = None, last: CutMemory | None = None
) -> Segmentation:
    """Segment a scene's first frame, in a region of interest if given."""
    plane = fit_table_plane(scene.depth_frames[0], CAMERA)
    height = height_above_plane(scene.depth_frames[0], plane.coefficients, CAMERA)
    seen = observed_region(height)
    area = pixel_area_on_table(CAMERA, plane)
    within = seen if region is None else seen & region
    return segment_cloth(scene.colour, height, area, within, last=last)


def iou(mask: np.ndarray, truth: np.ndarray) -> float:
    """Intersection over union."""
    return float((mask & truth).sum() / (mask | truth).sum())


@pytest.mark.parametrize(
    ("colour", "wood", "top"),
    [
        (BLUE, WOOD, 0.003),
        (WHITE, WOOD, 0.002),
        (RED, DARK_WOOD, 0.003),
        (GREY, DARK_WOOD, 0.003),
        ((25, 25, 28), WOOD, 0.003),
    ],
)
def test_a_flat_cloth_is_found(colour, wood, top) -> None:
    """Cloth of any colour that differs from the wood is outlined to about a pixel."""
    scene = render([Layer(FLAT, top, colour)], seed=11, wood=wood)
    found = segment(scene)
    assert iou(found.mask, scene.mask) > 0.96
    assert found.area == pytest.approx(0.16, rel=0.05)
    assert combine(found.judgements)[0] > 0.9


def test_both_sides_of_a_folded_cloth_belong_to_it(folded_scene) -> None:
    """A cloth whose inside has another colour is one cloth."""
    assert iou(segment(folded_scene).mask, folded_scene.mask) > 0.96


def test_a_striped_cloth_is_one_cloth() -> None:
    """Stripes of two colours are found together."""
    stripes = [
        Layer(rectangle(0.04, 0.4, (-0.14 + 0.04 * k, 0.0)), 0.003, BLUE if k % 2 else WHITE)
        for k in range(8)
    ]
    scene = render(stripes, seed=12)
    assert iou(segment(scene).mask, scene.mask) > 0.96


def test_a_hand_at_the_cloth_is_left_out(hand_scene) -> None:
    """A grey hand that hides a corner of the cloth is not taken for cloth."""
    assert iou(segment(hand_scene).mask, hand_scene.mask) > 0.96


def test_a_chequered_cloth_with_checks_of_the_tables_colour_is_one_cloth() -> None:
    """Checks that only their height tells from the table belong to the cloth."""
    checks = [
        Layer(
            rectangle(0.05, 0.05, (-0.125 + 0.05 * row, -0.125 + 0.05 * column)),
            0.004,
            WOOD if (row + column) % 2 else BLUE,
        )
        for row in range(6)
        for column in range(6)
    ]
    scene = render(checks, seed=18)
    assert iou(segment(scene).mask, scene.mask) > 0.93


def test_a_shadow_beside_the_cloth_is_no_cloth() -> None:
    """A hard shadow, as dark as the cloth and touching it, lies flat and is left out."""
    shadow = Layer(rectangle(0.3, 0.2, (0.0, 0.25)), 0.0, (95, 75, 54), is_cloth=False)
    scene = render([Layer(rectangle(0.3, 0.3), 0.004, (70, 45, 30)), shadow], seed=19)
    assert iou(segment(scene).mask, scene.mask) > 0.95


def test_what_is_too_near_to_be_measured_is_no_cloth() -> None:
    """A dark thing without any depth that hangs over the cloth's edge is left out."""
    near = Layer(rectangle(0.15, 0.15, (0.2, 0.1)), 0.02, (40, 45, 60), is_cloth=False)
    scene = render([Layer(rectangle(0.35, 0.35), 0.004, RED), near], seed=20)
    bare = render([Layer(rectangle(0.35, 0.35), 0.004, RED)], seed=20)
    hidden = np.abs(scene.true_depth - bare.true_depth) > 0.001
    scene.depth_frames[0][hidden] = np.nan
    assert iou(segment(scene).mask, scene.mask) > 0.95


def test_an_empty_table_has_no_cloth(empty_scene) -> None:
    """Grain, seams and uneven light are no cloth."""
    with pytest.raises(NoClothError, match="nothing of 40 square cm"):
        segment(empty_scene)


def test_cloth_of_the_tables_colour_is_not_invented() -> None:
    """A thin cloth that cannot be told from the wood leads to a refusal, not to rubbish."""
    scene = render([Layer(FLAT, 0.0005, WOOD)], seed=13)
    with pytest.raises(NoClothError):
        segment(scene)


def test_cloth_of_the_tables_colour_is_found_by_its_height() -> None:
    """Where it lies clearly higher than the table, it needs no other colour."""
    scene = render([Layer(FLAT, 0.004, WOOD)], seed=13)
    assert iou(segment(scene).mask, scene.mask) > 0.9


def test_a_tall_box_is_no_cloth() -> None:
    """What is taller than a pile of cloth is refused."""
    box = Layer(rectangle(0.2, 0.15, (-0.1, 0.0), 0.3), 0.15, RED, is_cloth=False)
    with pytest.raises(NoClothError):
        segment(render([box], seed=14))


def test_a_hand_alone_is_no_cloth() -> None:
    """A low hand that reaches in from the picture's border is refused."""
    hand = Layer(rectangle(0.5, 0.08, (0.3, 0.05), 0.2), 0.05, GREY, is_cloth=False)
    with pytest.raises(NoClothError, match="reach in"):
        segment(render([hand], seed=15))


def test_what_lies_outside_the_region_is_ignored() -> None:
    """A larger red thing outside the field of view does not draw attention from the cloth."""
    cloth = Layer(rectangle(0.2, 0.2), 0.003, BLUE)
    other = Layer(rectangle(0.35, 0.2, (-0.1, 0.46)), 0.003, RED, is_cloth=False)
    scene = render([cloth, other], seed=16)
    region = field_of_view_region(CAMERA, scene.transform_camera_to_table, FieldOfView(), 0.2)
    assert iou(segment(scene, region).mask, scene.mask) > 0.96
    assert iou(segment(scene).mask, scene.mask) < 0.1


def test_a_spot_on_the_cloth_is_filled_and_a_large_hole_is_not() -> None:
    """A small spot of the table's colour belongs to the cloth; a hole of 10 cm shows table."""
    spot = Layer(rectangle(0.03, 0.03, (-0.1, 0.1)), 0.004, WOOD)
    scene = render([Layer(FLAT, 0.003, BLUE), spot], seed=17)
    assert iou(segment(scene).mask, scene.mask) > 0.96
    frame = [
        Layer(rectangle(0.1, 0.4, (sign * 0.1, 0.0)), 0.003, LIGHT_BLUE) for sign in (-1, 1)
    ] + [Layer(rectangle(0.12, 0.1, (0.0, sign * 0.15)), 0.003, LIGHT_BLUE) for sign in (-1, 1)]
    scene = render(frame, seed=18)
    assert iou(segment(scene).mask, scene.mask) > 0.94


def test_a_cloth_cut_off_by_the_view_loses_quality() -> None:
    """Cloth that reaches out of the picture is found, but trusted less."""
    scene = render([Layer(rectangle(0.4, 0.4, (0.0, 0.5)), 0.003, BLUE)], seed=19)
    quality, reason = combine(segment(scene).judgements)
    assert quality < 0.8
    assert "out of view" in reason


def test_a_hand_above_the_cloth_is_left_out_and_what_it_cuts_off_is_not() -> None:
    """An arm across the cloth, with a lower hand in front: both pieces are cloth, they are not."""
    arm = Layer(rectangle(0.9, 0.06, (0.3, 0.0)), 0.15, GREY, is_cloth=False)
    hand = Layer(rectangle(0.06, 0.1, (-0.12, 0.05)), 0.06, GREY, is_cloth=False)
    scene = render([Layer(FLAT, 0.003, BLUE), arm, hand], seed=16)
    found = segment(scene).mask
    assert iou(found, scene.mask) > 0.9
    bare = render([arm, hand], seed=16)
    hidden = np.abs(bare.true_depth - scene.true_depth) < 1e-9
    raised = hidden & ~scene.mask & (bare.true_depth < render([], seed=16).true_depth - 0.04)
    assert (found & raised).sum() < 0.1 * raised.sum()


@pytest.mark.parametrize("across", [-0.02, 0.0, 0.05])
def test_a_cloth_that_an_arm_parts_is_one_cloth(across: float) -> None:
    """An arm that lies across all of it leaves two halves, neither of which is the cloth alone."""
    arm = Layer(rectangle(1.4, 0.09, (0.0, across)), 0.10, GREY, is_cloth=False)
    scene = render([Layer(FLAT, 0.003, BLUE), arm], seed=17)
    assert iou(segment(scene).mask, scene.mask) > 0.95


def test_a_low_gripper_of_the_cloths_colour_is_taken_out() -> None:
    """A cut by colour joins it with the cloth; its height and the arm above it tell it apart."""
    dark = (30, 40, 34)
    arm = Layer(rectangle(0.5, 0.08, (0.2, 0.05)), 0.15, GREY, is_cloth=False)
    gripper = Layer(rectangle(0.1, 0.1, (-0.1, 0.05)), 0.05, dark, is_cloth=False)
    scene = render([Layer(FLAT, 0.003, dark), arm, gripper], seed=15)
    found = segment(scene).mask
    assert (found & ~scene.mask).sum() < 300 and iou(found, scene.mask) > 0.97


def test_a_scene_at_rest_keeps_its_colours_and_a_changed_one_is_learnt_anew() -> None:
    """The next frame is cut as well with the mixtures kept; another cloth gets its own."""
    first, second = (render([Layer(FLAT, 0.003, BLUE)], seed=31) for _ in range(2))
    known = segment(first).memory
    again = segment(second, last=known)
    assert again.memory is known
    assert iou(again.mask, second.mask) > 0.97
    other = render([Layer(rectangle(0.3, 0.3), 0.003, RED)], seed=31)
    changed = segment(other, last=known)
    assert changed.memory is not known
    assert iou(changed.mask, other.mask) > 0.96
