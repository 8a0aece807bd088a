"""Feet's geoms, also in another maker's model, their spheres, and soles that stand on their corners."""

from collections.abc import Callable
from itertools import product

import jax.numpy as jnp
import mujoco
import numpy as np
from made_up import SOLES
from posed import posed
from scipy.spatial.transform import Rotation

from footfall import JointCommand, Robot, load_robot
from footfall.envs.feet import Feet
from footfall.robots.actuator import joint_torque
from footfall.robots.feet import find_feet, foot_geoms, foot_spheres
from footfall.robots.mjcf import load_spec
from footfall.robots.model import joint_addresses, plant_model, training_model

SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
REAR_RIGHT = 2  # among go1's feet


def without_a_name(
    robot: Robot, change: Callable[[mujoco.MjsGeom], None]
) -> tuple[mujoco.MjModel, tuple[np.ndarray, ...]]:
    """The robot's model without the rear right foot's name, as other makers may write it, and its feet."""
    spec = load_spec(robot.xml_path)
    foot = spec.geom(robot.description.feet[REAR_RIGHT].geoms[0])
    foot.name = ""
    change(foot)
    model = spec.compile()
    return model, find_feet(model, robot.description, robot.xml_path)


def test_a_foot_on_a_link_that_is_fixed_to_the_shin_is_found_by_its_position(go1: Robot) -> None:
    def move_to_toe(foot: mujoco.MjsGeom) -> None:
        toe = foot.parent.add_body(name="toe", pos=foot.pos)
        toe.add_geom(type=SPHERE, size=foot.size, contype=1)
        foot.pos[:] = 0.0  # at the shin's upper end: no foot

    model, feet = without_a_name(go1, move_to_toe)
    assert [model.body(model.geom_bodyid[geom]).name for geom in feet[REAR_RIGHT]] == ["toe"]


def test_a_foot_without_a_name_is_found_among_the_others(go1: Robot) -> None:
    model, feet = without_a_name(go1, lambda foot: None)
    names = [model.geom(int(geoms[0])).name for geoms in feet]
    assert [bool(name) for name in names] == [True, True, False, True]
    assert model.geom_type[feet[REAR_RIGHT]] == SPHERE


def test_a_geom_without_collisions_is_no_foot(go1: Robot) -> None:
    """A visual cap is at the expected position of the foot; the foot itself is 1 cm away."""

    def cap(foot: mujoco.MjsGeom) -> None:
        foot.parent.add_geom(type=SPHERE, size=[0.03, 0, 0], pos=foot.pos, contype=0, conaffinity=0)
        foot.pos[0] += 0.01

    model, feet = without_a_name(go1, cap)
    (found,) = feet[REAR_RIGHT].tolist()
    assert model.geom_contype[found] or model.geom_conaffinity[found]


def test_one_box_may_serve_for_four_corners_and_counts_once(bodies: dict[str, Robot]) -> None:
    robot = bodies[SOLES]
    corners = robot.description.feet[0].geoms
    assert len(corners) == 4
    spec = load_spec(robot.xml_path)
    spheres = [spec.geom(name) for name in corners]
    centres = np.array([sphere.pos for sphere in spheres])
    middle, half = centres.mean(axis=0), np.ptp(centres, axis=0) / 2 + spheres[0].size[0]
    link = spheres[0].parent
    for sphere in spheres:
        spec.delete(sphere)
    link.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=middle)
    link.add_geom(type=SPHERE, size=[0.03, 0, 0])  # the ankle's housing, farther from each corner
    model = spec.compile()
    (sole,) = find_feet(model, robot.description, robot.xml_path)[0].tolist()
    assert model.geom_type[sole] == mujoco.mjtGeom.mjGEOM_BOX


def test_the_g1_stands_on_four_corners_a_sole_under_the_joint_law() -> None:
    """The gains are those for standing up; the robot stands for three seconds."""
    g1 = load_robot("g1")
    model = plant_model(g1)
    data = posed(model, g1, g1.description.standing_height_m)
    positions, dofs = joint_addresses(model, g1)
    zero = np.zeros(12)
    command = JointCommand(g1.default_pose, zero, np.minimum(4 * g1.kp, 500), np.minimum(2 * g1.kd, 5), zero)
    for _ in range(3000):
        data.qfrc_applied[dofs] = joint_torque(command, data.qpos[positions], data.qvel[dofs], g1.motor)
        mujoco.mj_step(model, data)
    corners = np.concatenate(foot_geoms(model, g1.description))
    touching = {geom for pair in data.contact.geom for geom in pair.tolist()}
    assert set(corners.tolist()) <= touching
    assert len(touching) == 9  # and nothing else but the floor
    assert abs(data.qpos[2] - g1.description.standing_height_m) < 0.01
    assert data.body("pelvis").xmat[8] > 0.998  # within 3.6 degrees


def test_a_tilted_sole_touches_with_its_lowest_corner() -> None:
    g1 = load_robot("g1")
    feet = Feet(training_model(g1), g1, timestep_s=0.005, gait=None)
    points = np.zeros((8, 3))
    points[:, 2] = 0.005 + np.array([0.02, 0.001, 0.03, 0.04, 0.05, 0.07, 0.06, 0.09])
    np.testing.assert_allclose(feet.clearance(jnp.asarray(points)), [0.001, 0.05], atol=1e-6)
    np.testing.assert_allclose(feet.tilt(jnp.asarray(points)), [0.039, 0.04], atol=1e-6)
    before = points.copy()
    before[1, :2] += (0.003, -0.004)  # one corner slides 5 mm
    before[6, 2] += 0.5  # one only rises
    np.testing.assert_allclose(feet.speed(jnp.asarray([before, before, points])), [1.0, 0.0], atol=1e-4)


def test_spheres_of_spheres_capsules_and_boxes() -> None:
    """Spheres are at both ends of a tilted capsule and at the corners of a turned box, by scipy."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><freejoint/>
        <geom type="sphere" size="0.02" pos="0.1 0 0" mass="1"/>
        <geom type="capsule" size="0.01" fromto="-0.01 -0.05 0.18 0.03 0.05 0.22"/>
        <geom type="box" size="0.03 0.02 0.01" euler="20 0 50"/>
        </body></worldbody></mujoco>"""
    )
    tip = np.array([0.1, 0.0, 0.0])
    sphere, ends, corners = (foot_spheres(model, np.array([geom]), tip) for geom in range(3))
    np.testing.assert_allclose(sphere.centre, [[0.0, 0.0, 0.0]])
    assert sphere.radius.tolist() == [0.02]
    np.testing.assert_allclose(sorted(ends.centre.tolist()), [[-0.11, -0.05, 0.18], [-0.07, 0.05, 0.22]])
    assert ends.radius.tolist() == [0.01, 0.01]
    turn = Rotation.from_euler("XYZ", [20, 0, 50], degrees=True)
    edges = turn.apply(list(product((-0.03, 0.03), (-0.02, 0.02), (-0.01, 0.01)))) - tip
    np.testing.assert_allclose(sorted(corners.centre.tolist()), sorted(edges.tolist()), atol=1e-12)
    assert not corners.radius.any()
    assert foot_spheres(model, np.arange(3), tip).radius.tolist() == [0.02, 0.01, 0.01, *[0.0] * 8]


def test_spheres_of_a_mesh_are_corners_of_its_box() -> None:
    """The box has the axes of the mesh's inertia and is the smallest that holds all vertices."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><asset><mesh name="wedge" vertex="0.1 0 0  0.4 0 0  0.1 0.2 0  0.1 0 0.3"/></asset>
        <worldbody><body><freejoint/><geom type="mesh" mesh="wedge" pos="1 2 3" euler="20 0 50"/>
        </body></worldbody></mujoco>"""
    )
    turn = Rotation.from_quat(model.geom_quat[0], scalar_first=True)
    corners = foot_spheres(model, np.array([0]), np.zeros(3)).centre - model.geom_pos[0]
    across = turn.inv().apply(corners)
    np.testing.assert_allclose(across.min(axis=0), model.mesh_vert.min(axis=0), atol=1e-7)
    np.testing.assert_allclose(across.max(axis=0), model.mesh_vert.max(axis=0), atol=1e-7)
