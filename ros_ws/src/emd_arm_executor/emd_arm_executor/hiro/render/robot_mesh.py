"""The robot's look: the visual primitives of its URDF, moved by its links."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from emd_arm_executor.hiro.description import URDF_PATH
from emd_arm_executor.hiro.render.mesh import (
    Colour,
    Mesh,
    Segment,
    box,
    cylinder,
    merge,
    sphere,
)
from emd_core.errors import InvalidInputError
from emd_core.frames import FloatArray

_SOLID_COLOUR: Colour = (0.75, 0.62, 0.50)


@dataclass(frozen=True)
class RobotMesh:
    """A mesh whose vertices are given in the frames of their links.

    Attributes:
        mesh: All shapes, each in its link's frame.
        links: Link of each vertex as an index into the transforms, shape (V,).
    """

    mesh: Mesh
    links: NDArray[np.int64]

    @classmethod
    def from_urdf(
        cls, links: Sequence[str], solids: bool = False, path: Path = URDF_PATH
    ) -> RobotMesh:
        """Read the primitives of the links.

        Args:
            links: Link names in the order in which `posed` will get their transforms.
            solids: Read the shapes that collide, all in one colour, instead of those to look at.
            path: The URDF.

        Raises:
            InvalidInputError: If a link with a shape is not named.
        """
        robot = ET.parse(path).getroot()
        colours = _colours(robot)
        meshes, owners = [], []
        for link in robot.findall("link"):
            name = link.get("name", "")
            for shape in link.findall("collision" if solids else "visual"):
                if name not in links:
                    raise InvalidInputError(f"the transform of link {name} is needed to draw it")
                mesh = _shape_mesh(shape, colours)
                meshes.append(mesh)
                owners.append(np.full(len(mesh.vertices), list(links).index(name)))
        return cls(merge(meshes), np.concatenate(owners))

    def posed(self, link_transforms: FloatArray) -> Mesh:
        """Give the mesh with its links at transforms of shape (L, 4, 4)."""
        rotations = link_transforms[self.links, :3, :3]
        vertices = (rotations @ self.mesh.vertices[:, :, None])[:, :, 0]
        normals = (rotations @ self.mesh.normals[:, :, None])[:, :, 0]
        return replace(
            self.mesh, vertices=vertices + link_transforms[self.links, :3, 3], normals=normals
        )


def _shape_mesh(element: ET.Element, colours: dict[str, Colour]) -> Mesh:
    material = element.find("material")
    shape = element.find("geometry/*")
    if shape is None:
        raise InvalidInputError("a shape of the URDF needs a geometry")
    colour = _SOLID_COLOUR if material is None else colours[material.get("name", "")]
    if shape.tag == "box":
        mesh = box(_floats(shape.get("size")), colour, Segment.ROBOT)
    elif shape.tag == "cylinder":
        radius, length = _floats(shape.get("radius"))[0], _floats(shape.get("length"))[0]
        mesh = cylinder(radius, length, colour, Segment.ROBOT)
    elif shape.tag == "sphere":
        mesh = sphere(_floats(shape.get("radius"))[0], colour, Segment.ROBOT)
    else:
        raise InvalidInputError(f"a box, cylinder or sphere is wanted, got {shape.tag}")
    return mesh.moved(_origin(element))


def _colours(robot: ET.Element) -> dict[str, Colour]:
    colours: dict[str, Colour] = {}
    for material in robot.findall("material"):
        for color in material.findall("color"):
            red, green, blue, _ = _floats(color.get("rgba"))
            colours[material.get("name", "")] = (red, green, blue)
    return colours


def _origin(element: ET.Element) -> FloatArray:
    transform = np.eye(4)
    origin = element.find("origin")
    if origin is not None:
        transform[:3, 3] = _floats(origin.get("xyz", "0 0 0"))
        angles = _floats(origin.get("rpy", "0 0 0"))
        transform[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    return transform


def _floats(text: str | None) -> list[float]:
    return [float(word) for word in (text or "").split()]
