"""The joint law: the same for NumPy and JAX, within the motor's limits, with the motors' optional effects."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from one_motor import ONE_MOTOR, THREE_MOTORS

from footfall import JointCommand, Robot
from footfall.robots.actuator import (
    Motor,
    at_supply,
    friction_torque,
    joint_damping,
    joint_torque,
    lag_over,
    lagged,
    motor_torque,
)
from footfall.robots.targets import limit_target, soft_limits


def one(*numbers: float) -> JointCommand:
    """A command to one joint."""
    return JointCommand(*(np.array([x]) for x in numbers))


def at(angle: float, speed: float, command: JointCommand, motor: Motor) -> float:
    return float(motor_torque(command, np.array([angle]), np.array([speed]), motor)[0])


def test_numpy_and_jax_agree(go1: Robot) -> None:
    rng = np.random.default_rng(0)
    command = JointCommand(*(rng.normal(scale=s, size=(64, 12)) for s in (1, 5, 30, 2, 10)))
    position, velocity = rng.normal(size=(64, 12)), rng.normal(scale=20, size=(64, 12))
    single = jax.tree.map(np.float32, (command, position, velocity, go1.motor))
    in_numpy = joint_torque(*single)
    assert in_numpy.dtype == np.float32
    in_jax = jax.jit(joint_torque)(*jax.tree.map(jnp.asarray, single))
    np.testing.assert_allclose(in_numpy, in_jax, rtol=1e-5, atol=2e-5)


def by_hand(command: JointCommand, position: np.ndarray, velocity: np.ndarray, joint: int) -> list[float]:
    """Torque of the motor and at the joint, friction and the law's slope in speed of one joint."""
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
    ramp = abs(speed) < full_at
    friction = -coulomb * (speed / full_at if ramp else np.sign(speed)) - viscous * speed
    return [torque, torque + friction, friction, slope + viscous + (coulomb / full_at if ramp else 0.0)]


@pytest.mark.parametrize("speed_scale", [0.3, 5.0, 60.0])
def test_different_motors_follow_the_law_with_their_own_parameters(speed_scale: float) -> None:
    rows = np.random.default_rng(2).normal(size=(7, 200, 3))
    command = JointCommand(rows[0], 4 * rows[1], 20 + 8 * rows[2], 1 + 0.3 * rows[3], 9 * rows[4])
    moment = command, rows[5], speed_scale * rows[6]
    found = [
        motor_torque(*moment, THREE_MOTORS),
        joint_torque(*moment, THREE_MOTORS),
        friction_torque(moment[2], THREE_MOTORS),
        joint_damping(*moment, THREE_MOTORS),
    ]
    for k, row in enumerate(np.moveaxis(found, 0, 2)):
        single = JointCommand(*(part[k] for part in command)), moment[1][k], moment[2][k]
        np.testing.assert_allclose(row, [by_hand(*single, joint) for joint in range(3)], atol=1e-9)


def test_targets_by_hand() -> None:
    """Six targets are in reach, too high, too low, and outside the limits by a little and by much."""
    lower, upper = np.array([-1.0, -1, -1, -1, -1, 0.5]), np.array([2.0, 2, 2, 2, 2, 0.8])
    previous = np.array([0.3, 0.3, 0.3, -0.95, 1.97, 0.75])
    goal = np.array([0.35, 1.0, -0.4, -3.0, 2.4, 0.2])
    for library in (np, jnp):
        limits = (library.asarray(each) for each in (goal, previous, lower, upper))
        found = limit_target(*limits, 50.0, 0.002)
        np.testing.assert_allclose(found, [0.35, 0.4, 0.2, -1.0, 2.0, 0.65], rtol=1e-6)
    low, high = soft_limits(np.array([-1.0, 0.0]), np.array([3.0, 0.5]), 0.8)
    np.testing.assert_allclose([low, high], [[-0.6, 0.05], [2.6, 0.45]])


@pytest.mark.parametrize("step_s", [0.0005, 0.005, 0.02])
def test_a_lag_is_exact_for_steps_of_any_length(step_s: float) -> None:
    """The lag is f(t) = u + (f(0) - u) exp(-t / T), and the impulse of the steps is its integral."""
    lag_s, demand, first, end_s = 0.004, 7.0, -3.0, 0.02
    lag, torque, impulse = lag_over(np.array([lag_s]), step_s), np.array([first]), 0.0
    for _ in range(round(end_s / step_s)):
        mean, torque = lagged(np.array([demand]), torque, lag)
        impulse += float(mean[0]) * step_s
    left = np.exp(-end_s / lag_s)
    assert torque == pytest.approx(demand + (first - demand) * left, abs=1e-12)
    assert impulse == pytest.approx(demand * end_s + (first - demand) * lag_s * (1 - left), abs=1e-12)
    mean, end = lagged(np.array([7.0]), np.array([-3.0]), lag_over(np.array([0.0]), step_s))
    assert (mean, end) == pytest.approx((7.0, 7.0), abs=1e-4)  # a lag of zero has no effect


def test_stribeck_friction_falls_to_half_at_its_speed() -> None:
    motor = ONE_MOTOR._replace(stribeck=np.array([0.4]), stribeck_speed=np.array([2.0]))
    for speed, dry in ((2.0, 0.5 + 0.2), (6.0, 0.5 + 0.04), (0.1, (0.5 + 0.4 / (1 + 0.0025)) * 0.5)):
        assert friction_torque(np.array([-speed]), motor) == pytest.approx(dry + 0.05 * speed, rel=1e-12)
    motor = ONE_MOTOR._replace(stribeck=np.array([0.4]))  # the default speed is five times the ramp's
    assert friction_torque(np.array([1.0]), motor) == pytest.approx(-(0.5 + 0.2 + 0.05))


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_load_friction_is_a_share_of_the_motor_torque(sign: float) -> None:
    """The gearbox takes 10 % of 8 N m: 0.8 N m more against motion, whatever the torque's sign."""
    motors = ONE_MOTOR, ONE_MOTOR._replace(load_friction=np.array([0.1]))
    more = [joint_torque(one(0, 0, 0, 0, 8.0 * sign), np.zeros(1), np.ones(1), motor) for motor in motors]
    assert more[1] - more[0] == pytest.approx(-0.8)


def test_damping_of_a_lagged_torque_is_that_of_its_mean() -> None:
    """Damping is minus the derivative of the step's mean torque by the speed, beyond the ramp."""
    motor = ONE_MOTOR._replace(lag_s=np.array([0.004]))
    lag, command = lag_over(motor.lag_s, 0.005), one(0.1, 0.0, 30.0, 0.8, 0.0)

    def mean(speed: float) -> float:
        torque = lagged(at(0.0, speed, command, motor), np.array([2.0]), lag)[0]
        return float(torque[0] + friction_torque(np.array([speed]), motor)[0])

    slope = (mean(1.001) - mean(0.999)) / 0.002
    assert joint_damping(command, np.zeros(1), np.ones(1), motor, lag) == pytest.approx(-slope)


def test_backlash_and_compliance_are_in_equilibrium_with_the_control_loop() -> None:
    """The position of the rotor solves `kp (e - x) + ff = k dead_zone(x)`, by bisection."""
    stiffness, half, kp, feed = 400.0, 0.01, 60.0, 0.3
    motor = ONE_MOTOR._replace(backlash=np.array([2 * half]), compliance=np.array([1 / stiffness]))
    for error in (-0.1, -0.02, -0.012, 0.0, 0.004, 0.011, 0.2):
        low, high = -1.0, 1.0
        for _ in range(80):
            x = (low + high) / 2
            gear = stiffness * (x - np.clip(x, -half, half))
            low, high = (x, high) if kp * (error - x) + feed > gear else (low, x)
        assert at(-error, 0.0, one(0, 0, kp, 0, feed), motor) == pytest.approx(gear, abs=1e-9)
    # A stiffness of 100 behind 300 is 75 N m/rad, and damping acts through the square of that share.
    motor = ONE_MOTOR._replace(compliance=np.array([1 / 300.0]))
    assert at(0.1, 0.0, one(0, 0, 100, 4, 0), motor) == pytest.approx(-7.5)
    assert at(0.0, 1.0, one(0, 0, 100, 4, 0), motor) == pytest.approx(-4 * 0.75**2)


@pytest.mark.parametrize(("share", "rise"), [(1.0, 0.0), (0.7, 0.0), (0.7, 0.6)])
def test_a_voltage_driven_servo_is_mujocos_dcmotor(share: float, rise: float) -> None:
    """The duty follows from the position error. Torque and its slope in the speed equal MuJoCo's.

    With a resistance that rises with the duty, current and back-EMF are divided by the same factor.
    """
    volts, constant, ohms, duty_per_rad = 12.0, 1.5, 3.0, 8.0
    body = '<body><joint name="j" axis="0 1 0"/><geom size="0.1" mass="1"/></body>'
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    servo = spec.add_actuator(target="j", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_dcmotor(motorconst=[constant, constant], resistance=ohms)
    model = spec.compile()
    data = mujoco.MjData(model)
    stall = constant * volts / ohms
    nominal = Motor(*(np.array([x]) for x in (100.0, stall, volts / constant, 0.0, 1.0, 0.0, 1.0)))
    motor = at_supply(nominal._replace(voltage_gain=np.ones(1), duty_resistance=np.array([rise])), share)
    command, saturated = one(0.2, 0.0, duty_per_rad * stall, 0.0, 0.0), []
    for angle, speed in np.random.default_rng(0).uniform(-1, 1, (40, 2)) * (0.4, 6.0):
        duty = np.clip(duty_per_rad * (0.2 - angle), -1, 1)
        data.qpos[0], data.qvel[0], data.ctrl[0] = angle, speed, share * volts * duty
        mujoco.mj_forward(model, data)
        more = 1 + rise * abs(duty)
        assert at(angle, speed, command, motor) == pytest.approx(data.actuator_force[0] / more, abs=1e-9)
        slope = joint_damping(command, np.array([angle]), np.array([speed]), motor)
        assert slope == pytest.approx(constant**2 / (ohms * more))
        saturated.append(abs(duty) == 1)
    assert 0.2 < np.mean(saturated) < 0.9
