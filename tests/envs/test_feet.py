"""Motion and contact of the feet from their simulated positions."""

import jax.numpy as jnp
import mujoco
import numpy as np
from go1_smoke import MODEL, ROBOT, SMOKE

from footfall.envs.feet import Feet
from footfall.envs.ground import in_contact


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
        clearance = Feet(MODEL, ROBOT, SMOKE.timestep_s, None).clearance(jnp.asarray(lifted, jnp.float32))
        np.testing.assert_allclose(clearance, [0.0, 0.001, 0.003, 0.05], atol=1e-6)
        np.testing.assert_array_equal(in_contact(clearance), [1.0, 1.0, 0.0, 0.0])
        assert np.abs(feet[:, 2] - radius).max() < 0.005  # so standing_height_m is right

    def test_speed_is_horizontal_and_of_the_last_physics_step(self) -> None:
        feet = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None)
        positions = np.zeros((3, 4, 3))
        positions[0] = 7.0
        positions[2] = [[0.003, 0.004, 0.5], [0, 0, 0], [-0.01, 0, 0], [0, 0.02, 0]]
        np.testing.assert_allclose(feet.speed(jnp.asarray(positions)), [1.0, 0.0, 2.0, 4.0], rtol=1e-5)
