# pyright: basic, reportMissingImports=false
# (Pinocchio ships no types)
"""Shapes of a URDF's links, with the meshes of Collada files the way up that they say.

A Collada file names the axis of its mesh that points up, and origins in a URDF are written for a mesh that has been
turned to z up. Pinocchio and trimesh take the vertices as they are, so that the turn is made here.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin

from walkcore.values import Matrix, frozen_copy

IS_Y_UP = re.compile(rb"<up_axis>\s*Y_UP\s*</up_axis>")
HEAD = 64 * 1024  # bytes of a Collada file, within which its <asset> says which way is up
AS_IT_IS = frozen_copy(np.eye(3))
Y_UP = frozen_copy([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@cache
def turned_up(mesh: Path) -> Matrix:
    """R_shape_mesh: turn that puts a mesh upright, by its file, shape (3, 3); none but for a Collada file with y up."""
    if mesh.suffix.lower() != ".dae":
        return AS_IT_IS
    with mesh.open("rb") as file:
        return Y_UP if IS_Y_UP.search(file.read(HEAD)) else AS_IT_IS


def urdf_shapes(model: pin.Model, urdf: Path, packages: Path, kind: pin.GeometryType) -> pin.GeometryModel:
    """Shapes of all links, each placed in the frame of the joint that moves it.

    Args:
        model: built from the same URDF.
        urdf: its file.
        packages: folder in which its `package://` addresses start.
        kind: shapes of collisions, or those that are drawn.
    """
    shapes = pin.buildGeomFromUrdf(model, str(urdf), kind, package_dirs=[str(packages)])
    for shape in shapes.geometryObjects:
        if shape.meshPath:
            shape.placement = shape.placement * pin.SE3(turned_up(Path(shape.meshPath)), np.zeros(3))
    return shapes
