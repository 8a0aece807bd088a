"""Adds up what sensors say, and works out how far they contradict each other.

Readings are added up every `SAMPLE_S` and compared every `period_s`, which keeps the cost of a tick small and
takes single spikes out. For the same reason what is said of the body is compared a tick after what is said of
its joints.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.pose import beyond
from footfall.deploy.sensor_limits import SensorLimits
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs
from footfall.robots.targets import within

LOOKS_A_HEIGHT = 3  # a body takes its time to fall, and its height takes more to work out than all the rest
IMPACT_S = 0.01  # that a foot takes to touch down: readings farther apart miss how a velocity changes
SAMPLE_S = 0.004  # between two readings that are added up: a fraction of what a leg takes to swing
IMU_PARTS = Inertial._fields


class BodyWindow(NamedTuple):
    """What was said of the body from one look to the next."""

    elapsed_s: float
    before: Inertial  # where the window began
    inertials: list[Inertial]  # in it
    position: np.ndarray  # of the joints, at its end, rad, (n,)
    torque: np.ndarray  # mean of what motors reported, N m, (n,)
    fastest: float  # mean speed of the fastest joint, rad/s


class SensorMonitor:
    """Adds up readings and looks at them from time to time."""

    def __init__(self, robot: Robot, limits: SensorLimits, tick_s: float) -> None:
        n = len(robot.joint_names)
        self._limits = limits
        sample_s = tick_s * max(1, round(min(SAMPLE_S, limits.period_s) / tick_s))
        self._sample_us = round(1e6 * (sample_s - tick_s / 2))  # half a tick early: rounding costs none
        self._share = limits.drift_share * max(1.0, sample_s / IMPACT_S)  # of a way, granted
        self._lag_s = limits.filter_s + sample_s / 2  # of a velocity, with a jump between two readings
        self._every = max(1, round(limits.period_s / sample_s))
        self._gap_us = round(1e6 * max(limits.period_s / 2, 1.5 * sample_s))
        self.lower, self.upper = robot.lower_rad, robot.upper_rad
        self._least_voltage, self._most_voltage = robot.voltage_range
        self._hidden = limits.torque_hidden * robot.motor.peak_torque
        self._much = (limits.torque_much - limits.torque_hidden) * robot.motor.peak_torque  # beyond that
        self._little = limits.torque_little * robot.motor.peak_torque
        self._least = (limits.torque_some * robot.motor.peak_torque) ** 2
        self._peak, self._full = robot.motor.peak_torque, limits.torque_full * robot.motor.peak_torque
        self._legs, self._standing_m = _legs(robot), robot.description.standing_height_m
        self._attitude = None if self._legs is None else LegAttitude(robot, limits)
        self._n = n
        self._added_us = 0
        inertial = Inertial((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0))
        self.begin(0, np.zeros(n, np.int64), inertial, np.zeros((3, n)), np.zeros(n))

    def begin(
        self, now_us: int, heard_us: np.ndarray, inertial: Inertial, joints: np.ndarray, target: np.ndarray
    ) -> None:
        """Forget all, and start from these readings (as in `add`) and position targets, rad, (n,)."""
        n = self._n
        self._start_window(now_us)
        self._heard_us = heard_us.copy()
        self.joints, self._target, self._inertial = joints, target, inertial
        self._last = joints
        self.temperature, self.voltage = np.full((2, n), np.nan)
        self.drift, self.wander, self.stuck, self.repeated = np.zeros((4, n))
        self._target_way = np.zeros(n)  # of the targets in the last window
        self._ended = joints[0]  # rad, where the last window ended
        self._apart, self._ways = np.zeros((2, n))  # rad^2: squares that were added up, and fade
        self._wandered = np.zeros(n)  # rad, the same without squares
        self._wandered_stuck = np.zeros(n)  # rad, likewise, since a position or a velocity repeats itself
        self._fastest = np.zeros(n)  # rad/s, lately
        self._youngest_us = (now_us - heard_us).astype(float)  # age of each motor's reading at its best
        self._uneven_s, self._late_s = np.zeros((2, n))  # by how much one was older: lately, and added up
        self.limp_s, self.opposing, self.torque_stuck = np.zeros((3, n))
        self._expected_before, self._expected_stuck = np.zeros((2, n))  # N m: lately; when it began to repeat
        self._work, self._asked = np.zeros((2, n))  # (N m)^2: reported by expected, and expected squared
        self.rotation = [0.0, 0.0, 0.0]
        self._base_turned = self._base_apart = 0.0  # rad, in a window, by quaternion or gyro; between them
        self._imu_repeated = [0.0, 0.0, 0.0]
        self._resting_s = 0.0
        self._resting = [0.0, 0.0, 0.0]  # mean acceleration of the rest, world axes
        self.rest_error = 0.0
        self._mean = [0.0, 0.0, GRAVITY_M_S2]  # acceleration, world axes
        self._looks = 0
        self._body: BodyWindow | None = None  # that has not been looked at
        self.on_legs = True  # whether the legs should carry the base
        if self._attitude is not None:
            self._attitude.reset()
        self.sunk = 0.0  # of the base's clearance when standing, how much is gone

    def due(self, now_us: int) -> bool:
        """Whether it is time to add readings."""
        return now_us - self._added_us >= self._sample_us

    def add(
        self,
        now_us: int,
        silence_us: int,
        heard_us: np.ndarray,
        inertial: Inertial,
        joints: np.ndarray,
        expected: np.ndarray,
    ) -> bool:
        """Take in one tick's readings; returns whether it is time to look at what was added.

        Args:
            now_us: the loop's time.
            silence_us: how old the oldest of the readings is. After a gap they are not compared, since what
                happened in it is not known.
            heard_us: (n,) when each motor's reading arrived.
            inertial: the IMU's reading.
            joints: (3, n) position rad, velocity rad/s, torque N m that the motors report.
            expected: (n,) torque that the last commands ask for at these readings, N m.
        """
        if silence_us > self._gap_us or now_us - self._added_us > self._gap_us:
            self._gap = True
        age_us = now_us - heard_us
        np.minimum(self._youngest_us, age_us, out=self._youngest_us)
        np.maximum(self._late_us, age_us - self._youngest_us, out=self._late_us)
        self._added_us = now_us
        self._turned += (0.5e-6 * (heard_us - self._heard_us)) * (joints[1] + self._last[1])
        self._starts += joints[0] - self._turned
        self._heard_us = heard_us.copy()
        self._same &= joints == self._last
        self._last = joints
        self._sum += joints
        np.maximum(self._strongest, np.abs(joints[2]), out=self._strongest)
        self._expected += expected
        self._inertials.append(inertial)
        return len(self._inertials) >= self._every

    def look(
        self, stiffness: np.ndarray, target: np.ndarray, temperature: np.ndarray, voltage: np.ndarray
    ) -> bool:
        """Compare what was added since the last look; returns False if a gap made that impossible.

        What was added of the body waits for `look_at_body`.

        Args:
            stiffness: (n,) of the last command, N m/rad.
            target: (n,) position targets that went out last, rad.
            temperature: (n,) degrees Celsius; NaN of a motor that does not say. Likewise:
            voltage: (n,) at the motors' supply, V.
        """
        compared = not self._gap
        if compared:
            self._compare_joints((self._added_us - self._looked_us) * 1e-6, stiffness, target)
        else:
            self._ended = self._last[0]
        self.temperature, self.voltage = temperature, voltage
        self._target_way = np.abs(target - self._target)
        self.joints, self._target, self._inertial = self._last, target, self._inertials[-1]
        self._start_window(self._added_us)
        return compared

    def _start_window(self, now_us: int) -> None:
        self._looked_us = now_us
        self._added_us = now_us
        self._gap = False
        self._sum: np.ndarray = np.zeros((3, self._n))  # of readings since the last look
        self._same: np.ndarray = np.ones((3, self._n), bool)  # each of them as the one before
        self._strongest: np.ndarray = np.zeros(self._n)  # torque that was reported, either way
        self._expected: np.ndarray = np.zeros(self._n)  # likewise, of expected torques
        self._turned: np.ndarray = np.zeros(self._n)  # by velocities, rad
        self._starts: np.ndarray = np.zeros(self._n)  # sum of where the window began, by each reading, rad
        self._late_us: np.ndarray = np.zeros(self._n)  # by how much a reading was older than the youngest one
        self._inertials: list[Inertial] = []  # since the last look

    def look_at_body(self) -> bool:
        """Compare what the last look left of the body; returns False if it left nothing."""
        body, self._body = self._body, None
        if body is None:
            return False
        count, inertial = len(body.inertials), body.inertials[-1]
        gyros, accelerations, _ = zip(*body.inertials, strict=True)
        gyro, acceleration = (
            [sum(values) / count for values in zip(*parts, strict=True)] for parts in (gyros, accelerations)
        )
        self._compare_turns(gyro, body)
        self._compare_gravity(acceleration, gyro, body)
        self._looks += 1
        if not self.on_legs:
            self.sunk = 0.0
        elif self._looks % LOOKS_A_HEIGHT == 0:
            self.sunk = self.sunk_share(body.position, inertial.quaternion)
        self._compare_attitude(body)
        self._compare_repeated(body)
        return True

    def _compare_joints(self, elapsed_s: float, stiffness: np.ndarray, target: np.ndarray) -> None:
        count, joints, same = len(self._inertials), self._last, self._same
        self._sum /= count
        self._expected /= count
        velocity, torque = self._sum[1], self._sum[2]
        self._compare_ways(self._starts / count, self._turned, elapsed_s)
        # A reading is older than the target that went out last, which may leap while a robot stands still.
        self.repeated = (same[0] & same[1] & same[2]) * (self.repeated + self._target_way)
        speed = np.abs(velocity)
        targets_speed = np.abs(target - self._target) / elapsed_s
        self._compare_torques(torque, self._expected, stiffness, speed, targets_speed, elapsed_s)
        self._body = BodyWindow(
            elapsed_s, self._inertial, self._inertials, joints[0], torque, max(speed.tolist())
        )

    def _compare_ways(self, started: np.ndarray, turned: np.ndarray, elapsed_s: float) -> None:
        """How far joints have gone by their positions, (n,), against how far by their velocities, rad.

        Each reading of a window, less the way by velocities until then, says where the window began: their
        mean has less noise than one of them, and should be where the window before ended. Squares are added
        up, so that what a joint does to and fro does not cancel out. A share of the way is granted, since a
        velocity that a motor filters lags behind, the more so where readings are far apart. What comes
        unevenly may be as late as the oldest reading was older than the youngest, each time anew. Ways apart
        are added up anew since each position, or each velocity, is to its last digit the one before.
        """
        limits = self._limits
        apart = started - self._ended
        self._ended = started + turned
        kept = math.exp(-elapsed_s / limits.drift_memory_s)
        self._apart = kept * self._apart + apart * apart
        self._ways = kept * self._ways + np.maximum(turned * turned, (turned + apart) ** 2)
        late_s = 1e-6 * self._late_us
        self._uneven_s = np.maximum(kept * self._uneven_s, late_s)
        self._late_s = kept * self._late_s + late_s
        share = self._share + self._uneven_s / elapsed_s
        self.drift = np.sqrt(self._apart) - share * np.sqrt(self._ways)
        self._wandered = kept * self._wandered + apart
        self._wandered_stuck = (self._same[0] | self._same[1]) * (kept * self._wandered_stuck + apart)
        self._fastest = np.maximum(kept * self._fastest, np.abs(self._last[1]))
        granted = (self._lag_s + self._late_s) * self._fastest
        self.wander = np.abs(self._wandered) - granted
        self.stuck = np.abs(self._wandered_stuck) - granted

    def _compare_torques(
        self,
        torque: np.ndarray,
        expected: np.ndarray,
        stiffness: np.ndarray,
        speed: np.ndarray,
        targets_speed: np.ndarray,
        elapsed_s: float,
    ) -> None:
        """How long much was expected and none reported, and how much of it points the other way.

        Expected torques are worked out from rounded positions, and from older ones than the motor's own: what
        stiffness makes of either counts for nothing. A motor that follows late does either for moments; any
        report in between sets the time back.

        Args:
            torque: reported torque, N m, (n,), on average since the last look.
            expected: expected torque, likewise.
            stiffness: of the last command, N m/rad.
            speed: of the joints, on average, rad/s.
            targets_speed: of the position targets, likewise: a motor that is late still follows an older one.
            elapsed_s: time since the last look.
        """
        limits = self._limits
        doubt = stiffness * (limits.reading_rad + limits.lag_s * speed)
        least = np.maximum(np.abs(expected) - doubt, 0.0)
        asked = within((least - self._hidden) / self._much, 0.0, 1.0)
        self.limp_s = (self._strongest <= self._little) * (self.limp_s + elapsed_s * asked)
        late = stiffness * limits.lag_s * np.maximum(targets_speed - speed, 0.0)
        least = np.maximum(least - late, 0.0)
        kept = math.exp(-elapsed_s / limits.memory_s)
        self._work = kept * self._work + (1.0 - kept) * torque * np.copysign(least, expected)
        self._asked = kept * self._asked + (1.0 - kept) * least * least
        self.opposing = -self._work / np.maximum(self._asked, self._least)
        self._compare_stuck_torques(torque, expected, stiffness)

    def _compare_stuck_torques(self, torque: np.ndarray, expected: np.ndarray, stiffness: np.ndarray) -> None:
        """How far the expected torque, N m, (n,), has moved since each report is the one before.

        Until the window before: a motor that is late has not answered to the last one yet. What may be hidden
        does not count, the rest adds up from window to window. One that gives all that it can repeats itself,
        and so does one that is asked for the same from now on: no more counts than report and command differ.
        """
        same = self._same[2] & (self._strongest < self._full)
        moved = np.abs(self._expected_before - self._expected_stuck)
        moved = np.minimum(moved, np.abs(self._expected_before - torque))
        shown = np.maximum(moved - self._hidden - stiffness * self._limits.reading_rad, 0.0)
        self.torque_stuck = same * (self.torque_stuck + shown / self._peak)
        self._expected_stuck = np.where(same, self._expected_stuck, expected)
        self._expected_before = expected

    def _compare_turns(self, gyro: list[float], body: BodyWindow) -> None:
        """The body's turn in a window: by quaternions twice the vector part of before* now."""
        kept = math.exp(-body.elapsed_s / self._limits.memory_s)
        w, x, y, z = body.before.quaternion
        a, b, c, d = body.inertials[-1].quaternion
        sign = 2.0 if w * a + x * b + y * c + z * d >= 0.0 else -2.0
        turn = (
            sign * (w * b - x * a - y * d + z * c),
            sign * (w * c + x * d - y * a - z * b),
            sign * (w * d - x * c + y * b - z * a),
        )
        turned = [rate * body.elapsed_s for rate in gyro]
        self.rotation = [
            kept * error + angle - other
            for error, angle, other in zip(self.rotation, turn, turned, strict=True)
        ]
        self._base_apart = max(abs(a - b) for a, b in zip(turn, turned, strict=True))
        self._base_turned = max(map(abs, (*turn, *turned)))

    def _compare_repeated(self, body: BodyWindow) -> None:
        """How long each part has been in all readings the one before, while it should not.

        While joints move, of a robot on its legs: one that lies or hangs may keep still. The rate of a smooth
        motion stays the same for a while: gyro and quaternion count where they turn apart. An acceleration
        counts half where the body has not turned: gravity's share of it stays the same.
        """
        limits = self._limits
        moves = body.fastest > limits.moving_rad_s and self.on_legs
        apart = float(self._base_apart > limits.turned_rad)
        for part, counts in enumerate((apart, 1.0 if self._base_turned > limits.turned_rad else 0.5, apart)):
            before = body.before[part]
            if any(inertial[part] != before for inertial in body.inertials):
                self._imu_repeated[part] = 0.0
            elif moves:
                self._imu_repeated[part] += counts * body.elapsed_s

    def _compare_gravity(self, pulled: list[float], gyro: list[float], body: BodyWindow) -> None:
        """Mean acceleration in the world's axes: at rest, and on average, it is gravity's opposite."""
        limits, elapsed_s = self._limits, body.elapsed_s
        w, x, y, z = body.inertials[-1].quaternion
        a, b, c = pulled
        ahead = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c
        left = 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c
        up = 2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c
        kept = math.exp(-elapsed_s / limits.lean_memory_s)
        self._mean = [
            kept * mean + (1 - kept) * value
            for mean, value in zip(self._mean, (ahead, left, up), strict=True)
        ]
        if max(body.fastest, *map(abs, gyro)) >= limits.resting_rad_s:
            self._resting_s, self.rest_error = 0.0, 0.0
            return
        weight = max(elapsed_s / (self._resting_s + elapsed_s), 1.0 - kept)  # a mean, at first of all of it
        self._resting = [
            mean + weight * (value - mean)
            for mean, value in zip(self._resting, (ahead, left, up), strict=True)
        ]
        self._resting_s += elapsed_s
        if self._resting_s >= limits.resting_s:
            ahead, left, up = self._resting
            self.rest_error = math.hypot(ahead, left, up - GRAVITY_M_S2) / GRAVITY_M_S2

    def _compare_attitude(self, body: BodyWindow) -> None:
        """The base's attitude by the IMU against that by the legs, of a robot that stands nearly still."""
        if self._attitude is None:
            return
        if self.on_legs and body.fastest < self._limits.resting_rad_s:
            up = np.array(_up(body.inertials[-1].quaternion))
            self._attitude.look(body.position, body.torque, up, body.elapsed_s)
        else:
            self._attitude.reset()

    def sunk_share(self, position: np.ndarray, quaternion: Sequence[float]) -> float:
        """How much of the clearance between the base's lowest corner and the lowest foot is gone.

        By the legs and the IMU.

        Args:
            position: (n,) of the joints, rad.
            quaternion: of the base, w x y z.

        Returns:
            0 when it stands, 1 when a corner of the base is as low as the feet; 0 of a robot without legs.
        """
        if self._legs is None:
            return 0.0
        up = np.array(_up(quaternion))
        below = self._legs.pose(position).foot @ up
        height = float(np.maximum.reduce(self._legs.foot_radius - below))
        base_below = -float(np.minimum.reduce(self._legs.base_corners @ up))
        clearance = (height - base_below) / (self._standing_m - self._legs.base_below)
        return 1.0 - clearance

    # -- what the rows measure -----------------------------------------------------------------------

    def outside(self) -> np.ndarray:
        """How far each joint is beyond its range, rad."""
        return beyond(self.joints[0], self.lower, self.upper)

    def hot(self) -> np.ndarray:
        """Each motor's temperature, degrees Celsius, (n,); 0 of one that is colder or does not say."""
        return np.fmax(self.temperature, 0.0)  # of a number and none the number

    def off_voltage(self) -> np.ndarray:
        """How far each motor's supply is outside its range, V, (n,); 0 of one that does not say."""
        return np.fmax(beyond(self.voltage, self._least_voltage, self._most_voltage), 0.0)

    def lean(self) -> float:
        """Mean sideways acceleration over gravity."""
        return math.hypot(*self._mean[:2]) / GRAVITY_M_S2

    def lift(self) -> float:
        """How far the mean upward acceleration is off gravity's opposite, over gravity."""
        return abs(self._mean[2] / GRAVITY_M_S2 - 1.0)

    def slope(self) -> float:
        """Angle between the plane of the feet that stand and the IMU's level, rad; 0 if none stand still."""
        return 0.0 if self._attitude is None else self._attitude.slope

    def leg_turn(self) -> float:
        """The base's turn by the IMU other than by the legs, since these feet stand, rad; 0 likewise."""
        return 0.0 if self._attitude is None else self._attitude.turn

    def imu_repeated(self, part: str) -> float:
        """How long a part of the IMU has repeated itself while joints moved, s."""
        return self._imu_repeated[IMU_PARTS.index(part)]


def _up(quaternion: Sequence[float]) -> tuple[float, float, float]:
    """The world's up in the body's axes, by the body's quaternion w x y z."""
    w, x, y, z = quaternion
    return 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def _legs(robot: Robot) -> Legs | None:
    """The robot's legs; None of a robot that stands on something else."""
    try:
        return robot.legs if robot.description.feet else None
    except UserError:
        return None
