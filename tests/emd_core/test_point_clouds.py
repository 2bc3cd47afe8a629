"""Point clouds of any layout."""

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from emd_core.errors import InvalidInputError
from emd_core.ros.point_clouds import organised_points, points_from_message, points_to_message

POINTS = np.arange(24.0).reshape(2, 4, 3) / 8.0


def driver_cloud(
    order: str = "<", kind: int = PointField.FLOAT32, padding: int = 0
) -> PointCloud2:
    """A cloud as drivers send it: x y z, four spare bytes, packed colour; rows may be padded."""
    number = order + {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}[kind]
    size = np.dtype(number).itemsize
    layout = np.dtype(
        {
            "names": ["rgb", "x", "y", "z"],
            "formats": [order + "u4", number, number, number],
            "offsets": [4 * size, 0, size, 2 * size],
            "itemsize": 4 * size + 8,
        }
    )
    points = np.zeros((2, 4), dtype=layout)
    for axis, name in enumerate("xyz"):
        points[name] = POINTS[..., axis]
    rows = points.view(np.uint8).reshape(2, -1)
    data = np.pad(rows, ((0, 0), (0, padding))).tobytes()
    names = {"rgb": PointField.UINT32, "x": kind, "y": kind, "z": kind}
    return PointCloud2(
        height=2,
        width=4,
        fields=[
            PointField(name=name, offset=layout.fields[name][1], datatype=datatype, count=1)
            for name, datatype in names.items()
        ],
        is_bigendian=order == ">",
        point_step=layout.itemsize,
        row_step=rows.shape[1] + padding,
        data=data,
    )


@pytest.mark.parametrize("shape", [(2, 4, 3), (8, 3)])
def test_there_and_back_again(shape) -> None:
    """Points keep their values, and their order in two directions if they have one."""
    points = POINTS.reshape(shape)
    message = points_to_message(points, Header(frame_id="camera"))
    np.testing.assert_array_equal(organised_points(message).reshape(shape), points)
    np.testing.assert_array_equal(points_from_message(message), POINTS.reshape(-1, 3))


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", [PointField.FLOAT32, PointField.FLOAT64])
@pytest.mark.parametrize("padding", [0, 5])
def test_drivers_layouts_are_read(order, kind, padding) -> None:
    """Spare bytes, colours, padding of rows, byte order and precision do not matter."""
    np.testing.assert_array_equal(organised_points(driver_cloud(order, kind, padding)), POINTS)


@pytest.mark.parametrize(
    ("field", "value", "complaint"),
    [
        ("width", 0, "needs rows"),
        ("height", 40, "cut off"),
        ("point_step", 8, "point_step of 8"),
        ("point_step", 1 << 31, "point_step"),
        ("row_step", 3, "needs rows"),
        ("data", b"12", "cut off"),
        ("fields", [], "fields x, y and z"),
    ],
)
def test_clouds_that_contradict_themselves_are_refused(field, value, complaint) -> None:
    """The error says what was claimed and what came."""
    message = driver_cloud()
    setattr(message, field, value)
    with pytest.raises(InvalidInputError, match=complaint):
        organised_points(message)


def test_whole_numbers_are_no_coordinates() -> None:
    """A field x of integers is refused: nobody says what its unit is."""
    message = driver_cloud()
    message.fields[1].datatype = PointField.INT32
    with pytest.raises(InvalidInputError, match="floating point"):
        organised_points(message)
