"""From joint goals to the inputs of the motors in a control step: delays, limits, each robot's motors."""

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.arrays import single
from footfall.domain_rand.randomisation import require_delays
from footfall.domain_rand.sample import (
    Sample,
    randomised_command,
    randomised_motor,
    randomised_winding,
    sensor_bias,
)
from footfall.domain_rand.transport import transport_of
from footfall.envs.config import EnvConfig
from footfall.envs.delays import delayed_goals
from footfall.envs.physics.interface import Drive
from footfall.robots.actuator import JointCommand, Motor, at_supply, lag_over
from footfall.robots.description import Robot
from footfall.robots.targets import limit_target
from footfall.robots.winding import Winding, at_temperature, warmed

KEPT_GOALS = 3  # control steps whose goals may still be on their way to the motors


class Actuation:
    """The path of a goal (the joint positions that an action commands) to the motors."""

    def __init__(self, robot: Robot, config: EnvConfig) -> None:
        """Raises UserError if goals may be delayed for longer than they are kept."""
        self._period_s, self._timestep_s = 1.0 / config.control_rate_hz, config.timestep_s
        self._starts_s = np.arange(config.substeps) * config.timestep_s
        require_delays(config.randomisation, "actions", (KEPT_GOALS - 1) * self._period_s)
        self._motor: Motor = jax.tree.map(single, robot.motor)
        self._winding: Winding | None = jax.tree.map(single, robot.winding)
        self._kp, self._kd = single(robot.kp), single(robot.kd)
        self._net = robot.actuator_net
        self._rate_rad_s = robot.description.target_rate_rad_s
        self.soft_lower, self.soft_upper = map(single, robot.soft_limits)

    @property
    def peak_torque(self) -> jax.Array:
        """Peak torque of the nominal motors, N m, (n,)."""
        return self._motor.peak_torque

    def targets(
        self, goals: jax.Array, target: jax.Array, sample: Sample, lateness_s: jax.Array | None = None
    ) -> jax.Array:
        """The target at each physics step, rad, shape (substeps, n): delayed, then rate-limited.

        Args:
            goals: goals of the last control steps, newest first, rad, shape (KEPT_GOALS, n).
            target: rate-limited target of the previous physics step, rad, shape (n,).
            sample: randomised quantities of the robot.
            lateness_s: delay of each goal to each motor, s, (KEPT_GOALS, n); None: the sample's delay.
        """

        def tick(target: jax.Array, goal: jax.Array) -> tuple[jax.Array, jax.Array]:
            rate, timestep_s = self._rate_rad_s, self._timestep_s
            target = limit_target(goal, target, self.soft_lower, self.soft_upper, rate, timestep_s)
            return target, target

        delay_s = transport_of(sample, "actions").delay_s if lateness_s is None else lateness_s
        arrived = delayed_goals(goals, delay_s, self._starts_s, self._timestep_s, self._period_s)
        return jax.lax.scan(tick, target, arrived, unroll=True)[1]

    def drive(
        self,
        targets: jax.Array,
        sample: Sample,
        supply: jax.Array | None = None,
        winding_c: jax.Array | None = None,
    ) -> Drive:
        """Inputs and parameters of a sampled robot's motors in a control step.

        Args:
            targets: position targets at each physics step, rad, (substeps, n).
            sample: randomised quantities of the robot.
            supply: supply voltage over nominal voltage, (); None: nominal.
            winding_c: temperatures, degrees Celsius, (n,); None for motors without a thermal model.
        """
        zeros = jnp.zeros_like(self._kp)
        command = randomised_command(JointCommand(targets, zeros, self._kp, self._kd, zeros), sample)
        bias = sensor_bias(sample, "joint_position")
        motor = randomised_motor(self._motor, sample)
        if supply is not None:
            motor = at_supply(motor, supply)
        if winding_c is not None:
            motor = at_temperature(motor, winding_c, randomised_winding(self._winding, sample))
        lag = None if motor.lag_s is None else lag_over(motor.lag_s, self._timestep_s)
        return Drive(targets, command.kp, command.kd, motor, zeros if bias is None else bias, lag)

    def initial_winding_c(self, sample: Sample) -> jax.Array | None:
        """Temperatures before an episode, degrees Celsius, (n,); None without a thermal model."""
        winding = randomised_winding(self._winding, sample)
        return None if winding is None else winding.start_c

    def next_winding_c(
        self, winding_c: jax.Array | None, torque: jax.Array, sample: Sample
    ) -> jax.Array | None:
        """Temperatures after a control step, degrees Celsius, (n,); None without a thermal model.

        Args:
            winding_c: temperatures before the step.
            torque: torque of the motors in each physics step, N m, (substeps, n).
            sample: randomised quantities of the robot.
        """
        winding, mean_sq = randomised_winding(self._winding, sample), jnp.mean(torque**2, axis=0)
        return warmed(winding_c, mean_sq, winding, self._period_s)

    @property
    def initial_memory(self) -> jax.Array | None:
        """Memory of the actuator net before an episode, (n, m, inputs); None for a robot without one."""
        return None if self._net is None else jnp.asarray(single(self._net.rest()))

    def initial_torque(self, sample: Sample) -> jax.Array | None:
        """Torque of motors with lag before an episode, N m, (n,); None for motors without lag."""
        has_lag = randomised_motor(self._motor, sample).lag_s is not None
        return jnp.zeros_like(self._kp) if has_lag else None
