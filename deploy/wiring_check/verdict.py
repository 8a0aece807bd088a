"""Compares a robot's motions with its model's, and finds the wiring that explains the difference."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.wiring import Wiring
from footfall.deploy.wiring_check.causes import Cause, as_wired, causes, turn_about_z, turned_back
from footfall.deploy.wiring_check.config import WiringCheckConfig
from footfall.deploy.wiring_check.motions import Motions
from footfall.deploy.wiring_check.prediction import Prediction

LIKELY = 4  # number of most likely causes to simulate, in addition to those for the `STRANGEST` joints
STRANGEST = 2  # number of joints with the largest errors
LIKELY_JOINTS = 12  # likely single-joint causes to simulate if nothing else explains the responses
FLOOR = 0.5  # minimum scale of errors, relative to the median response
LEAST_TILT = 0.06  # rad per rad: smaller tilts of the base are not used to check the IMU
LEAST_TURN_RAD = 0.15  # minimum rotation of an IMU about z to be considered a cause


class Recorded(NamedTuple):
    """The T samples of a check."""

    time_s: np.ndarray  # (T,)
    position: np.ndarray  # (T, n) rad
    torque: np.ndarray  # (T, n) N m
    up: np.ndarray  # (T, 3) world's z axis in the base frame, measured by the IMU
    motor_lag_s: float  # delay from a command to the reading with its effect


class Verdict(NamedTuple):
    """Result of a check."""

    fault: str  # cause and remedy; empty if the wiring is right
    joint_error: float  # largest error of a joint's response, relative to the model's
    imu_error: float  # same for the base's tilt


class Responses(NamedTuple):
    """Responses to n motions: torques (n, n), N m/rad, and the base's tilt by the x and y of `up` (n, 2),
    1/rad."""

    torque: np.ndarray
    tilt: np.ndarray

    def errors(self, right: "Responses") -> tuple[np.ndarray, float]:
        """Error of each joint's torques (n,) and of all tilts, relative to the right responses."""
        size = np.linalg.norm(right.torque, axis=1)
        joint = np.linalg.norm(self.torque - right.torque, axis=1) / np.maximum(size, FLOOR * np.median(size))
        tilt = np.linalg.norm(right.tilt)
        least = LEAST_TILT * np.sqrt(len(size))
        return joint, float(np.linalg.norm(self.tilt - right.tilt) / max(tilt, least))

    def cost(self, right: "Responses", noise: float) -> float:
        """Mean squared error of the joints, plus the squared error of the tilts beyond the IMU's noise."""
        joint, tilt = self.errors(right)
        return float((joint**2).mean() + max(tilt - noise, 0.0) ** 2)


def judged(
    recorded: Recorded,
    motions: Motions,
    here: np.ndarray,
    prediction: Prediction,
    wiring: Wiring,
    legs: Sequence[np.ndarray],
    config: WiringCheckConfig,
) -> Verdict:
    """Compute the verdict on a recording.

    Args:
        recorded: the samples.
        motions: the joints' motions.
        here: position targets at the centre of the motions, rad, (n,).
        prediction: the robot's model.
        wiring: the wiring of `robot.yaml`.
        legs: joints of each leg.
        config: limits of the check.
    """
    n, up = len(here), recorded.up[:, :2]
    measured = Responses(
        motions.responses(recorded.time_s - recorded.motor_lag_s, recorded.torque),
        motions.responses(recorded.time_s - config.imu_lag_s, up),
    )

    settled = (recorded.time_s > 0.5 * config.settle_s) & (recorded.time_s < config.settle_s)
    start = recorded.position[settled].mean(axis=0)

    def predicted(cause: Cause) -> np.ndarray:
        return prediction.responses(start, here, motions, cause)

    right_rows = predicted(as_wired(n))
    right = _responses(right_rows)
    errors, imu_error = measured.errors(right)
    verdict = Verdict("", float(errors.max()), imu_error)
    askew = float(np.linalg.norm(up.mean(axis=0) - right_rows[n, n:]))
    passes = imu_error <= config.imu_alike and askew <= config.askew_rad
    if passes and errors.max() <= config.doubtful:
        return verdict
    every = list(causes(wiring, legs))
    passes = passes and errors.max() <= config.alike
    left = config.explained_in_doubt if passes else config.explained
    fault = _cause(measured, right, errors, predicted, every, prediction.highest, left, config.imu_alike)
    if passes:
        return verdict._replace(fault=fault)
    strange = float(np.median(errors)) > config.unlike
    if not fault and askew > config.askew_rad and not strange:
        fault = (
            f"the IMU is askew by {askew:.2f} rad, or the ground is not level: align it with the base's axes"
        )
    if not fault and (strange or imu_error > config.unlike):
        strangest = wiring.place(int(errors.argmax()))
        fault = f"the robot's motions do not match its description, most of all with {strangest}"
    return verdict._replace(fault=fault)


def _responses(rows: np.ndarray) -> Responses:
    n = rows.shape[1] - 2  # the last row of a prediction has the means
    return Responses(rows[:n, :n], rows[:n, n:])


def _rough_cost(measured: Responses, cause: Cause, right: Responses, highest: np.ndarray) -> float:
    """Squared error of the joints if a cause only permuted and scaled the right responses."""
    torque = cause.responses(right.torque, highest)
    joint, _ = measured._replace(tilt=right.tilt).errors(Responses(torque, right.tilt))
    return float((joint**2).mean())


def _cause(
    measured: Responses,
    right: Responses,
    errors: np.ndarray,
    predicted: Callable[[Cause], np.ndarray],
    every: list[Cause],
    highest: np.ndarray,
    left: float,
    noise: float,
) -> str:
    """The text of the cause that leaves at most a share `left` of the cost; empty if there is none.

    `noise` is an error of the IMU's tilts that is ignored.
    """
    limit = left * measured.cost(right, noise)

    def cost_of(cause: Cause) -> float:
        return measured.cost(_responses(predicted(cause)), noise)

    found: list[tuple[float, str]] = []
    angle = turn_about_z(measured.tilt, right.tilt)
    if abs(angle) > LEAST_TURN_RAD:
        turned = measured._replace(tilt=turned_back(measured.tilt, angle))
        text = (
            f"the IMU is turned by {np.degrees(angle):+.0f} degrees about z: mount it along the base's axes"
        )
        found.append((turned.cost(right, noise), text))
    rough_costs = np.array([_rough_cost(measured, each, right, highest) for each in every])
    strange = set(np.argsort(errors)[-STRANGEST:].tolist())
    of_strange = [row for row, each in enumerate(every) if strange.issuperset(each.key)]
    for row in dict.fromkeys([*np.argsort(rough_costs)[:LIKELY].tolist(), *of_strange]):
        found.append((cost_of(every[row]), every[row].text))
    if min(found)[0] > limit:
        found += [(cost_of(each), each.text) for each in every if len(each.key) > 2]  # few: legs and buses
        if min(found)[0] > limit:
            found += _of_one_joint(every, rough_costs, cost_of)
    cost, text = min(found)
    return text if cost <= limit else ""


def _of_one_joint(
    every: list[Cause], rough_costs: np.ndarray, cost_of: Callable[[Cause], float]
) -> list[tuple[float, str]]:
    """Costs and texts of single-joint causes: the likely ones, then all of the best one's joint.

    If many legs stand, a wrong gear ratio shows mostly in other joints, and the rough costs favour a mild
    one.
    """
    alone = [row for row in np.argsort(rough_costs).tolist() if len(every[row].key) == 1]
    found = [(cost_of(every[row]), every[row].text, every[row].key) for row in alone[:LIKELY_JOINTS]]
    joint = min(found)[2]
    found += [
        (cost_of(every[row]), every[row].text, joint)
        for row in alone[LIKELY_JOINTS:]
        if every[row].key == joint
    ]
    return [(cost, text) for cost, text, _ in found]
