"""The g1 stands on the corners of its soles, and its legs have one contact."""

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from posed import posed

from footfall import JointCommand, Robot, load_robot
from footfall.envs.feet import Feet
from footfall.robots.actuator import joint_torque
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses, plant_model, training_model


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1")


def test_the_g1_stands_on_four_corners_a_sole_under_the_joint_law(g1: Robot) -> None:
    """The gains are those for standing up; the robot stands for three seconds."""
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


def test_a_tilted_sole_touches_with_its_lowest_corner(g1: Robot) -> None:
    feet = Feet(training_model(g1), g1, timestep_s=0.005, gait=None)
    points = np.zeros((8, 3))
    points[:, 2] = 0.005 + np.array([0.02, 0.001, 0.03, 0.04, 0.05, 0.07, 0.06, 0.09])
    np.testing.assert_allclose(feet.clearance(jnp.asarray(points)), [0.001, 0.05], atol=1e-6)
    np.testing.assert_allclose(feet.tilt(jnp.asarray(points)), [0.039, 0.04], atol=1e-6)
    before = points.copy()
    before[1, :2] += (0.003, -0.004)  # one corner slides 5 mm
    before[6, 2] += 0.5  # one only rises
    np.testing.assert_allclose(feet.speed(jnp.asarray([before, before, points])), [1.0, 0.0], atol=1e-4)
