"""Optional effects of motors: what each changes in the joint law, against the closed form."""

import numpy as np
import pytest

from footfall.robots.actuator import (
    JointCommand,
    Motor,
    friction_torque,
    joint_damping,
    joint_torque,
    lag_over,
    lagged,
    motor_torque,
)

MOTOR = Motor(
    peak_torque=np.array([20.0]),
    stall_torque=np.array([30.0]),
    no_load_speed=np.array([30.0]),
    friction=np.array([0.5]),
    friction_speed=np.array([0.2]),
    damping=np.array([0.05]),
    strength=np.array([1.0]),
)


@pytest.mark.parametrize("step_s", [0.0005, 0.005, 0.02])
def test_a_lag_is_exact_for_steps_of_any_length(step_s: float) -> None:
    """f(t) = u + (f(0) - u) exp(-t / T), and the impulse of the steps is its integral."""
    lag_s, demand, first, end_s = 0.004, 7.0, -3.0, 0.02
    lag, torque, impulse = lag_over(np.array([lag_s]), step_s), np.array([first]), 0.0
    for _ in range(round(end_s / step_s)):
        mean, torque = lagged(np.array([demand]), torque, lag)
        impulse += float(mean[0]) * step_s
    left = np.exp(-end_s / lag_s)
    assert torque == pytest.approx(demand + (first - demand) * left, abs=1e-12)
    assert impulse == pytest.approx(demand * end_s + (first - demand) * lag_s * (1 - left), abs=1e-12)


def test_a_lag_of_zero_is_none() -> None:
    mean, end = lagged(np.array([7.0]), np.array([-3.0]), lag_over(np.array([0.0]), 0.005))
    assert mean == pytest.approx(7.0, abs=1e-4)
    assert end == pytest.approx(7.0, abs=1e-12)


def test_a_lag_attenuates_a_sine_as_its_bandwidth_says() -> None:
    """At the bandwidth the amplitude is 1 / sqrt(2)."""
    bandwidth_hz, step_s = 40.0, 1e-5
    lag, torque = lag_over(np.array([1 / (2 * np.pi * bandwidth_hz)]), step_s), np.zeros(1)
    time_s = np.arange(round(0.1 / step_s)) * step_s
    out = np.empty(len(time_s))
    for k, demand in enumerate(np.sin(2 * np.pi * bandwidth_hz * time_s)):
        _, torque = lagged(np.array([demand]), torque, lag)
        out[k] = torque[0]
    assert np.abs(out[len(out) // 2 :]).max() == pytest.approx(1 / np.sqrt(2), rel=1e-3)


def test_stribeck_friction_falls_to_half_at_its_speed() -> None:
    motor = MOTOR._replace(stribeck=np.array([0.4]), stribeck_speed=np.array([2.0]))
    for speed, dry in ((2.0, 0.5 + 0.2), (6.0, 0.5 + 0.04), (0.1, (0.5 + 0.4 / (1 + 0.0025)) * 0.5)):
        loss = friction_torque(np.array([-speed]), motor)
        assert loss == pytest.approx(dry + 0.05 * speed, rel=1e-12)


def test_a_stribeck_speed_that_is_not_given_is_five_ramps() -> None:
    motor = MOTOR._replace(stribeck=np.array([0.4]))
    assert friction_torque(np.array([1.0]), motor) == pytest.approx(-(0.5 + 0.2 + 0.05))


def test_load_friction_is_a_share_of_the_motor_torque() -> None:
    """A gearbox that takes 10 % of 8 N m: 0.8 N m more against motion, whatever the torque's sign."""
    motor = MOTOR._replace(load_friction=np.array([0.1]))
    for sign in (-1.0, 1.0):
        command = JointCommand(*(np.array([x]) for x in (0.0, 0.0, 0.0, 0.0, 8.0 * sign)))
        more = [joint_torque(command, np.zeros(1), np.array([1.0]), m) for m in (MOTOR, motor)]
        assert more[1] - more[0] == pytest.approx(-0.8)


def test_damping_of_a_lagged_torque_is_that_of_its_mean() -> None:
    """Minus the derivative of the step's mean torque in the speed, beyond the ramp."""
    motor = MOTOR._replace(lag_s=np.array([0.004]))
    lag, before = lag_over(motor.lag_s, 0.005), np.array([2.0])
    command = JointCommand(*(np.array([x]) for x in (0.1, 0.0, 30.0, 0.8, 0.0)))

    def mean(speed: float) -> float:
        demand = motor_torque(command, np.zeros(1), np.array([speed]), motor)
        return float(lagged(demand, before, lag)[0][0] + friction_torque(np.array([speed]), motor)[0])

    slope = (mean(1.001) - mean(0.999)) / 0.002
    assert joint_damping(command, np.zeros(1), np.array([1.0]), motor, lag) == pytest.approx(-slope)
