"""From joint goals to the targets of the motors: delays, limits, each robot's motors."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import ROBOT, SMOKE, N

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.actuation import Actuation
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.interface import Drive, joint_effort
from footfall.robots.actuator import JointCommand, joint_torque, motor_torque

SUBSTEPS = 4
CONFIG = replace(SMOKE, control_rate_hz=40.0, substeps=SUBSTEPS)


class TestActuation:
    @pytest.mark.parametrize(
        ("steps", "new"), [(0.0, [1, 1, 1, 1]), (1.0, [0, 1, 1, 1]), (2.25, [0, 0, 0.75, 1])]
    )
    def test_a_goal_reaches_the_motors_when_its_delay_is_over(self, steps: float, new: list[float]) -> None:
        """Times are in physics steps; a goal acts for the rest of the step in which it arrives."""
        default = jnp.asarray(ROBOT.default_pose, jnp.float32)
        goals = jnp.stack([default + 1e-3, default, default])  # near enough that the rate limit has no effect
        delay_s = jnp.float32(steps * CONFIG.timestep_s)
        targets = np.asarray(Actuation(ROBOT, CONFIG).targets(goals, default, {"action_delay_s": delay_s}))
        expected = ROBOT.default_pose + 1e-3 * np.array(new)[:, None]
        np.testing.assert_allclose(targets, expected, atol=2e-6)

    def test_each_joint_has_its_own_limits_rate_and_gains(self) -> None:
        actuation = Actuation(ROBOT, CONFIG)
        lower, upper = ROBOT.soft_limits
        default = jnp.asarray(ROBOT.default_pose, jnp.float32)
        away = np.where(np.arange(N) % 2, 50.0, -50.0)
        goals = jnp.asarray(np.stack([ROBOT.default_pose + away] * 3), jnp.float32)
        targets = np.asarray(actuation.targets(goals, default, {}))
        rate = ROBOT.description.target_rate_rad_s * CONFIG.timestep_s
        for k in range(SUBSTEPS):
            expected = np.clip(ROBOT.default_pose + np.sign(away) * rate * (k + 1), lower, upper)
            np.testing.assert_allclose(targets[k], expected, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(actuation.peak_torque, ROBOT.motor.peak_torque, rtol=1e-6)

    def test_a_sampled_robots_motors_differ_by_joint(self) -> None:
        rng = np.random.default_rng(5)
        names = ("kp", "kd", "motor_strength", "joint_friction", "joint_damping", "encoder_bias")
        sample = {name: jnp.asarray(rng.uniform(0.5, 1.5, N), jnp.float32) for name in names}
        targets = jnp.asarray(rng.normal(size=(SUBSTEPS, N)), jnp.float32)
        drive = Actuation(ROBOT, CONFIG).drive(targets, sample)
        np.testing.assert_array_equal(drive.target, targets)
        np.testing.assert_allclose(drive.kp, ROBOT.kp * np.asarray(sample["kp"]), rtol=1e-5)
        np.testing.assert_allclose(drive.kd, ROBOT.kd * np.asarray(sample["kd"]), rtol=1e-5)
        np.testing.assert_array_equal(drive.encoder_bias, sample["encoder_bias"])
        np.testing.assert_allclose(drive.motor.strength, sample["motor_strength"], rtol=1e-5)
        np.testing.assert_allclose(
            drive.motor.damping, ROBOT.motor.damping + np.asarray(sample["joint_damping"]), rtol=1e-5
        )

    @pytest.mark.parametrize(
        ("name", "limit"),
        [
            ("action_delay_s", "0.05"),
            ("action_swing_s", "0.05"),
            ("observation_delay_s", "0.025"),
            ("observation_jitter_s", "0.025"),
        ],
    )
    def test_delays_must_fit_the_buffers(self, name: str, limit: str) -> None:
        """The buffers keep three goals and the readings of two control steps of 25 ms."""
        within, beyond = (
            replace(CONFIG, randomisation=Randomisation(**{name: Distribution(0.0, float(limit) + more)}))
            for more in (0.0, 0.001)
        )
        LocomotionEnv(ROBOT, within)
        with pytest.raises(UserError, match=f"{name}: .*{limit}"):
            LocomotionEnv(ROBOT, beyond)


def test_the_joint_law_of_a_physics_step_reads_the_motors_own_encoders() -> None:
    """The added inertia is half a step times the torque's slope in the velocity, here by differences."""
    rng = np.random.default_rng(6)
    motor = jax.tree.map(lambda part: part * rng.uniform(0.5, 1.5, N), ROBOT.motor)
    motor = motor._replace(damping=rng.uniform(0.1, 0.2, N))
    bias, target, position = 0.05 * rng.normal(size=(3, N))
    velocity = rng.uniform(0.5, 2.0, N)
    drive = Drive(np.zeros((1, N)), 20 * rng.uniform(0.5, 1.5, N), rng.uniform(0.5, 1.5, N), motor, bias)
    effort = joint_effort(drive, target, position, velocity, 0.004)
    command = JointCommand(target, 0.0, drive.kp, drive.kd, 0.0)
    np.testing.assert_allclose(effort.motor_torque, motor_torque(command, position + bias, velocity, motor))
    np.testing.assert_allclose(effort.torque, joint_torque(command, position + bias, velocity, motor))
    slope = (
        joint_torque(command, position + bias, velocity + 1e-6, motor)
        - joint_torque(command, position + bias, velocity - 1e-6, motor)
    ) / 2e-6
    np.testing.assert_allclose(effort.inertia, -0.5 * 0.004 * slope, rtol=1e-5)
