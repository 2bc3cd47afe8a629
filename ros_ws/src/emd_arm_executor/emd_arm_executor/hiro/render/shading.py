"""Colours of pixels from what the rasteriser found there."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

# Vertices (V, 3) in metres, their normals, triangles (T, 3), their colours, smoothness, materials
# and segments.
Surface = tuple[
    FloatArray,
    FloatArray,
    NDArray[np.int32],
    NDArray[np.float32],
    NDArray[np.bool_],
    NDArray[np.uint8],
    NDArray[np.uint8],
]
# Texture (rows, columns, 3), 0..1; x and y of its corner and the length of a texel, metres.
Wood = tuple[NDArray[np.float32], FloatArray]
# Direction towards the lamp (3), ambient share, lamp's share; the nearest keys in the lamp's
# picture (S, S), (1, 1) for no shadows; the 3 x 4 map from WAIST to its column, row and key.
Lighting = tuple[FloatArray, FloatArray, FloatArray]

_WOOD = 1
_TILES = 2
_TILE_SIZE = 0.5
_TILE_SHADE = 0.93
# Stepping this far off a surface keeps it from shading itself where the lamp's picture is coarse.
_SHADOW_BIAS = 0.004


@numba.njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def shade(
    keys: FloatArray,
    indices: NDArray[np.int32],
    intrinsics: FloatArray,
    camera_to_waist: FloatArray,
    surface: Surface,
    wood: Wood,
    lighting: Lighting,
    background: NDArray[np.uint8],
    image: NDArray[np.uint8],
    depths: NDArray[np.float32],
    segmentation: NDArray[np.uint8],
) -> None:
    """Colour every pixel, and tell depth and segment of those that show a triangle.

    Args:
        keys: 1 / depth, shape (H, W), 1/m.
        indices: Triangle seen, shape (H, W), -1 where nothing.
        intrinsics: fx, fy, cx, cy, pixels.
        camera_to_waist: Pose of the optical frame, 4 x 4.
        surface: The triangles, WAIST frame.
        wood: Texture of the table top.
        lighting: The lamp and its shadows.
        background: RGB of pixels that show no triangle.
        image: RGB, shape (H, W, 3); written to.
        depths: Along the optical axis, metres, shape (H, W); written to where a triangle is seen.
        segmentation: Part that each pixel shows, shape (H, W); likewise.
    """
    vertices, normals, triangles, colours, smooth, materials, segments = surface
    light, shadow_keys, to_shadow = lighting
    fx, fy, cx, cy = intrinsics
    lamp_x, lamp_y, lamp_z, ambient, lamp_share = light
    # Scalars, not array elements: the compiler cannot know that `image` overlaps none of them.
    r00, r01, r02, tx = camera_to_waist[0]
    r10, r11, r12, ty = camera_to_waist[1]
    r20, r21, r22, tz = camera_to_waist[2]
    s00, s01, s02, su = to_shadow[0]
    s10, s11, s12, sv = to_shadow[1]
    s20, s21, s22, sk = to_shadow[2]
    # Unsigned indices spare numba the test whether they count from the end.
    for row in range(np.uintp(keys.shape[0])):
        across_y = (row - cy) / fy
        seen = np.int32(-1)
        for column in range(np.uintp(keys.shape[1])):
            if indices[row, column] < 0:
                for channel in range(3):
                    image[row, column, channel] = background[channel]
                continue
            # Neighbours mostly show the same triangle.
            if indices[row, column] != seen:
                seen = indices[row, column]
                triangle = np.uintp(seen)
                corner = np.uintp(triangles[triangle, 0])
                nx, ny, nz = normals[corner, 0], normals[corner, 1], normals[corner, 2]
                paint = colours[triangle, 0], colours[triangle, 1], colours[triangle, 2]
                rounded, material = smooth[triangle], materials[triangle]
                segment = segments[triangle]
            depth = 1.0 / keys[row, column]
            across_x = (column - cx) / fx
            x = (r00 * across_x + r01 * across_y + r02) * depth + tx
            y = (r10 * across_x + r11 * across_y + r12) * depth + ty
            z = (r20 * across_x + r21 * across_y + r22) * depth + tz
            if rounded:
                nx, ny, nz = _normal_at(x, y, z, vertices, normals, triangles[triangle])
            # Light from all around, more of it from above, and the lamp's.
            brightness = ambient * (0.75 + 0.25 * nz)
            facing = nx * lamp_x + ny * lamp_y + nz * lamp_z
            if facing > 0.0:
                px, py, pz = x + _SHADOW_BIAS * nx, y + _SHADOW_BIAS * ny, z + _SHADOW_BIAS * nz
                u = s00 * px + s01 * py + s02 * pz + su
                v = s10 * px + s11 * py + s12 * pz + sv
                key = s20 * px + s21 * py + s22 * pz + sk
                brightness += lamp_share * facing * _visibility(u, v, key, shadow_keys)
            scale = 255.0 * brightness
            red, green, blue = paint
            if material == _WOOD and nz > 0.5:
                red, green, blue = _wood_at(x, y, wood)
            elif material == _TILES and (_tile(x) + _tile(y)) % 2 == 0:
                scale *= _TILE_SHADE
            image[row, column, 0] = np.uint8(min(scale * red, 255.0))
            image[row, column, 1] = np.uint8(min(scale * green, 255.0))
            image[row, column, 2] = np.uint8(min(scale * blue, 255.0))
            depths[row, column] = depth
            segmentation[row, column] = segment


@numba.njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _wood_at(x: float, y: float, wood: Wood) -> tuple[float, float, float]:
    texture, placement = wood
    row, column = (x - placement[0]) / placement[2], (y - placement[1]) / placement[2]
    i = np.uintp(min(max(row, 0.0), texture.shape[0] - 1.0))
    j = np.uintp(min(max(column, 0.0), texture.shape[1] - 1.0))
    return texture[i, j, 0], texture[i, j, 1], texture[i, j, 2]


@numba.njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _tile(position: float) -> int:
    return int(np.floor(position / _TILE_SIZE))


@numba.njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _normal_at(
    x: float,
    y: float,
    z: float,
    vertices: FloatArray,
    normals: FloatArray,
    corners: NDArray[np.int32],
) -> tuple[float, float, float]:
    """Interpolate the corners' normals at a point of their triangle."""
    a, b, c = np.uintp(corners[0]), np.uintp(corners[1]), np.uintp(corners[2])
    ox, oy, oz = vertices[a, 0], vertices[a, 1], vertices[a, 2]
    ux, uy, uz = vertices[b, 0] - ox, vertices[b, 1] - oy, vertices[b, 2] - oz
    vx, vy, vz = vertices[c, 0] - ox, vertices[c, 1] - oy, vertices[c, 2] - oz
    px, py, pz = x - ox, y - oy, z - oz
    uu, uv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz
    vv = vx * vx + vy * vy + vz * vz
    pu, pv = px * ux + py * uy + pz * uz, px * vx + py * vy + pz * vz
    scale = 1.0 / max(uu * vv - uv * uv, 1e-30)
    share_b, share_c = (vv * pu - uv * pv) * scale, (uu * pv - uv * pu) * scale
    share_a = 1.0 - share_b - share_c
    nx = share_a * normals[a, 0] + share_b * normals[b, 0] + share_c * normals[c, 0]
    ny = share_a * normals[a, 1] + share_b * normals[b, 1] + share_c * normals[c, 1]
    nz = share_a * normals[a, 2] + share_b * normals[b, 2] + share_c * normals[c, 2]
    length = 1.0 / np.sqrt(max(nx * nx + ny * ny + nz * nz, 1e-30))
    return nx * length, ny * length, nz * length


@numba.njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _visibility(u: float, v: float, key: float, shadow_keys: FloatArray) -> float:
    """Share of the lamp that reaches a point, 0..1, over four texels of the lamp's picture.

    Args:
        u: Column of the point in that picture.
        v: Its row.
        key: Its key.
        shadow_keys: The picture.
    """
    size = shadow_keys.shape[0]
    one = np.uintp(1)
    light = 1.0
    if u >= 0.0 and v >= 0.0 and u < size - 1 and v < size - 1:
        column, row = np.uintp(u), np.uintp(v)
        du, dv = u - column, v - row
        here = 1.0 if shadow_keys[row, column] <= key else 0.0
        right = 1.0 if shadow_keys[row, column + one] <= key else 0.0
        below = 1.0 if shadow_keys[row + one, column] <= key else 0.0
        beyond = 1.0 if shadow_keys[row + one, column + one] <= key else 0.0
        top, bottom = here + du * (right - here), below + du * (beyond - below)
        light = top + dv * (bottom - top)
    return light
