"""The scene of a film: a chequered floor, a sky, lights, and arrows for velocities."""

from pathlib import Path

import mujoco
import numpy as np

from footfall.plant.ground import replace_ground
from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec
from footfall.robots.spec_edits import FLOOR
from footfall.terrain.ground import Ground

FLOOR_MATERIAL = "footfall_floor"
EXTENT = 3.0  # of the scene in standing heights; sets the camera's near and far planes
HIDDEN_GROUPS = 3  # groups from this one on hold collision geometry, by convention


def scene_model(
    robot: Robot, plant: Path | None, width: int, height: int, ground: Ground | None = None
) -> mujoco.MjModel:
    """Model of the plant in a scene; its `qpos` has the layout of the simulated robot.

    Raises:
        UserError: the plant's file cannot be read.
    """
    spec = load_spec(plant or robot.xml_path)
    for item in [*spec.actuators, *spec.sensors, *spec.keys]:
        spec.delete(item)
    _add_materials(spec)
    if ground is None:
        planes = [geom for geom in spec.worldbody.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE]
        for plane in planes or [spec.worldbody.add_geom(name=FLOOR, type=mujoco.mjtGeom.mjGEOM_PLANE)]:
            plane.size = [0, 0, 0.05]
            plane.material = FLOOR_MATERIAL
    else:
        replace_ground(spec, ground)
        spec.stat.extent = EXTENT * robot.description.standing_height_m  # not the ground's
        for geom in spec.worldbody.geoms:
            geom.material = FLOOR_MATERIAL
    _add_lights(spec, 2.0 * robot.description.standing_height_m)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.shadowsize = 1024
    spec.visual.quality.offsamples = 0  # software rendering with antialiasing takes twice as long
    spec.visual.map.znear, spec.visual.map.zfar = 0.02, 60.0
    spec.visual.map.fogstart, spec.visual.map.fogend = 6.0, 25.0
    spec.visual.rgba.fog = spec.visual.rgba.haze = [0.82, 0.87, 0.93, 1.0]
    return spec.compile()


def size_of(model: mujoco.MjModel, qpos: np.ndarray) -> float:
    """The longest side, m, of the upright box around a robot at a `qpos`: its length, width or height."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    drawn = (model.geom_bodyid > 0) & (model.geom_group < HIDDEN_GROUPS)
    sides = np.abs(data.geom_xmat[drawn].reshape(-1, 3, 3)) @ model.geom_aabb[drawn, 3:, None]
    centre = (
        data.geom_xmat[drawn].reshape(-1, 3, 3) @ model.geom_aabb[drawn, :3, None]
        + data.geom_xpos[drawn, :, None]
    )
    return float(((centre + sides).max(axis=0) - (centre - sides).min(axis=0)).max())


def follow(camera: mujoco.MjvCamera, position: np.ndarray, size_m: float, is_level: bool = True) -> None:
    """Point a free camera at a base position (3,), from the side, so that a robot of size `size_m` fits.

    On level ground the camera is in front of the robot, elsewhere behind it, where no step hides the robot.
    """
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    height = 0.8 * position[2] if is_level else position[2] - 0.1 * size_m
    camera.lookat[:] = position[0], position[1], height
    camera.distance = 2.2 * size_m
    camera.azimuth, camera.elevation = (130.0, -16.0) if is_level else (50.0, -24.0)


def add_arrow(scene: mujoco.MjvScene, start: np.ndarray, vector: np.ndarray, colour: np.ndarray) -> None:
    """Draw an arrow from a point (3,) along a vector (3,), m; very short vectors are not drawn."""
    if np.linalg.norm(vector) < 0.03 or scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(
        geom, mujoco.mjtGeom.mjGEOM_ARROW, np.zeros(3), np.zeros(3), np.zeros(9), colour.astype(np.float32)
    )
    mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, 0.014, start, start + vector)
    scene.ngeom += 1


def _add_materials(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="footfall_sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.82, 0.87, 0.93],
        rgb2=[0.36, 0.52, 0.72],
        width=256,
        height=256 * 6,
    )
    spec.add_texture(
        name="footfall_checker",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.40, 0.46, 0.50],
        rgb2=[0.34, 0.40, 0.44],
        markrgb=[0.50, 0.56, 0.60],
        width=300,
        height=300,
    )
    material = spec.add_material(
        name=FLOOR_MATERIAL, texrepeat=[2, 2], texuniform=True, specular=0.1, shininess=0.2
    )
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "footfall_checker"


def _add_lights(spec: mujoco.MjSpec, size_m: float) -> None:
    """Ambient light, a sun, and a lamp above the base for the shadow.

    The lamp follows the base; MuJoCo's shadow of a directional light is coarse at this scale.
    """
    spec.visual.headlight.ambient = [0.35, 0.35, 0.35]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.visual.headlight.specular = [0.05, 0.05, 0.05]
    direction = np.array([-0.25, 0.3, -1.0])
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=direction,
        diffuse=[0.3, 0.3, 0.29],
        castshadow=False,
    )
    base = next(joint.parent for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE)
    base.add_light(
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        pos=-6.0 * size_m * direction,
        dir=direction,
        diffuse=[0.45, 0.44, 0.42],
        specular=[0.2, 0.2, 0.2],
        cutoff=45.0,
        exponent=8.0,
        castshadow=True,
    )
