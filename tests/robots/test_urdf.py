"""The URDF of each robot, read by MuJoCo, moves and weighs as the MJCF does."""

import shutil
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from posed import mass_matrix

from footfall.robots.description import Robot, available_robots, load_robot
from footfall.robots.urdf import urdf

POSES = 5


def awkward(folder: Path) -> Robot:
    """A Go1 with a hinge beside its body's origin and a body with two hinges, rotated at zero angles."""
    robot = load_robot("go1")
    shutil.copy(robot.xml_path, folder)
    thigh, calf = '"FR_thigh_joint" class="hip"', '<joint name="FL_calf_joint" class="knee"/>'
    toe = '<joint name="toe" axis="1 0 0" range="-1 1" pos="0 0.03 -0.1" ref="-0.2" class="knee"/>'
    edit(folder, robot.description.model, thigh, f'{thigh} pos="0.01 0.02 0.03" ref="0.4"')
    edit(folder, robot.description.model, calf, f'{calf.removesuffix("/>")} pos="0.02 0 0.01"/>{toe}')
    return replace(robot, folder=folder)


@pytest.fixture(params=[*available_robots(), "awkward"])
def robot(request: pytest.FixtureRequest, tmp_path: Path) -> Robot:
    return awkward(tmp_path) if request.param == "awkward" else load_robot(request.param)


def as_read(text: str) -> mujoco.MjModel:
    """A URDF read by MuJoCo, with all links kept and a free base."""
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    spec.body("base_link").add_freejoint()
    for body in spec.bodies:  # MuJoCo needs a mass between two joints
        if body.name.endswith("_joint"):
            body.mass, body.inertia, body.explicitinertial = 1e-9, [1e-9] * 3, True
    return spec.compile()


def without_armature(robot: Robot) -> mujoco.MjModel:
    """The MJCF, without features that a URDF cannot have."""
    model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
    model.dof_armature[:] = 0.0
    return model


def poses(model: mujoco.MjModel) -> list[dict[str, float]]:
    """Angles of all joints but the base, drawn within their ranges, rad."""
    generator = np.random.default_rng(0)
    names = [model.joint(joint).name for joint in range(1, model.njnt)]
    ranges = [model.joint(name).range for name in names]
    return [{n: generator.uniform(*r) for n, r in zip(names, ranges, strict=True)} for _ in range(POSES)]


def with_angles(model: mujoco.MjModel, pose: dict[str, float]) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:7] = (0.3, -0.2, 0.4, 0.7, 0.1, -0.5, 0.5)
    for name, angle in pose.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    return data


def test_links_have_the_motion_and_masses_of_the_bodies(robot: Robot) -> None:
    made, own = as_read(urdf(robot)), without_armature(robot)
    for pose in poses(own):
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


def test_solid_shapes_reach_as_low_as_those_of_the_mjcf(robot: Robot) -> None:
    """A level floor touches them at the same height."""
    pose = dict(zip(robot.joint_names, robot.default_pose.tolist(), strict=True))
    lowest = [
        lowest_solid(model, with_angles(model, pose))
        for model in (as_read(urdf(robot)), without_armature(robot))
    ]
    assert lowest[0] == pytest.approx(lowest[1], abs=1e-6)


def lowest_solid(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """Height of the lowest point that can touch, m, of boxes, spheres and capsules."""
    heights = []
    for geom in np.flatnonzero(model.geom_contype | model.geom_conaffinity):
        down = -data.geom_xmat[geom].reshape(3, 3)[2]
        size = model.geom_size[geom]
        match model.geom_type[geom]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                reach = size[0]
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                reach = size[0] + size[1] * abs(down[2])
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                reach = size[0] * np.hypot(*down[:2]) + size[1] * abs(down[2])
            case _:
                reach = size @ abs(down)
        heights.append(data.geom_xpos[geom][2] - reach)
    return min(heights)
