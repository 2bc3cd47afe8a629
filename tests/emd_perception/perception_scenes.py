"""Small synthetic RGB-D scenes: flat pieces of cloth on a wooden table, seen by a head camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FieldOfView, FloatArray
from emd_core.voxel_grid import VoxelGrid, voxelise

BLUE, WHITE, RED = (45, 80, 165), (232, 232, 226), (175, 35, 40)
LIGHT_BLUE, GREY = (150, 180, 215), (128, 128, 130)
WOOD, DARK_WOOD = (196, 156, 112), (112, 78, 52)
WIDTH, HEIGHT, FOCAL_LENGTH, CX, CY = 640, 480, 525.0, 319.5, 239.5
TEXTURE_SIDE = 2.4  # metres
BASELINE = 0.075  # metres between projector and camera of a Kinect


@dataclass(frozen=True)
class Layer:
    """A flat piece: corners (N, 2) in the table frame, metres; its top's height; its colour."""

    corners: FloatArray
    top: float
    colour: tuple[int, int, int]
    is_cloth: bool = True


@dataclass(frozen=True)
class Scene:
    """What the camera gives (colour, depth frames) and what is true (mask, heights, grid)."""

    colour: NDArray[np.uint8]
    depth_frames: list[NDArray[np.float32]]
    true_depth: FloatArray
    mask: NDArray[np.bool_]
    grid: VoxelGrid
    transform_camera_to_table: FloatArray


def rectangle(
    side_x: float, side_y: float, centre: tuple[float, float] = (0.0, 0.0), turn: float = 0.0
) -> FloatArray:
    """Corners (4, 2) of a rectangle turned by `turn` radians."""
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [side_x / 2, side_y / 2]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return corners @ rotation.T + centre


def head_camera_to_table(
    position: tuple[float, float, float] = (0.36, 0.0, 0.78),
    target: tuple[float, float, float] = (0.02, 0.0, 0.0),
) -> FloatArray:
    """Pose of a camera on the robot's side (x > 0) that looks down at the table."""
    forward = np.subtract(target, position)
    forward = forward / np.linalg.norm(forward)
    right = np.array([0.0, 1.0, 0.0])
    transform = np.eye(4)
    transform[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    transform[:3, 3] = position
    return transform


def render(
    layers: list[Layer],
    *,
    seed: int = 0,
    frames: int = 1,
    wood: tuple[int, int, int] = WOOD,
    noise: bool = True,
    transform: FloatArray | None = None,
    field_of_view: FieldOfView | None = None,
) -> Scene:
    """Render a scene; `seed` fixes the wood, the light and the sensor's noise."""
    rng = np.random.default_rng(seed)
    transform = head_camera_to_table() if transform is None else transform
    colour, true_depth, mask = _cast_rays(layers, transform, _wood_texture(wood, rng), rng)
    depth = [_kinect_depth(true_depth, rng) if noise else true_depth for _ in range(frames)]
    return Scene(
        _camera_colour(colour, rng) if noise else colour.astype(np.uint8),
        [frame.astype(np.float32) for frame in depth],
        true_depth,
        mask,
        true_grid(layers, field_of_view or FieldOfView()),
        transform,
    )


def true_grid(layers: list[Layer], field_of_view: FieldOfView) -> VoxelGrid:
    """Voxelise the tops of the cloth's layers, sampled every 3 mm."""
    axis = np.arange(-0.6, 0.6, 0.003)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    points = []
    for layer in layers:
        if layer.is_cloth:
            inside = _inside(layer.corners, x, y)
            top = np.full(inside.sum(), layer.top)
            points.append(np.column_stack([x[inside], y[inside], top]))
    return voxelise(np.concatenate(points) if points else np.zeros((0, 3)), field_of_view)


def _cast_rays(
    layers: list[Layer], transform: FloatArray, texture: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Meet every pixel's ray with the highest layer first and with the table last."""
    u, v = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(u - CX) / FOCAL_LENGTH, (v - CY) / FOCAL_LENGTH, np.ones(u.shape)], axis=-1)
    rays = rays @ transform[:3, :3].T
    origin = transform[:3, 3]
    depth = -origin[2] / rays[..., 2]
    x, y = (origin[i] + depth * rays[..., i] for i in (0, 1))
    scale = texture.shape[0] / TEXTURE_SIDE
    pixel = [((c + TEXTURE_SIDE / 2) * scale).astype(np.float32) for c in (y, x)]
    colour = cv2.remap(texture, pixel[0], pixel[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    mask, open_pixels = np.zeros(u.shape, bool), np.ones(u.shape, bool)
    for layer in sorted(layers, key=lambda one: -one.top):
        reach = (layer.top - origin[2]) / rays[..., 2]
        x, y = (origin[i] + reach * rays[..., i] for i in (0, 1))
        hit = open_pixels & _inside(layer.corners, x, y)
        weave = rng.normal(0, 4, u.shape) + 6 * np.sin(25 * x + 9 * y)
        colour[hit] = (np.array(layer.colour) + weave[..., None])[hit]
        depth = np.where(hit, reach, depth)
        mask |= hit & layer.is_cloth
        open_pixels &= ~hit
    return np.clip(colour, 0, 255), depth, mask


def _inside(corners: FloatArray, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
    """Whether points lie in a polygon (even-odd rule)."""
    inside = np.zeros(x.shape, bool)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return inside


def _wood_texture(wood: tuple[int, int, int], rng: np.random.Generator) -> FloatArray:
    """Planks of slightly different tone with a grain along y; 2 mm a pixel."""
    side = 1200
    grain = cv2.GaussianBlur(rng.normal(0, 1, (side, side)), (0, 0), sigmaX=40, sigmaY=1.2)
    grain = 0.075 * grain / grain.std()
    planks = np.repeat(rng.normal(0, 0.06, side // 60), 60)[:, None]
    seams = np.where(np.arange(side) % 60 == 0, -0.25, 0.0)[:, None]
    tone = 1.0 + grain + planks + seams
    return np.clip(np.array(wood) * tone[..., None] ** [0.8, 1.0, 1.25], 0, 255)


def _camera_colour(colour: FloatArray, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Uneven light, soft optics and the noise of a colour camera."""
    v, u = np.mgrid[-1 : 1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    light = 1.0 - 0.12 * u - 0.1 * v - 0.12 * (u**2 + v**2)
    blurred = cv2.GaussianBlur(colour * light[..., None], (0, 0), 0.8)
    noisy = blurred + rng.normal(0, 3, colour.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def _kinect_depth(depth: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Noise of a Kinect v1: axial (Nguyen 2012), lateral, 1/8 px of disparity, drop-outs."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    u, v = (axis + rng.normal(0, 0.8, u.shape).astype(np.float32) for axis in (u, v))
    moved = cv2.remap(depth, u, v, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    noisy = moved + rng.normal(0, 1, depth.shape) * (0.0012 + 0.0019 * (moved - 0.4) ** 2)
    disparity = np.round(8 * FOCAL_LENGTH * BASELINE / noisy) / 8
    measured = FOCAL_LENGTH * BASELINE / disparity
    blobs = cv2.GaussianBlur(rng.normal(0, 1, depth.shape), (0, 0), 2.0)
    measured[blobs > 2.6 * blobs.std()] = np.nan
    measured[rng.random(depth.shape) < 0.005] = np.nan
    measured[:8], measured[:, :6] = np.nan, np.nan
    return measured
