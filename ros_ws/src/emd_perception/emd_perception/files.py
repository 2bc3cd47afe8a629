"""Perception of image files, for the shell."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FieldOfView, FloatArray
from emd_core.pinhole_camera import PinholeCamera
from emd_perception.config import PerceptionConfig
from emd_perception.depth_image import depth_in_metres
from emd_perception.image_types import ColourImage, DepthImage
from emd_perception.overlay import draw_overlay
from emd_perception.pipeline import Perception, perceive

_METRES = {"mm": 1e-3, "m": 1.0}


def perceive_files(
    color: Path,
    depth: Path,
    intrinsics: tuple[float, float, float, float],
    depth_scale: str,
    out: Path,
    half_extent: float | None = None,
    extrinsics: FloatArray | None = None,
    config: PerceptionConfig | None = None,
) -> dict[str, Any]:
    """Find the cloth in image files and write what was found.

    Writes `mask.png` (0 or 255), `voxel_grid.npz`, `overlay.png` and `summary.json`, all of them
    or, after an error, none.

    Args:
        color: Colour image, 8 bits, three channels.
        depth: Depth image registered to it: 16-bit PNG or TIFF, float TIFF, or a .npy array;
            0 or NaN where unknown.
        intrinsics: fx, fy, cx, cy, pixels.
        depth_scale: Unit of the depth image, "mm" or "m".
        out: Folder to write to; made if missing.
        half_extent: Half side of the field of view, metres. If None, the default one; without
            extrinsics it is enlarged where the cloth does not fit.
        extrinsics: transform_camera_to_table, shape (4, 4), metres, if known.
        config: Settings; the defaults if None.

    Returns:
        The summary: cloth_pixels, occupied_voxels, table_plane (a, b, c, d), quality, reason, ms,
        and more.

    Raises:
        InvalidInputError: If a file or value is not as wanted.
        NoClothError: If no cloth is seen.
    """
    colour = read_colour(color)
    metres = read_depth(depth, depth_scale)
    camera = _camera(intrinsics, colour)
    if out.exists() and not out.is_dir():
        raise InvalidInputError(f"{out} should be a folder, it is a file; give another --out")
    field_of_view = None if half_extent is None else FieldOfView(half_extent)
    perception = perceive(colour, metres, camera, extrinsics, config, field_of_view)
    summary = summarise(perception)
    _write_all(out, perception, camera, summary)
    return summary


def summarise(perception: Perception) -> dict[str, Any]:
    """Give the figures of a perception as plain values for JSON."""
    grid = perception.voxel_grid
    return {
        "cloth_pixels": int(perception.mask.sum()),
        "occupied_voxels": int(grid.occupancy.sum()),
        "table_plane": [float(value) for value in perception.table_plane],
        "quality": perception.quality,
        "reason": perception.reason,
        "ms": perception.milliseconds["total"],
        "ms_by_stage": perception.milliseconds,
        "notes": list(perception.notes),
        "cloth_area": perception.cloth_area,
        "half_extent": grid.field_of_view.half_extent,
        "transform_camera_to_table": perception.transform_camera_to_table.tolist(),
    }


def read_colour(path: Path) -> ColourImage:
    """Read a colour image as RGB, shape (H, W, 3), uint8.

    Raises:
        InvalidInputError: If the file cannot be read or has not three channels of 8 bits.
    """
    image = _read_image(path)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        channels = 1 if image.ndim == 2 else image.shape[2]
        raise InvalidInputError(
            f"{path} should be a colour image with three channels of 8 bits, got {channels} "
            f"channel(s) of {image.dtype}; convert it to 8-bit RGB without transparency"
        )
    return np.ascontiguousarray(image[..., ::-1])


def read_depth(path: Path, scale: str) -> DepthImage:
    """Read a depth image, shape (H, W), float32 metres, NaN where unknown.

    Args:
        path: 16-bit PNG or TIFF, float TIFF, or .npy.
        scale: Its unit, "mm" or "m".

    Raises:
        InvalidInputError: If the file cannot be read, or type and unit are not as wanted.
    """
    if scale not in _METRES:
        raise InvalidInputError(f'the unit of the depth image must be "mm" or "m", got "{scale}"')
    raw = _read_array(path) if path.suffix == ".npy" else _read_image(path)
    if raw.dtype not in (np.uint16, np.float32, np.float64):
        raise InvalidInputError(
            f"{path} should be a depth image of 16-bit integers or floats, got {raw.dtype}"
            f"{' with several channels' if raw.ndim == 3 else ''}; is it a rendering of the depth "
            "or the colour image?"
        )
    if raw.dtype == np.uint16 and scale == "m":
        raise InvalidInputError(
            f"{path} holds whole numbers, which cannot be metres; give the unit mm"
        )
    if raw.dtype == np.uint16:
        return depth_in_metres(raw)
    return depth_in_metres(np.asarray(raw * _METRES[scale], dtype=np.float32))


def _read_image(path: Path) -> NDArray[Any]:
    data = _read_bytes(path)
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # an empty or hostile file; the same remedy as for any other
        image = None
    if image is None:
        raise InvalidInputError(f"{path} is no image that OpenCV can read; give PNG, JPEG or TIFF")
    return np.asarray(image)


def _read_array(path: Path) -> NDArray[Any]:
    _read_bytes(path)
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError, EOFError) as err:
        raise InvalidInputError(f"{path} should be an array saved by numpy: {err}") from err


def _read_bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as err:
        raise InvalidInputError(f"cannot read {path}: {err.strerror or err}") from err


def _camera(intrinsics: tuple[float, float, float, float], colour: ColourImage) -> PinholeCamera:
    if len(intrinsics) != 4:
        raise InvalidInputError(
            f"intrinsics are the four numbers fx fy cx cy, got {len(intrinsics)}"
        )
    fx, fy, cx, cy = (float(value) for value in intrinsics)
    camera = PinholeCamera(colour.shape[1], colour.shape[0], fx, fy, cx, cy)
    if not (-camera.width < cx < 2 * camera.width and -camera.height < cy < 2 * camera.height):
        raise InvalidInputError(
            f"the principal point ({cx:g}, {cy:g}) lies far outside the image of {camera.width} x "
            f"{camera.height}; give fx fy cx cy in this order, for this image size"
        )
    return camera


def _write_all(
    out: Path, perception: Perception, camera: PinholeCamera, summary: dict[str, Any]
) -> None:
    """Write all files beside their destination first, then move them there."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        staging = Path(tempfile.mkdtemp(prefix=".perceive-", dir=out))
    except OSError as err:
        raise InvalidInputError(f"cannot write to {out}: {err.strerror or err}") from err
    try:
        _write_image(staging / "mask.png", perception.mask.astype(np.uint8) * np.uint8(255))
        _write_image(staging / "overlay.png", draw_overlay(perception, camera)[..., ::-1])
        perception.voxel_grid.save(staging / "voxel_grid.npz")
        (staging / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
        for file in sorted(staging.iterdir()):
            os.replace(file, out / file.name)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _write_image(path: Path, image: NDArray[np.uint8]) -> None:
    _, data = cv2.imencode(".png", np.ascontiguousarray(image))
    path.write_bytes(data.tobytes())
