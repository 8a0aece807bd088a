"""Motion and contact of the feet from their simulated positions."""

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from footfall.envs.contract import make_contract
from footfall.envs.feet import Feet
from footfall.envs.ground import in_contact
from footfall.policies.action import gait_reference
from footfall.policies.gaits import find_gait
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
CONFIG = load_preset("smoke").env
MODEL = training_model(ROBOT, CONFIG.timestep_s)


class TestFeet:
    def test_a_standing_robot_touches_the_ground_with_all_feet(self) -> None:
        data = mujoco.MjData(MODEL)
        data.qpos[:7] = (0, 0, ROBOT.description.standing_height_m, 1, 0, 0, 0)
        data.qpos[7:] = ROBOT.default_pose
        mujoco.mj_forward(MODEL, data)
        feet = np.array([data.geom(foot.geoms[0]).xpos for foot in ROBOT.description.feet])
        radius = [MODEL.geom(foot.geoms[0]).size[0] for foot in ROBOT.description.feet]
        on_ground = feet - np.array([0, 0, 1]) * (feet[:, 2] - radius)[:, None]
        lifted = on_ground + np.array([[0, 0, 0.0], [0, 0, 0.001], [0, 0, 0.003], [0, 0, 0.05]])
        clearance = Feet(MODEL, ROBOT, CONFIG.timestep_s, None).clearance(jnp.asarray(lifted, jnp.float32))
        np.testing.assert_allclose(clearance, [0.0, 0.001, 0.003, 0.05], atol=1e-6)
        np.testing.assert_array_equal(in_contact(clearance), [1.0, 1.0, 0.0, 0.0])
        assert np.abs(feet[:, 2] - radius).max() < 0.005  # so standing_height_m is right

    def test_speed_is_horizontal_and_of_the_last_physics_step(self) -> None:
        feet = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None)
        positions = np.zeros((3, 4, 3))
        positions[0] = 7.0
        positions[2] = [[0.003, 0.004, 0.5], [0, 0, 0], [-0.01, 0, 0], [0, 0.02, 0]]
        np.testing.assert_allclose(feet.speed(jnp.asarray(positions)), [1.0, 0.0, 2.0, 4.0], rtol=1e-5)

    def test_feet_crowd_if_two_are_too_close(self) -> None:
        feet = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None)
        positions = jnp.array([[0.0, 0.0, 0.5], [0.03, 0.04, 0.0], [1.0, 0.0, 0.0], [1.0, 0.09, 0.0]])
        assert float(feet.crowding(positions, 0.1)) == pytest.approx(0.05**2 + 0.01**2, rel=1e-4)
        assert float(feet.crowding(positions, 0.05)) == pytest.approx(0.0, abs=1e-9)

    @pytest.mark.parametrize("phase", np.linspace(0.0, 0.95, 20))
    def test_swing_follows_the_reference_gait(self, phase: float) -> None:
        contract = make_contract(ROBOT, CONFIG)
        assert contract.gait is not None
        reference = gait_reference(np.array([phase]), np.array([0.5, 0.0, 0.0]), contract)
        amplitude = np.array(contract.gait.amplitude_rad)
        share = (reference.reshape(4, 3) @ np.ones(3)) / (amplitude.reshape(4, 3) @ np.ones(3))
        feet = Feet(MODEL, ROBOT, CONFIG.timestep_s, find_gait("trot", ROBOT))
        swing = feet.planned_swing(jnp.array([phase], dtype=jnp.float32), jnp.float32(1.0))
        np.testing.assert_allclose(swing, share, atol=1e-5)


def test_feet_of_two_sizes_have_each_its_own_clearance() -> None:
    model = training_model(ROBOT, 0.005)
    geoms = [model.geom(foot.geoms[0]).id for foot in ROBOT.description.feet]
    model.geom_size[geoms, 0] = [0.01, 0.02, 0.03, 0.04]
    feet = Feet(model, ROBOT, 0.005, None)
    np.testing.assert_allclose(feet.clearance(jnp.full((4, 3), 0.05)), [0.04, 0.03, 0.02, 0.01], rtol=1e-5)
    assert feet.count == 4
    assert not feet.planned_swing(jnp.array([0.2]), jnp.float32(1.0)).any()  # without a gait
