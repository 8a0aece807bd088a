"""For any decision and reading, no frame requests more torque than a motor can deliver."""

from dataclasses import replace
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from some_motors import report

from footfall import JointCommand, load_robot
from footfall.deploy.drivers.choice import open_driver, open_imu
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.motor_ends.choice import open_motor_end

ROBOT = load_robot("go1")
WIRING = wiring_of(ROBOT)
N = 12
WIRINGS = {
    "go1": WIRING,
    # A range of MIT-65-500's frames is ten times the motors' limits.
    **{model: replace(WIRING, models=(model,) * N) for model in ("MIT-65-500", "DM8009", "RS03", "ODrive")},
    "mixed": replace(WIRING, models=("RS03", "DM8009", "ODrive") * 4, motor_id=np.arange(4, 4 + N)),
}
FLOAT_ROUNDING = 2.0**-24  # of a number with 24 significant bits, half of the last one
USUAL_READING = np.array([[12.5], [40.0], [40.0]])  # where a frame's range is unlimited

numbers = st.one_of(st.floats(-highest, highest) for highest in (3.0, 600.0, 1e300))
decisions = arrays.arrays(float, (5, N), elements=numbers)
readings = arrays.arrays(float, (3, N), elements=st.floats(-1.0, 1.0))  # of a frame's range
wirings = st.sampled_from(sorted(WIRINGS)).map(WIRINGS.__getitem__)


class Pair:
    """A joint layer that has received readings, and the motors that receive its frames."""

    def __init__(self, wiring: Wiring, share: np.ndarray, target: np.ndarray) -> None:
        self.driver, self.motors = open_driver(wiring), open_motor_end(wiring)
        self.layer = JointLayer(ROBOT, self.driver, open_imu(WIRING), 0.002)
        self.motors.requests(self.driver.query_settings())  # which switches ODrives to torque control
        highest = self.driver.highest[[0, 1, 4]]
        reading = share * np.where(np.isfinite(highest), highest, USUAL_READING)
        errors = np.zeros(N, np.uint64)
        answers = [self.motors.reply(slice(None), report(reading, errors))]
        for now_us in (0, 1000) if self.motors.broadcasts else ():  # half of the motors at a time
            answers.append(self.motors.broadcast(now_us, errors == 0, report(reading, errors)))
        self.layer.absorb(answers, 0)
        self.layer.begin_at(target)
        self.precision = np.array([precision(model) for model in wiring.models]).T

    def decoded(self, frames: Frames) -> JointCommand:
        requests = self.motors.requests(frames)
        values = np.full((5, N), np.nan)
        values[:, requests.motor] = requests.values
        return JointCommand(*values)

    def excess(self, frames: Frames) -> np.ndarray:
        """Requested torque beyond the motors' limits, N m, minus the rounding error."""
        sensed, decoded = self.layer.sensed(), self.decoded(frames)
        error = decoded.position - sensed.joint_position
        speed_error = decoded.velocity - sensed.joint_velocity
        torque = decoded.kp * error + decoded.kd * speed_error + decoded.torque
        span = np.where(self.precision > 0.0, self.driver.highest - self.driver.lowest, 0.0)
        position, velocity, kp, kd, torque_quantum = span * self.precision
        gain_rounding = kp * (np.abs(error) + position) + kd * (np.abs(speed_error) + velocity)
        rounding = 0.5 * (gain_rounding + decoded.kp * position + decoded.kd * velocity + torque_quantum)
        # The limits are the motor's current limit and the supply's line, up to zero.
        stall, peak = ROBOT.motor.stall_torque, ROBOT.motor.peak_torque
        line = stall / ROBOT.motor.no_load_speed * sensed.joint_velocity
        highest, lowest = np.clip(stall - line, 0.0, peak), np.clip(-stall - line, -peak, 0.0)
        rounding = rounding + FLOAT_ROUNDING * np.abs(torque)
        return np.maximum(torque - highest, lowest - torque) - rounding * (1 + 1e-9)


def precision(model: str) -> list[float]:
    """Quantum of each number of a command in a model's frames, as a share of its range; 0 for floats."""
    if model == "ODrive":
        return [0.0] * 5
    return [1 / 65535] * 5 if model.startswith("RS") else [1 / 65535, *[1 / 4095] * 4]


@settings(max_examples=60, deadline=None)
@given(wiring=wirings, decision=decisions, share=readings, start=readings)
def test_commands_in_limits(wiring: Wiring, decision: Any, share: np.ndarray, start: np.ndarray) -> None:
    ends = Pair(wiring, share, 12.5 * start[0])
    for _ in range(2):
        assert ends.excess(ends.layer.command(JointCommand(*decision))).max() <= 0.0


@settings(max_examples=60, deadline=None)
@given(wiring=wirings, kd=st.floats(0.0, 1e6), share=readings)
def test_damping_without_readings_in_limits(wiring: Wiring, kd: float, share: np.ndarray) -> None:
    """Motors repeatedly receive frames made from the latest speeds."""
    ends = Pair(wiring, share, ROBOT.default_pose)
    for frames in 2 * ends.driver.damping(ends.layer.possible_damping(kd)):
        decoded = ends.decoded(frames)
        if np.isfinite(decoded.kd).all():
            assert ends.excess(frames).max() <= 0.0


def test_damping_is_lowered_only_as_far_as_necessary() -> None:
    """go1's hips and thighs brake with 23.7 N m, its calves with 35.55: 2.37 and 3.0 at 10 rad/s."""
    speed = np.zeros((3, N))
    speed[1] = 10.0 / 50.0  # of a frame's range
    damping = Pair(WIRING, speed, ROBOT.default_pose).layer.possible_damping(3.0)
    np.testing.assert_allclose(damping, 4 * [2.37, 2.37, 3.0], rtol=2e-3)
