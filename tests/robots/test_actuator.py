"""The joint law: the same for NumPy and JAX, within the motor's limits, friction against motion."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from one_motor import ONE_MOTOR, THREE_MOTORS

from footfall.robots.actuator import (
    JointCommand,
    friction_torque,
    joint_damping,
    joint_torque,
    motor_torque,
)
from footfall.robots.description import Robot
from footfall.robots.targets import limit_target, soft_limits

MOTOR = ONE_MOTOR._replace(strength=np.array([0.9]))


def arrays(low: float, high: float) -> st.SearchStrategy:
    return hnp.arrays(np.float64, 1, elements=st.floats(low, high))


commands = st.builds(
    JointCommand, arrays(-10, 10), arrays(-50, 50), arrays(0, 500), arrays(0, 20), arrays(-100, 100)
)


def test_numpy_and_jax_agree(go1: Robot) -> None:
    rng = np.random.default_rng(0)
    command = JointCommand(*(rng.normal(scale=s, size=(64, 12)) for s in (1, 5, 30, 2, 10)))
    position, velocity = rng.normal(size=(64, 12)), rng.normal(scale=20, size=(64, 12))
    single = jax.tree.map(np.float32, (command, position, velocity, go1.motor))
    in_numpy = joint_torque(*single)
    in_jax = jax.jit(joint_torque)(*jax.tree.map(jnp.asarray, single))
    assert in_numpy.dtype == np.float32
    np.testing.assert_allclose(in_numpy, in_jax, rtol=1e-5, atol=2e-5)


@given(commands, arrays(-10, 10), arrays(-100, 100))
def test_friction_acts_against_motion(
    command: JointCommand, position: np.ndarray, velocity: np.ndarray
) -> None:
    expected = motor_torque(command, position, velocity, MOTOR) + friction_torque(velocity, MOTOR)
    np.testing.assert_array_equal(joint_torque(command, position, velocity, MOTOR), expected)


@given(commands, arrays(-2, 2), arrays(-40, 40))
def test_damping_is_the_slope_of_the_torque(
    command: JointCommand, position: np.ndarray, velocity: np.ndarray
) -> None:
    """The test is where the torque is differentiable.

    The slope is equal at slightly lower and higher speeds.
    """
    d = 1e-6
    at = [joint_torque(command, position, velocity + k * d, MOTOR)[0] for k in (-1, 0, 1)]
    slower, faster = at[0] - at[1], at[1] - at[2]
    assume(abs(slower - faster) < 1e-3 * d)
    damping = joint_damping(command, position, velocity, MOTOR)
    assert damping[0] == pytest.approx(slower / d, abs=1e-3)


def by_hand(command: JointCommand, position: np.ndarray, velocity: np.ndarray, joint: int) -> list[float]:
    """Motor torque, friction and the law's slope in speed of one joint, case by case."""
    peak, stall, no_load, coulomb, full_at, viscous, strength = (float(x[joint]) for x in THREE_MOTORS[:7])
    target, speed_target, kp, kd, extra = (float(x[joint]) for x in command)
    angle, speed = float(position[joint]), float(velocity[joint])
    torque = strength * (kp * (target - angle) + kd * (speed_target - speed) + extra)
    slope = strength * kd
    line = stall * (1 - speed / no_load), -stall * (1 + speed / no_load)
    if torque > line[0]:
        torque, slope = line[0], stall / no_load
    elif torque < line[1]:
        torque, slope = line[1], stall / no_load
    if abs(torque) > peak:
        torque, slope = (peak if torque > 0 else -peak), 0.0
    if abs(speed) < full_at:
        return [torque, -coulomb * speed / full_at - viscous * speed, slope + coulomb / full_at + viscous]
    return [torque, -coulomb * (1 if speed > 0 else -1) - viscous * speed, slope + viscous]


def test_different_motors_follow_the_law_with_their_own_parameters() -> None:
    rng = np.random.default_rng(2)
    for speed_scale in (0.3, 5.0, 60.0):
        rows = rng.normal(size=(7, 200, 3))
        command = JointCommand(rows[0], 4 * rows[1], 20 + 8 * rows[2], 1 + 0.3 * rows[3], 9 * rows[4])
        position, velocity = rows[5], speed_scale * rows[6]
        in_numpy = [
            motor_torque(command, position, velocity, THREE_MOTORS),
            friction_torque(velocity, THREE_MOTORS),
            joint_damping(command, position, velocity, THREE_MOTORS),
        ]
        for k in range(200):
            moment = JointCommand(*(part[k] for part in command))
            expected = [by_hand(moment, position[k], velocity[k], joint) for joint in range(3)]
            np.testing.assert_allclose([part[k] for part in in_numpy], np.transpose(expected), atol=1e-9)


def test_targets_by_hand() -> None:
    """Six targets are in reach, too high, too low, and outside the limits by a little and by much."""
    lower, upper = np.array([-1.0, -1, -1, -1, -1, 0.5]), np.array([2.0, 2, 2, 2, 2, 0.8])
    previous = np.array([0.3, 0.3, 0.3, -0.95, 1.97, 0.75])
    goal = np.array([0.35, 1.0, -0.4, -3.0, 2.4, 0.2])
    np.testing.assert_allclose(
        limit_target(goal, previous, lower, upper, 50.0, 0.002), [0.35, 0.4, 0.2, -1.0, 2.0, 0.65]
    )
    low, high = soft_limits(np.array([-1.0, 0.0]), np.array([3.0, 0.5]), 0.8)
    np.testing.assert_allclose([low, high], [[-0.6, 0.05], [2.6, 0.45]])


@given(arrays(-10, 10), arrays(-1, 1))
def test_targets_stay_inside_the_limits_and_the_rate(goal: np.ndarray, previous: np.ndarray) -> None:
    lower, upper = np.array([-1.0]), np.array([1.0])
    target = limit_target(goal, previous, lower, upper, 60.0, 0.002)
    assert lower <= target <= upper
    assert abs(target - previous) <= 0.12 + 1e-12
    moved = limit_target(jnp.asarray(goal), jnp.asarray(previous), lower, upper, 60.0, 0.002)
    np.testing.assert_allclose(moved, target, atol=1e-6)
