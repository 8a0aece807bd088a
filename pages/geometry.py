"""The visible geoms of a robot's model, as triangles."""

from typing import TYPE_CHECKING, NamedTuple

import mujoco
import numpy as np

if TYPE_CHECKING:
    from trimesh import Trimesh

COLLISION_GROUP = 3  # by convention, geoms of this group and above only collide
UNPAINTED = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default colour


class Shape(NamedTuple):
    """One geom."""

    geom: int
    body: int
    vertices: np.ndarray  # (v, 3) m, geom frame
    faces: np.ndarray  # (f, 3)
    position: np.ndarray  # (3,) m, body frame
    quaternion: np.ndarray  # (4,) w x y z, geom to body
    rgba: np.ndarray  # (4,) 0 to 1


def visible_shapes(model: mujoco.MjModel) -> list[Shape]:
    """All visible geoms except planes and height fields: the ground is drawn separately."""
    shapes = []
    for geom in np.flatnonzero(model.geom_group < COLLISION_GROUP).tolist():
        mesh = _triangles(model, geom)
        if mesh is None:
            continue
        shape = Shape(
            geom=geom,
            body=int(model.geom_bodyid[geom]),
            vertices=np.asarray(mesh.vertices, dtype=np.float32),
            faces=np.asarray(mesh.faces, dtype=np.uint32),
            position=model.geom_pos[geom].copy(),
            quaternion=model.geom_quat[geom].copy(),
            rgba=_colour(model, geom),
        )
        shapes.append(shape)
    return shapes


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """A geom's own colour, or its material's if it has none of its own."""
    own_colour, material = model.geom_rgba[geom], model.geom_matid[geom]
    return (
        model.mat_rgba[material] if material >= 0 and np.allclose(own_colour, UNPAINTED) else own_colour
    ).copy()


def _triangles(model: mujoco.MjModel, geom: int) -> "Trimesh | None":
    from trimesh import creation

    size, kind = model.geom_size[geom], mujoco.mjtGeom
    match model.geom_type[geom]:
        case kind.mjGEOM_BOX:
            return creation.box(extents=2 * size)
        case kind.mjGEOM_SPHERE:
            return creation.icosphere(subdivisions=3, radius=size[0])
        case kind.mjGEOM_ELLIPSOID:
            return creation.icosphere(subdivisions=3).apply_scale(size)
        case kind.mjGEOM_CAPSULE:
            return creation.capsule(radius=size[0], height=2 * size[1], count=(24, 12))
        case kind.mjGEOM_CYLINDER:
            return creation.cylinder(radius=size[0], height=2 * size[1], sections=32)
        case kind.mjGEOM_MESH:
            return _mesh(model, model.geom_dataid[geom])
    return None


def _mesh(model: mujoco.MjModel, mesh: int) -> "Trimesh":
    from trimesh import Trimesh

    first_vertex, first_face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return Trimesh(
        model.mesh_vert[first_vertex : first_vertex + model.mesh_vertnum[mesh]],
        model.mesh_face[first_face : first_face + model.mesh_facenum[mesh]],
        process=False,
    )
