"""The go1 model against the published figures.

Every number here is from Unitree's `go1_description` (BSD-3-Clause), apart from the reflected inertia,
which follows from its rotor inertia and gear ratios, and the joint friction, from published transfer work.
"""

import mujoco
import numpy as np
import pytest

from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, plant_model

TRUNK = (5.204, (0.0223, 0.002, -0.0005), (0.0168101, 0.0630105, 0.0716565))
HIP = (0.68, (-0.004917, 0.007626, -0.000089), (0.000398719, 0.000468438, 0.000734064))
THIGH = (1.009, (-0.003047, 0.019315, -0.0305), (0.000709268, 0.00460903, 0.00478717))
CALF = (0.195862, (0.004299, 0.000977, -0.146197), (3.5843e-05, 0.00148468, 0.00149767))

LEGS = {"FR": (1, -1), "FL": (1, 1), "RR": (-1, -1), "RL": (-1, 1)}  # sign of x and of y
HIP_OFFSET, THIGH_OFFSET, CALF_OFFSET = (0.1881, 0.04675, 0.0), (0.0, 0.08, 0.0), (0.0, 0.0, -0.213)

# range rad, reflected inertia kg m2, friction N m, peak torque N m, no-load speed rad/s
JOINTS = {
    "hip": ((1, 0, 0), (-0.863, 0.863), 1.11842e-4 * 6**2, 0.3, 23.7, 30.1),
    "thigh": ((0, 1, 0), (-0.686, 4.501), 1.11842e-4 * 6**2, 0.3, 23.7, 30.1),
    "calf": ((0, 1, 0), (-2.818, -0.888), 1.11842e-4 * 9**2, 1.0, 35.55, 20.06),
}


@pytest.fixture(scope="module")
def model(go1: Robot) -> mujoco.MjModel:
    return plant_model(go1)


def posed(model: mujoco.MjModel, robot: Robot, pose: np.ndarray) -> mujoco.MjData:
    """The robot with these joint positions, trunk level, its origin at the world's."""
    data = mujoco.MjData(model)
    data.qpos[:7] = (0, 0, 0, 1, 0, 0, 0)
    data.qpos[joint_addresses(model, robot)[0]] = pose
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="module")
def standing(go1: Robot, model: mujoco.MjModel) -> mujoco.MjData:
    """The default pose."""
    return posed(model, go1, go1.default_pose)


def composite_inertia(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Inertia of the whole robot about its centre of mass, world axes, kg m^2: the angular momentum that
    MuJoCo finds when the robot turns as one, at 1 rad/s about each axis."""
    columns = []
    for axis in range(3):
        data.qvel[:] = 0.0
        data.qvel[3 + axis] = 1.0
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        columns.append(data.subtree_angmom[1].copy())
    return np.array(columns).T


def test_centre_of_mass_lies_21_mm_below_the_trunk_origin(standing: mujoco.MjData) -> None:
    assert standing.subtree_com[1][2] == pytest.approx(-0.021, abs=0.001)
    assert abs(standing.subtree_com[1][0]) < 0.01
    assert abs(standing.subtree_com[1][1]) < 0.002


def test_composite_inertia(go1: Robot, model: mujoco.MjModel) -> None:
    """In the published standing pose, whose legs are a little straighter than in our default pose."""
    upright = posed(model, go1, np.tile((0.0, 0.8, -1.6), 4))
    inertia = composite_inertia(model, upright)
    assert np.diag(inertia) == pytest.approx([0.138, 0.402, 0.420], abs=0.001)
    assert np.abs(inertia - np.diag(np.diag(inertia))).max() < 0.02
    assert upright.subtree_com[1][2] == pytest.approx(-0.021, abs=0.001)


def test_trunk(model: mujoco.MjModel) -> None:
    mass, com, principal = TRUNK
    trunk = model.body("trunk")
    assert trunk.mass[0] == pytest.approx(mass)
    assert trunk.ipos == pytest.approx(com)
    assert sorted(trunk.inertia) == pytest.approx(principal, rel=1e-4)
    assert model.site("imu").pos == pytest.approx((-0.01592, -0.06659, -0.00617))


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize(
    ("link", "figures", "offset", "mirrored"),
    [
        ("hip", HIP, HIP_OFFSET, (True, True)),
        ("thigh", THIGH, THIGH_OFFSET, (False, True)),
        ("calf", CALF, CALF_OFFSET, (False, False)),
    ],
)
def test_link(
    model: mujoco.MjModel,
    leg: str,
    link: str,
    figures: tuple,
    offset: tuple[float, float, float],
    mirrored: tuple[bool, bool],
) -> None:
    fore, left = LEGS[leg]
    mass, (x, y, z), principal = figures
    body = model.body(f"{leg}_{link}")
    assert body.mass[0] == pytest.approx(mass)
    assert sorted(body.inertia) == pytest.approx(principal, rel=1e-4)
    # The figures above are the front right leg's: the hip is mirrored fore and aft, all but the calf in y.
    sign = (fore if mirrored[0] else 1, -left if mirrored[1] else 1)
    assert body.ipos == pytest.approx((x * sign[0], y * sign[1], z))
    assert body.pos == pytest.approx((offset[0] * fore, offset[1] * left, offset[2]))


@pytest.mark.parametrize("leg", LEGS)
@pytest.mark.parametrize("kind", JOINTS)
def test_joint(model: mujoco.MjModel, go1: Robot, leg: str, kind: str) -> None:
    axis, limits, armature, friction, torque, speed = JOINTS[kind]
    name = f"{leg}_{kind}_joint"
    joint, i = model.joint(name), go1.joint_index(name)
    assert tuple(joint.axis) == axis
    assert tuple(joint.range) == limits
    assert (go1.lower_rad[i], go1.upper_rad[i]) == limits
    assert joint.armature[0] == pytest.approx(armature, rel=1e-3)
    assert go1.armature[i] == joint.armature[0]
    assert go1.motor.friction[i] == friction
    assert go1.motor.peak_torque[i] == torque
    assert go1.motor.no_load_speed[i] == speed


def test_the_thighs_inertia_is_oriented_as_published(model: mujoco.MjModel, standing: mujoco.MjData) -> None:
    quaternion = np.array([0.65243, -0.027231, 0.077513, 0.753383])
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, quaternion / np.linalg.norm(quaternion))
    published = axes.reshape(3, 3) @ np.diag([0.00478717, 0.00460903, 0.000709268]) @ axes.reshape(3, 3).T
    body = model.body("FR_thigh")
    mujoco.mju_quat2Mat(axes, body.iquat)
    ours = axes.reshape(3, 3) @ np.diag(body.inertia) @ axes.reshape(3, 3).T
    np.testing.assert_allclose(ours, published, atol=1e-8)
