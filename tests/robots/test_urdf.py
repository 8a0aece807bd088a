"""The URDF of each robot, read by MuJoCo, moves and weighs as the MJCF does."""

import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from posed import mass_matrix

from footfall import Robot, load_robot
from footfall.robots.description import available_robots
from footfall.robots.urdf import urdf


@pytest.fixture(params=[*available_robots(), "awkward"])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Robot:
    """Each robot, and a go1 with a hinge beside its body's origin and two hinges, rotated at 0, on a body."""
    if request.param != "awkward":
        return load_robot(request.param)
    robot = load_robot("go1")
    shutil.copy(robot.xml_path, tmp_path)
    thigh, calf = '"FR_thigh_joint" class="hip"', '<joint name="FL_calf_joint" class="knee"/>'
    toe = '<joint name="toe" axis="1 0 0" range="-1 1" pos="0 0.03 -0.1" ref="-0.2" class="knee"/>'
    edit(tmp_path, robot.description.model, thigh, f'{thigh} pos="0.01 0.02 0.03" ref="0.4"')
    edit(tmp_path, robot.description.model, calf, f'{calf.removesuffix("/>")} pos="0.02 0 0.01"/>{toe}')
    return replace(robot, folder=tmp_path)


def as_read(text: str) -> mujoco.MjSpec:
    """A URDF read by MuJoCo, with all links kept and a free base."""
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    spec.body("base_link").add_freejoint()
    for body in spec.bodies:  # MuJoCo needs a mass between two joints
        if body.name.endswith("_joint"):
            body.mass, body.inertia, body.explicitinertial = 1e-9, [1e-9] * 3, True
    return spec


def above_ground(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model, without reflected inertia as in a URDF, over a floor with contacts at any height."""
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], margin=9)
    model = spec.compile()
    model.dof_armature[:] = 0.0
    return model


def with_angles(model: mujoco.MjModel, pose: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:7] = (0.3, -0.2, 0.4, 0.7, 0.1, -0.5, 0.5)
    for name, angle in pose.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    return data


def lowest_solids(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Height of the lowest point of each body that can touch, m, (nbody,); infinite without such a point."""
    of_ground = (data.contact.geom == model.geom("ground").id).any(axis=1)
    body = model.geom_bodyid[data.contact.geom[of_ground]].max(axis=1)  # the ground's body is 0
    heights = np.full(model.nbody, np.inf)
    np.minimum.at(heights, body, data.contact.dist[of_ground])
    return heights


def test_links_have_the_motion_masses_and_solid_shapes_of_the_bodies(robot: Robot) -> None:
    made = above_ground(as_read(urdf(robot)))
    own = above_ground(mujoco.MjSpec.from_file(str(robot.xml_path)))
    joints = [own.joint(joint).name for joint in range(1, own.njnt)]
    for angles in np.random.default_rng(0).uniform(*own.jnt_range[1:].T, (5, len(joints))):
        pose = dict(zip(joints, angles.tolist(), strict=True))
        in_mjcf, in_urdf = with_angles(own, pose), with_angles(made, pose)
        for body in map(own.body, range(1, own.nbody)):
            link = in_urdf.body(body.name)
            np.testing.assert_allclose(link.xmat, in_mjcf.body(body.id).xmat, atol=1e-7)
            np.testing.assert_allclose(link.xipos, in_mjcf.body(body.id).xipos, atol=1e-7)
        imu = in_mjcf.site(robot.description.imu)
        np.testing.assert_allclose(in_urdf.body("imu_link").xpos, imu.xpos, atol=1e-7)
        np.testing.assert_allclose(in_urdf.body("imu_link").xmat, imu.xmat, atol=1e-7)
        for foot in robot.description.feet:
            middle = np.mean([in_mjcf.geom(name).xpos for name in foot.geoms], axis=0)
            np.testing.assert_allclose(in_urdf.body(f"{foot.name}_sole").xpos, middle, atol=1e-7)
        matrices = (mass_matrix(model, data, pose) for model, data in ((made, in_urdf), (own, in_mjcf)))
        np.testing.assert_allclose(*matrices, rtol=1e-6, atol=1e-7)
        links = [made.body(own.body(body).name).id for body in range(1, own.nbody)]
        lowest = lowest_solids(made, in_urdf)[links], lowest_solids(own, in_mjcf)[1:]
        np.testing.assert_allclose(*lowest, atol=1e-6)
