"""Triangle meshes of the cell and the primitives that they are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

Colour = tuple[float, float, float]


class Segment(IntEnum):
    """What a pixel shows."""

    NOTHING = 0
    FLOOR = 1
    TABLE = 2
    ROBOT = 3
    CLOTH = 4


class Material(IntEnum):
    """How a triangle gets its colour."""

    PLAIN = 0
    WOOD = 1
    TILES = 2


@dataclass(frozen=True)
class Mesh:
    """Triangles that are seen from their front only (counter-clockwise).

    Attributes:
        vertices: Shape (V, 3), metres.
        normals: Unit normals of the vertices, shape (V, 3).
        triangles: Vertex indices, shape (T, 3).
        colours: Of each triangle, shape (T, 3), 0..1.
        smooth: Whether normals are interpolated over the triangle, shape (T,).
        materials: `Material` of each triangle, shape (T,).
        segments: `Segment` of each triangle, shape (T,).
    """

    vertices: FloatArray
    normals: FloatArray
    triangles: NDArray[np.int32]
    colours: NDArray[np.float32]
    smooth: NDArray[np.bool_]
    materials: NDArray[np.uint8]
    segments: NDArray[np.uint8]

    def moved(self, transform: FloatArray) -> Mesh:
        """Give the mesh moved by a rigid transform, 4 x 4."""
        rotation = transform[:3, :3]
        return replace(
            self,
            vertices=self.vertices @ rotation.T + transform[:3, 3],
            normals=self.normals @ rotation.T,
        )


def make_mesh(
    vertices: FloatArray,
    normals: FloatArray,
    triangles: NDArray[np.int32],
    colour: Colour,
    segment: Segment,
    smooth: bool = False,
    material: Material = Material.PLAIN,
) -> Mesh:
    """Build a mesh of one colour, material and segment."""
    count = len(triangles)
    return Mesh(
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(normals, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.int32),
        np.tile(np.array(colour, dtype=np.float32), (count, 1)),
        np.full(count, smooth),
        np.full(count, material, dtype=np.uint8),
        np.full(count, segment, dtype=np.uint8),
    )


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Join meshes into one.

    Raises:
        InvalidInputError: If there is none.
    """
    if not meshes:
        raise InvalidInputError("at least one mesh is wanted, got none")
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    triangles = [mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate(triangles).astype(np.int32),
        np.concatenate([mesh.colours for mesh in meshes]),
        np.concatenate([mesh.smooth for mesh in meshes]),
        np.concatenate([mesh.materials for mesh in meshes]),
        np.concatenate([mesh.segments for mesh in meshes]),
    )


def box(
    size: Sequence[float], colour: Colour, segment: Segment, material: Material = Material.PLAIN
) -> Mesh:
    """A box of full lengths `size` (metres) about the origin."""
    vertices: list[FloatArray] = []
    normals: list[FloatArray] = []
    triangles: list[list[int]] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            normal = np.zeros(3)
            normal[axis] = sign
            across = np.roll(np.array([0.0, 1.0, 0.0]), axis)
            along = np.cross(normal, across)
            first = len(vertices)
            for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                vertices.append(normal + u * across + v * along)
                normals.append(normal)
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    scaled = np.array(vertices) * np.array(size) / 2
    return make_mesh(
        scaled, np.array(normals), np.array(triangles), colour, segment, material=material
    )


def cylinder(
    radius: float, length: float, colour: Colour, segment: Segment, sides: int = 36
) -> Mesh:
    """A cylinder about z, its middle in the origin; metres."""
    angles = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=1)
    top, bottom = np.array([0, 0, length / 2]), np.array([0, 0, -length / 2])
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    wall = np.concatenate(
        [
            np.stack([here, there, there + sides], axis=1),
            np.stack([here, there + sides, here + sides], axis=1),
        ]
    )
    side = make_mesh(
        np.concatenate([radius * ring + bottom, radius * ring + top]),
        np.concatenate([ring, ring]),
        wall,
        colour,
        segment,
        smooth=True,
    )
    fan = np.stack([np.zeros(sides - 2, int), here[1:-1], here[2:]], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (sides, 1))
    cap_top = make_mesh(radius * ring + top, up, fan, colour, segment)
    cap_bottom = make_mesh(radius * ring + bottom, -up, fan[:, ::-1], colour, segment)
    return merge([side, cap_top, cap_bottom])


def sphere(radius: float, colour: Colour, segment: Segment, sides: int = 24) -> Mesh:
    """A sphere about the origin; metres."""
    rings = sides // 2
    polar = np.linspace(0, np.pi, rings + 1)
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    sine, cosine = np.sin(polar)[:, None], np.cos(polar)[:, None]
    normals = np.stack(
        [sine * np.cos(around), sine * np.sin(around), cosine + 0 * around], axis=-1
    ).reshape(-1, 3)
    triangles = []
    for ring in range(rings):
        for here in range(sides):
            there = (here + 1) % sides
            a, b = ring * sides + here, ring * sides + there
            triangles += [[a, a + sides, b + sides], [a, b + sides, b]]
    return make_mesh(radius * normals, normals, np.array(triangles), colour, segment, smooth=True)
