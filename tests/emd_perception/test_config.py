"""Tests of the settings."""

import dataclasses

import pytest

from emd_core.errors import InvalidInputError
from emd_perception.config import (
    FusionConfig,
    PerceptionConfig,
    PlaneConfig,
    SegmentationConfig,
    VoxelConfig,
)


def leaves(config: object) -> list[tuple[type, str, object]]:
    """All values of nested dataclasses."""
    found = []
    for field in dataclasses.fields(config):
        value = getattr(config, field.name)
        if dataclasses.is_dataclass(value):
            found += leaves(value)
        else:
            found.append((type(config), field.name, value))
    return found


def test_every_value_can_be_a_ros_parameter() -> None:
    """All settings are of the kinds that a ROS parameter can hold."""
    assert all(
        type(value) in (bool, int, float, str) for _, _, value in leaves(PerceptionConfig())
    )


def test_every_value_is_documented() -> None:
    """Each setting is explained in its class's docstring."""
    for owner, name, _ in leaves(PerceptionConfig()):
        assert f"        {name}: " in owner.__doc__, f"{owner.__name__}.{name}"


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: SegmentationConfig(min_area=0.0), "min_area"),
        (lambda: SegmentationConfig(iterations=0), "iterations"),
        (lambda: SegmentationConfig(min_contrast=6.0), "max_contrast"),
        (lambda: SegmentationConfig(max_height=float("nan")), "max_height"),
        (lambda: PlaneConfig(max_points=10), "max_points"),
        (lambda: PlaneConfig(min_inlier_share=1.5), "min_inlier_share"),
        (lambda: VoxelConfig(max_cells_per_voxel=0), "max_cells_per_voxel"),
        (lambda: FusionConfig(trimmed_share=0.5), "trimmed_share"),
    ],
)
def test_values_out_of_range_are_refused_by_name(make, name) -> None:
    """A setting out of its range is refused, and the message names it."""
    with pytest.raises(InvalidInputError, match=name):
        make()
