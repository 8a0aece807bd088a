"""A biped estimates its centre of mass while it stands."""

import numpy as np

from footfall.plant.episode import Episode, run_episode
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.step.centre_offset import CentreOffset, centre_of_pressure
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.controllers.whole_body.control import WholeBodyControl
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import rest_dynamics
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

G1 = load_robot("g1")
SETTINGS = controller_settings(G1, "step", StepConfig)
BODY = WholeBodyControl(G1, SETTINGS.whole_body, 0.002).body


def at_rest(pressed_at: np.ndarray) -> tuple[Dynamics, np.ndarray]:
    """Dynamics of a robot at rest, and torques for a centre of pressure (2,)."""
    dynamics = rest_dynamics(BODY, G1)
    force = 0.5 * BODY.weight_n
    (ahead, left), middle = pressed_at, dynamics.middle
    turning = [force * (left - middle[1]), -force * (ahead - middle[0]), 0.0]  # of each foot about its middle
    wrenches = np.tile([0.0, 0.0, force, *turning], 2)
    to_joints = dynamics.foot_jacobian[:, :, 6:].reshape(12, -1).T
    return dynamics, dynamics.bias[6:] - to_joints @ wrenches


def test_an_accelerating_body_is_not_at_rest_above_its_feet() -> None:
    """The feet push the body forward, so the pressure is behind the centre."""
    dynamics, torque = at_rest(rest_dynamics(BODY, G1).centre[:2] - np.array([0.02, 0.0]))
    found, rate = CentreOffset(BODY.weight_n, 3.9, 500.0), 3.9**2 * 0.02 / 500.0
    for tick in range(500):
        speed = dynamics.centre_velocity + np.array([rate * tick, 0.0, 0.0])
        found.observe(dynamics._replace(centre_velocity=speed), torque)
    np.testing.assert_allclose(found.value, 0.0, atol=1e-4)


def test_unknown_torques_give_no_centre_of_pressure() -> None:
    dynamics, torque = at_rest(np.zeros(2))
    assert centre_of_pressure(dynamics, np.full_like(torque, np.nan)) is None


def test_a_robot_with_a_load_on_one_side_walks() -> None:
    load = {"com_offset_m": np.array([0.05, 0.05, 0.0])}
    delays = {"action_delay_s": np.array(0.012), "observation_delay_s": np.array(0.006)}
    walk = Episode(command_source=lambda _: np.array([0.3, 0.0, 0.0]), duration_s=3.6, sample=load | delays)
    assert not run_episode(G1, load_policy("step", G1), walk).fell
