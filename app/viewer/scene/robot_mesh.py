"""Visual meshes of a robot's URDF, decimated, one for each moving joint and colour."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports] (its wheel is found through a .pth file)
import trimesh
import yourdfpy
from numpy.typing import NDArray

from app.drawing.palette import DEFAULT_MATERIAL, MATERIALS, Colour
from walkcore.motion.body_model import load_model
from walkcore.motion.shapes import turned_up
from walkcore.robot import BodyModel
from walkcore.values import Vector

CREASE = np.radians(35.0)  # edges sharper than this stay sharp under smooth shading
AGGRESSION = 4  # of the decimation: slower to give up a shape than the library's own 7
LONGEST_GAP = 0.4  # [m] around: smaller openings of a shell, such as a grille's, are closed, or a decimation tears them
FEWEST_FACES = 2300  # of a part, times the ratio: fewer would eat the shape of the fingers


@dataclass(frozen=True, slots=True, eq=False)
class BodyPart:
    """Rigid part of the robot, in the frame of the joint that moves it."""

    joint: int
    """Index in the Pinocchio model."""
    colour: Colour
    vertices: NDArray[np.float32]
    """[m], shape (V, 3)."""
    faces: NDArray[np.uint32]
    """Shape (F, 3)."""

    def quantised(self) -> tuple[NDArray[np.int16], NDArray[np.unsignedinteger], float]:
        """Vertices in whole steps, faces in as few bytes as hold them, and the step [m]: half the bytes to send."""
        step = float(np.max(np.abs(self.vertices))) / np.iinfo(np.int16).max
        index = np.uint16 if len(self.vertices) <= np.iinfo(np.uint16).max else np.uint32
        return np.round(self.vertices / step).astype(np.int16), self.faces.astype(index), step


@lru_cache(maxsize=2)  # of the robot and of its ghosts, for every scene
def shared_parts(body: BodyModel, face_ratio: float) -> tuple[BodyPart, ...]:
    """The same as `body_parts`, computed once."""
    return tuple(body_parts(body, load_model(body), face_ratio))


def body_parts(body: BodyModel, model: pin.Model, face_ratio: float) -> list[BodyPart]:
    """Parts that a viewer draws.

    Args:
        body: has the URDF.
        model: built from the same URDF.
        face_ratio: fraction of the faces that is kept, in (0, 1]; shared out by area, because the small parts
            inside the hips have the most faces and the large shells outside show the least of a decimation.
    """
    find_mesh = partial(yourdfpy.filename_handler_magic, dir=body.urdf.parent)
    urdf = yourdfpy.URDF.load(str(body.urdf), filename_handler=find_mesh, build_scene_graph=False, load_meshes=False)
    colours = {material.name: material.color for material in urdf.robot.materials if material.color is not None}
    pieces: dict[tuple[int, Colour], list[trimesh.Trimesh]] = defaultdict(list)
    for name, link in urdf.link_map.items():
        frame = model.frames[model.getFrameId(name, pin.FrameType.BODY)]
        for visual in link.visuals:
            mesh = _mesh(visual.geometry, find_mesh)
            origin = np.eye(4) if visual.origin is None else visual.origin
            mesh.apply_transform(frame.placement.homogeneous @ origin)
            mesh.merge_vertices(merge_norm=True, merge_tex=True)
            pieces[frame.parentJoint, _colour(visual.material, colours)].append(mesh)
    meshes = [mesh for group in pieces.values() for mesh in group]
    faces_per_area = face_ratio * sum(len(mesh.faces) for mesh in meshes) / sum(mesh.area for mesh in meshes)
    fewest = face_ratio * FEWEST_FACES
    return [
        _part(joint, colour, [_decimated(mesh, max(fewest, faces_per_area * mesh.area)) for mesh in group])
        for (joint, colour), group in pieces.items()
    ]


def drawn_height(parts: Sequence[BodyPart], model: pin.Model, q: Vector) -> float:
    """Height of the highest point of all parts above the lowest one, in a configuration of shape (nq,) [m]."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    places = [data.oMi[part.joint] for part in parts]
    heights = [part.vertices @ at.rotation[2] + at.translation[2] for part, at in zip(parts, places, strict=True)]
    return float(np.ptp(np.concatenate(heights)))


def _colour(material: yourdfpy.Material | None, colours: Mapping[str | None, yourdfpy.Color]) -> Colour:
    """Ours for the material of a name that we know, else the URDF's own."""
    if material is None:
        return DEFAULT_MATERIAL
    if material.name in MATERIALS:
        return MATERIALS[material.name]
    own = material.color or colours.get(material.name)
    if own is None:
        return DEFAULT_MATERIAL
    r, g, b = (round(255.0 * min(max(float(share), 0.0), 1.0)) for share in own.rgba[:3])
    return r, g, b


def _mesh(geometry: yourdfpy.Geometry, find_mesh: partial[str]) -> trimesh.Trimesh:
    if geometry.mesh is not None:
        path = find_mesh(geometry.mesh.filename)
        mesh = trimesh.load_mesh(path)
        if geometry.mesh.scale is not None:
            mesh.apply_scale(geometry.mesh.scale)  # trimesh turns the faces of a mirrored mesh around
        turned = np.eye(4)
        turned[:3, :3] = turned_up(Path(path))
        mesh.apply_transform(turned)
        return mesh
    if geometry.box is not None:
        return trimesh.creation.box(geometry.box.size)
    if geometry.cylinder is not None:
        return trimesh.creation.cylinder(geometry.cylinder.radius, geometry.cylinder.length, sections=24)
    assert geometry.sphere is not None  # URDF knows no fifth shape
    return trimesh.creation.icosphere(radius=geometry.sphere.radius)


def _part(joint: int, colour: Colour, meshes: list[trimesh.Trimesh]) -> BodyPart:
    creased = trimesh.graph.smooth_shade(trimesh.util.concatenate(meshes), angle=CREASE)
    return BodyPart(joint, colour, creased.vertices.astype(np.float32), creased.faces.astype(np.uint32))


def _decimated(mesh: trimesh.Trimesh, nb_faces: float) -> trimesh.Trimesh:
    if nb_faces >= len(mesh.faces):
        return mesh
    return closed(mesh).simplify_quadric_decimation(face_count=round(nb_faces), aggression=AGGRESSION)


def closed(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Mesh with its small openings closed, each by a fan around its middle."""
    vertices: list[NDArray[np.float64]] = [mesh.vertices]
    faces: list[NDArray[np.int64]] = [mesh.faces]
    for nb_fans, opening in enumerate(_openings(mesh)):
        centre = len(mesh.vertices) + nb_fans
        vertices.append(np.mean(mesh.vertices[opening], axis=0)[None])
        faces.append(np.column_stack([np.roll(opening, -1), opening, np.full(len(opening), centre)]))
    return trimesh.Trimesh(np.vstack(vertices), np.vstack(faces), process=False)


def _openings(mesh: trimesh.Trimesh) -> Iterator[NDArray[np.int64]]:
    """Loops of edges that belong to one face only, no longer around than the longest gap; vertices in order."""
    _, first, counts = np.unique(mesh.edges_sorted, axis=0, return_index=True, return_counts=True)
    following: dict[int, list[int]] = defaultdict(list)
    for start, end in mesh.edges[first[counts == 1]].tolist():
        following[start].append(end)
    for start in list(following):
        while following[start]:
            loop = [start]
            while following[loop[-1]]:  # else it leads nowhere: faces that are not wound alike
                end = following[loop[-1]].pop()
                if end == start:
                    if len(loop) > 2 and _length_around(mesh.vertices[loop]) <= LONGEST_GAP:
                        yield np.array(loop)
                    break
                loop.append(end)


def _length_around(corners: NDArray[np.float64]) -> float:
    return float(np.sum(np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)))
