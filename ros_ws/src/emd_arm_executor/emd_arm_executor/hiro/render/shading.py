"""Colours of pixels from what the rasteriser found there."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from emd_core.frames import FloatArray

_WOOD = 1
_TILES = 2
_TILE_SIZE = 0.5
_TILE_SHADE = 0.93
# Stepping this far off a surface keeps it from shading itself where the lamp's picture is coarse.
_SHADOW_BIAS = 0.004


@numba.njit(cache=True, fastmath=True, error_model="numpy")
def shade(
    keys: FloatArray,
    indices: NDArray[np.int32],
    intrinsics: FloatArray,
    camera_to_waist: FloatArray,
    vertices: FloatArray,
    normals: FloatArray,
    triangles: NDArray[np.int32],
    colours: NDArray[np.float32],
    smooth: NDArray[np.bool_],
    materials: NDArray[np.uint8],
    wood: NDArray[np.float32],
    wood_placement: FloatArray,
    light: FloatArray,
    shadow_keys: FloatArray,
    waist_to_shadow: FloatArray,
    image: NDArray[np.uint8],
) -> None:
    """Light every pixel that shows a triangle; the others keep the image's colour.

    Args:
        keys: 1 / depth, shape (H, W), 1/m.
        indices: Triangle seen, shape (H, W), -1 where nothing.
        intrinsics: fx, fy, cx, cy, pixels.
        camera_to_waist: Pose of the optical frame, 4 x 4.
        vertices: WAIST frame, shape (V, 3), metres.
        normals: WAIST frame, shape (V, 3).
        triangles: Shape (T, 3).
        colours: Shape (T, 3), 0..1.
        smooth: Whether to interpolate the normals, shape (T,).
        materials: `Material` of each triangle, shape (T,).
        wood: Texture of the table top, shape (rows, columns, 3), 0..1.
        wood_placement: x and y of the texture's corner and the length of a texel, metres.
        light: Direction towards the lamp (3), ambient share, lamp's share.
        shadow_keys: Nearest key in the light's picture, shape (S, S); (1, 1) for no shadows.
        waist_to_shadow: Maps a point to column, row and key of that picture, 3 x 4.
        image: RGB, shape (H, W, 3); written to.
    """
    height, width = keys.shape
    fx, fy, cx, cy = intrinsics
    # Scalars, not array elements: the compiler cannot know that `image` overlaps none of them.
    r00, r01, r02, tx = camera_to_waist[0]
    r10, r11, r12, ty = camera_to_waist[1]
    r20, r21, r22, tz = camera_to_waist[2]
    light_x, light_y, light_z, ambient, lamp = light
    wood_x, wood_y, texel = wood_placement
    wood_rows, wood_columns = wood.shape[0], wood.shape[1]
    for row in range(height):
        across_y = (row - cy) / fy
        for column in range(width):
            triangle = indices[row, column]
            if triangle < 0:
                continue
            depth = 1.0 / keys[row, column]
            across_x = (column - cx) / fx
            x = (r00 * across_x + r01 * across_y + r02) * depth + tx
            y = (r10 * across_x + r11 * across_y + r12) * depth + ty
            z = (r20 * across_x + r21 * across_y + r22) * depth + tz
            a = triangles[triangle, 0]
            nx, ny, nz = normals[a, 0], normals[a, 1], normals[a, 2]
            if smooth[triangle]:
                nx, ny, nz = _normal_at(x, y, z, vertices, normals, triangles[triangle])
            brightness = ambient * (0.75 + 0.25 * nz)
            facing = nx * light_x + ny * light_y + nz * light_z
            if facing > 0.0:
                px, py, pz = x + _SHADOW_BIAS * nx, y + _SHADOW_BIAS * ny, z + _SHADOW_BIAS * nz
                brightness += lamp * facing * _visibility(px, py, pz, shadow_keys, waist_to_shadow)
            red, green, blue = colours[triangle, 0], colours[triangle, 1], colours[triangle, 2]
            if materials[triangle] == _WOOD and nz > 0.5:
                i = min(max(int((x - wood_x) / texel), 0), wood_rows - 1)
                j = min(max(int((y - wood_y) / texel), 0), wood_columns - 1)
                red, green, blue = wood[i, j, 0], wood[i, j, 1], wood[i, j, 2]
            elif materials[triangle] == _TILES:
                if (int(np.floor(x / _TILE_SIZE)) + int(np.floor(y / _TILE_SIZE))) % 2 == 0:
                    brightness *= _TILE_SHADE
            scale = 255.0 * brightness
            image[row, column, 0] = np.uint8(min(scale * red, 255.0))
            image[row, column, 1] = np.uint8(min(scale * green, 255.0))
            image[row, column, 2] = np.uint8(min(scale * blue, 255.0))


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
    a, b, c = corners[0], corners[1], corners[2]
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
def _visibility(
    x: float, y: float, z: float, shadow_keys: FloatArray, to_shadow: FloatArray
) -> float:
    """Share of the lamp that reaches a point, 0..1, over four texels of its picture."""
    size = shadow_keys.shape[0]
    u = to_shadow[0, 0] * x + to_shadow[0, 1] * y + to_shadow[0, 2] * z + to_shadow[0, 3]
    v = to_shadow[1, 0] * x + to_shadow[1, 1] * y + to_shadow[1, 2] * z + to_shadow[1, 3]
    light = 1.0
    if u >= 0.0 and v >= 0.0 and u < size - 1 and v < size - 1:
        key = to_shadow[2, 0] * x + to_shadow[2, 1] * y + to_shadow[2, 2] * z + to_shadow[2, 3]
        column, row = int(u), int(v)
        du, dv = u - column, v - row
        here = 1.0 if shadow_keys[row, column] <= key else 0.0
        right = 1.0 if shadow_keys[row, column + 1] <= key else 0.0
        below = 1.0 if shadow_keys[row + 1, column] <= key else 0.0
        beyond = 1.0 if shadow_keys[row + 1, column + 1] <= key else 0.0
        top, bottom = here + du * (right - here), below + du * (beyond - below)
        light = top + dv * (bottom - top)
    return light
