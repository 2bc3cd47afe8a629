"""Point clouds: sensor_msgs/PointCloud2 of any layout to arrays and back."""

from __future__ import annotations

import array
import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

_FLOATS = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}


def points_to_message(points: FloatArray, message_header: Header) -> PointCloud2:
    """Convert points in metres, shape (N, 3) or, with neighbours in order, (H, W, 3)."""
    values = np.ascontiguousarray(points, dtype=np.float32)
    height, width = (1, len(values)) if values.ndim == 2 else values.shape[:2]
    fields = [
        PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate("xyz")
    ]
    return PointCloud2(
        header=message_header,
        height=height,
        width=width,
        fields=fields,
        is_bigendian=sys.byteorder == "big",
        point_step=12,
        row_step=12 * width,
        data=array.array("B", values.tobytes()),
        is_dense=bool(np.isfinite(values).all()),
    )


def points_from_message(message: Any) -> FloatArray:
    """Read the points of a cloud, shape (N, 3), row by row; see `organised_points`."""
    return organised_points(message).reshape(-1, 3)


def organised_points(message: Any) -> FloatArray:
    """Read the points of a cloud in the order that it has.

    Args:
        message: A PointCloud2 with floating point fields x, y and z, anywhere in its points.

    Returns:
        Shape (height, width, 3), metres, float64; NaN where unknown.

    Raises:
        InvalidInputError: If a coordinate is missing or not floating point, sizes contradict each
            other, or data are missing.
    """
    dtype = _point_type(message)
    row = message.width * message.point_step
    step = message.row_step or row
    if message.width < 1 or message.height < 1 or step < row:
        raise InvalidInputError(
            f"a cloud of {message.width} x {message.height} points of {message.point_step} bytes "
            f"needs rows of at least {row} bytes, got {message.row_step}"
        )
    if len(message.data) < message.height * step:
        raise InvalidInputError(
            f"the cloud claims {message.width} x {message.height} points, "
            f"{message.height * step} bytes, but carries {len(message.data)}; it was cut off"
        )
    raw = np.frombuffer(bytes(message.data), dtype=np.uint8)[: message.height * step]
    rows = np.ascontiguousarray(raw.reshape(message.height, step)[:, :row])
    packed: NDArray[Any] = rows.view(dtype).reshape(message.height, message.width)
    return np.stack([packed[name].astype(np.float64) for name in "xyz"], axis=-1)


def _point_type(message: Any) -> np.dtype[Any]:
    """The layout of one point, of which only x, y and z are looked at."""
    fields = {str(field.name): field for field in message.fields}
    order = ">" if message.is_bigendian else "<"
    formats, offsets = [], []
    for name in "xyz":
        if name not in fields or fields[name].datatype not in _FLOATS:
            raise InvalidInputError(
                "a cloud needs floating point fields x, y and z, got "
                f"{[(str(f.name), int(f.datatype)) for f in message.fields]}"
            )
        formats.append(order + _FLOATS[fields[name].datatype])
        offsets.append(int(fields[name].offset))
    kinds = [np.dtype(name) for name in formats]
    end = max(offset + kind.itemsize for offset, kind in zip(offsets, kinds, strict=True))
    step = int(message.point_step)
    if end > step or step > 1 << 16:
        raise InvalidInputError(
            f"a point with x, y and z needs {end} bytes or some more, got a point_step of {step}"
        )
    return np.dtype(
        {"names": list("xyz"), "formats": formats, "offsets": offsets, "itemsize": step}
    )
