"""Compares a robot's motions with its model's, and finds the wiring that explains the difference."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.wiring import Wiring
from footfall.deploy.wiring_check.causes import Cause, as_wired, causes, turn_about_z, turned_back
from footfall.deploy.wiring_check.config import WiringCheckConfig
from footfall.deploy.wiring_check.motions import Motions
from footfall.deploy.wiring_check.prediction import Prediction

SIMULATED_CAUSES = 4  # most likely causes of each kind to simulate, besides those of the `WORST_JOINTS`
CERTAIN_SHARE = 0.02  # share of the cost left by a cause, below which no further ones are simulated
DELAY_STEP_S = 0.002
WORST_JOINTS = 2  # number of joints with the largest errors
NUM_SUSPECTS = 3  # number of motors whose torques have the largest errors
MIN_SCALE = 0.5  # minimum scale of errors, relative to the median response
MIN_TILT = 0.06  # rad per rad: smaller tilts of the base are not used to check the IMU
MAX_TWIN_ERROR = 2.0  # maximum rough error of a twin, relative to `alike`; the simulated one is often smaller
MIN_TURN_RAD = 0.15  # minimum rotation of an IMU about z to be considered a cause


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

    @property
    def min_size(self) -> float:
        """Torque response, N m/rad, by which errors are divided where the joint's own is smaller."""
        return MIN_SCALE * float(np.median(np.linalg.norm(self.torque, axis=1)))

    def errors(self, model: "Responses", min_size: float) -> tuple[np.ndarray, float]:
        """Error of each joint's torques (n,) and of all tilts, relative to the model's responses."""
        size = np.linalg.norm(model.torque, axis=1).clip(min_size, None)
        joint = np.linalg.norm(self.torque - model.torque, axis=1) / size
        tilt = np.linalg.norm(model.tilt)
        min_tilt = MIN_TILT * np.sqrt(len(size))
        return joint, float(np.linalg.norm(self.tilt - model.tilt) / max(tilt, min_tilt))

    def cost(self, model: "Responses", min_size: float, noise: float) -> float:
        """Mean squared error of the joints, plus the squared error of the tilts beyond the IMU's noise."""
        joint, tilt = self.errors(model, min_size)
        return float((joint**2).mean() + max(tilt - noise, 0.0) ** 2)


def judge(
    recorded: Recorded,
    motions: Motions,
    centre: np.ndarray,
    prediction: Prediction,
    wiring: Wiring,
    legs: Sequence[np.ndarray],
    config: WiringCheckConfig,
) -> Verdict:
    """Compute the verdict on a recording.

    Args:
        recorded: the samples.
        motions: the joints' motions.
        centre: position targets at the centre of the motions, rad, (n,).
        prediction: the robot's model.
        wiring: the wiring of `robot.yaml`.
        legs: joints of each leg.
        config: limits of the check.
    """
    n, up = len(centre), recorded.up[:, :2]
    settled = (recorded.time_s > 0.5 * config.settle_s) & (recorded.time_s < config.settle_s)
    start = recorded.position[settled].mean(axis=0)

    def simulated(cause: Cause) -> Iterator[np.ndarray]:
        return prediction.one_by_one(start, centre, motions, cause)

    expected_rows = prediction.responses(start, centre, motions, as_wired(n))
    expected = _responses(expected_rows[:n])
    min_size = expected.min_size
    measured = _measured(recorded, motions, expected, config)
    errors, imu_error = measured.errors(expected, min_size)
    verdict = Verdict("", float(errors.max()), imu_error)
    askew = float(np.linalg.norm(up.mean(axis=0) - expected_rows[n, n:]))
    passes = imu_error <= config.imu_alike and askew <= config.askew_rad
    possible, search = (
        list(causes(wiring, legs)),
        Search(measured, expected, min_size, config.imu_alike, simulated),
    )
    if passes and errors.max() <= config.doubtful:
        return verdict._replace(fault=search.twin(possible, prediction.highest, config))
    passes = passes and errors.max() <= config.alike
    max_share = config.explained_in_doubt if passes else config.explained
    unlike = float(np.median(errors)) > config.unlike
    fails = unlike or imu_error > config.unlike
    fault = search.cause(possible, prediction.highest, max_share, thorough=fails)
    if passes:
        return verdict._replace(fault=fault or search.twin(possible, prediction.highest, config))
    fault = fault or search.motor(possible, config)
    if not fault and askew > config.askew_rad and not unlike:
        fault = (
            f"the IMU is askew by {askew:.2f} rad, or the ground is not level: align it with the base's axes"
        )
    if not fault and fails:
        worst = wiring.label(int(errors.argmax()))
        fault = f"the robot's motions do not match its description, most of all with {worst}"
    return verdict._replace(fault=fault)


def _measured(
    recorded: Recorded, motions: Motions, expected: Responses, config: WiringCheckConfig
) -> Responses:
    """The measured responses, with the additional delay at which most joints agree best with the model.

    A robot's computer, buses and filters add delays that its description does not have.
    """

    def responses(values: np.ndarray, lag_s: float) -> np.ndarray:
        return motions.responses(recorded.time_s - lag_s, values)

    def error(delay_s: float) -> float:
        torque = responses(recorded.torque, recorded.motor_lag_s + delay_s)
        return float(np.median(np.linalg.norm(torque - expected.torque, axis=1)))

    delay_s = min(np.arange(0.0, config.max_delay_s, DELAY_STEP_S).tolist(), key=error)
    return Responses(
        responses(recorded.torque, recorded.motor_lag_s + delay_s),
        responses(recorded.up[:, :2], config.imu_lag_s + delay_s),
    )


def _responses(rows: np.ndarray) -> Responses:
    """Responses from the rows (n, n + 2) of a prediction."""
    return Responses(rows[:, :-2], rows[:, -2:])


class Search(NamedTuple):
    """Looks for the wiring whose simulation has the measured responses."""

    measured: Responses
    expected: Responses  # of the wiring in `robot.yaml`
    min_size: float  # see `Responses.min_size`
    noise: float  # error of the IMU's tilts that is ignored
    simulated: Callable[[Cause], Iterator[np.ndarray]]  # response to one motion after the other

    def cause(
        self, possible: list[Cause], highest: np.ndarray, max_share: float, thorough: bool = False
    ) -> str:
        """The text of the cause that leaves at most `max_share` of the cost; empty if there is none.

        Exchanges that look unlikely are simulated if `thorough`, or if another cause is possible.
        """
        cost = self.measured.cost(self.expected, self.min_size, self.noise)
        limit = max_share * cost
        costs = np.array([self._rough_cost(each, highest) for each in possible])
        errors, _ = self.measured.errors(self.expected, self.min_size)
        worst = set(np.argsort(errors)[-WORST_JOINTS:].tolist())
        of_worst = [row for row, each in enumerate(possible) if worst.issuperset(each.key)]
        order = np.argsort(costs).tolist()
        likely = [row for kind in (1, 2, 3) for row in _of_kind(kind, order, possible)[:SIMULATED_CAUSES]]
        first = sorted({*likely, *of_worst}, key=order.index)
        best = min(self._best([possible[row] for row in first], limit), self._turned_imu())
        if best[0] > CERTAIN_SHARE * cost:
            groups = [row for row in _of_kind(3, order, possible) if row not in first]  # few: legs and buses
            best = min(best, self._best([possible[row] for row in groups], min(limit, best[0])))
        if best[0] > CERTAIN_SHARE * cost:  # rough costs mislead, most of all those of a biped
            pairs = thorough or best[0] <= limit
            rest = [
                possible[row] for row in order if len(possible[row].key) <= 1 + pairs and row not in first
            ]
            best = min(best, self._best(rest, min(limit, best[0])))
        return best[1] if best[0] <= limit else ""

    def twin(self, possible: list[Cause], highest: np.ndarray, config: WiringCheckConfig) -> str:
        """The text of two exchanged motors that the right wiring resembles; empty if there are none.

        If both have similar positions, such as the hip yaws of a biped, an exchange hardly adds to the
        errors, and the robot's swaying hides it. The torques of the two motors show it: swaying does not load
        them.
        """
        for cause in possible:
            rough = self.expected._replace(torque=cause.responses(self.expected.torque, highest))
            rough_errors, _ = self.expected.errors(rough, self.min_size)
            if len(cause.key) != 2 or rough_errors.max() > MAX_TWIN_ERROR * config.alike:
                continue
            moved = _responses(np.array(list(self.simulated(cause)))).torque
            size = np.linalg.norm(self.expected.torque, axis=1).clip(self.min_size, None)
            exchanged, wired = (
                (((self.measured.torque - each)[:, cause.key].T / size) ** 2).sum()
                for each in (moved, self.expected.torque)
            )
            if exchanged <= config.explained_in_doubt * wired:
                return cause.text
        return ""

    def motor(self, possible: list[Cause], config: WiringCheckConfig) -> str:
        """The text of one motor's mistake that explains that motor's torques; empty if there is none.

        A slipping foot adds errors to all joints and to the tilts. No cause explains these errors, and the
        simulated foot may slip differently. Slip hardly changes the torques that one motor reports, nor the
        torques in that motor's own motion. If masses or friction differ from the model's, some causes explain
        much of the total error, but little of these torques.
        """
        best = math.inf, ""
        by_motor = self._torque_errors(self.expected).sum(axis=0)
        suspects = set(np.argsort(by_motor)[-NUM_SUSPECTS:].tolist())
        for cause in (each for each in possible if len(each.key) == 1 and suspects.issuperset(each.key)):
            moved = _responses(np.array(list(self.simulated(cause))))
            remaining, expected = self._torque_errors(moved), self._torque_errors(self.expected)
            (joint,) = cause.key
            of_motor = remaining[:, joint].sum() / expected[:, joint].sum()
            of_motion = remaining[joint].sum() / expected[joint].sum()
            of_all = remaining.sum() / expected.sum()
            likely = of_motor <= config.explained_in_doubt and of_all <= config.explained
            if likely or max(of_motor, of_motion) <= config.explained_of_motor:
                best = min(best, (of_motor, cause.text))
        return best[1]

    def _torque_errors(self, model: Responses) -> np.ndarray:
        """Squared error of each motor's torque (columns) in each motion (rows), relative to `expected`."""
        size = np.linalg.norm(self.expected.torque, axis=1).clip(self.min_size, None)
        errors: np.ndarray = ((self.measured.torque - model.torque) / size[:, None]) ** 2
        return errors

    def _turned_imu(self) -> tuple[float, str]:
        """Cost and text of an IMU that is turned about z; infinite if it is not."""
        angle = turn_about_z(self.measured.tilt, self.expected.tilt)
        if abs(angle) <= MIN_TURN_RAD:
            return math.inf, ""
        turned = self.measured._replace(tilt=turned_back(self.measured.tilt, angle))
        text = (
            f"the IMU is turned by {np.degrees(angle):+.0f} degrees about z: mount it along the base's axes"
        )
        return turned.cost(self.expected, self.min_size, self.noise), text

    def _best(self, candidates: Sequence[Cause], limit: float) -> tuple[float, str]:
        """The lowest cost of some causes, and its text; an infinite one above the limit."""
        best = math.inf, ""
        for cause in candidates:
            best = min(best, (self._cost(cause, min(best[0], limit)), cause.text))
        return best

    def _cost(self, cause: Cause, limit: float) -> float:
        """Cost of a simulated cause; infinite above the limit, where the simulation need not go on."""
        rows, cost, torque = [], 0.0, self.measured.torque
        for row, measured in zip(self.simulated(cause), torque, strict=True):
            rows.append(row)
            size = max(float(np.linalg.norm(row[:-2])), self.min_size)
            cost += float(np.linalg.norm(measured - row[:-2]) / size) ** 2 / len(torque)
            if cost > limit:
                return math.inf
        cost = self.measured.cost(_responses(np.array(rows)), self.min_size, self.noise)
        return cost if cost <= limit else math.inf

    def _rough_cost(self, cause: Cause, highest: np.ndarray) -> float:
        """Squared error of the joints if a cause only permuted and scaled the expected responses."""
        torque = cause.responses(self.expected.torque, highest)
        joint, _ = self.measured.errors(self.expected._replace(torque=torque), self.min_size)
        return float((joint**2).mean())


def _of_kind(kind: int, order: Sequence[int], possible: Sequence[Cause]) -> list[int]:
    """Causes, in this order, that affect one joint, two, or more (3)."""
    return [row for row in order if min(len(possible[row].key), 3) == kind]
