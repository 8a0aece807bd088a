"""Readings that are lost, frozen, replayed or out of order are noticed; single losses are not."""

from collections.abc import Callable

import numpy as np
import pytest
from sensor_readings import LIMITS, SAMPLE_US, JointReadings, measured, swing

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks import links
from footfall.deploy.sensor_checks.link_window import LinkSums
from footfall.deploy.sensor_checks.travel import Creep
from footfall.deploy.sensor_checks.unexplained import CommandsIgnored, Unexplained
from footfall.robots.description import Robot

TICKS = 20  # in a window of 40 ms
LOOKS = 10


class Link:
    """Twelve motors that answer each frame, and an IMU, seen through a check of readings that arrive."""

    def __init__(self, robot: Robot, check: type[links.LinkCheck]) -> None:
        self.check = check(robot, LIMITS, 0.004)
        self.sums, self.now_us = LinkSums(answering=True), 0
        self.replies, self.older = np.zeros(12, np.intp), 0
        self.latest = 0, reading(0)
        self.sums.begin(0, self.replies, 0, *self.latest)

    def window(
        self,
        answers: int = TICKS,
        imu: Callable[[int], Inertial] | None = None,
        new: Callable[[int], bool] = lambda _: True,
        older: int = 0,
        resting: bool = False,
    ) -> float:
        """The check's value after one more window, of motor 3 or of the IMU."""
        replies = self.replies + TICKS
        replies[3] += answers - TICKS
        self.replies, self.older = replies, self.older + older
        for _ in range(TICKS):
            self.sums.count_command()
        for update in range(LOOKS):
            self.now_us += 4000
            if new(update):
                number = self.now_us // 4000
                self.latest = self.now_us, reading(number) if imu is None else imu(number)
            self.sums.add(*self.latest)
        window = self.sums.close(self.now_us, self.replies, self.older, moving=True, resting=resting)
        value = np.asarray(self.check.measure(window))
        return float(value[3] if value.ndim else value)


def reading(number: int) -> Inertial:
    """A reading of the IMU that differs for each number."""
    angle = 0.001 * number
    turned = float(np.cos(angle)), float(np.sin(angle)), 0.0, 0.0
    return Inertial((angle, 0.0, 0.0), (0.0, 0.0, 9.81), turned)


def limit(check: type[links.LinkCheck]) -> float:
    return float(getattr(LIMITS, check.limit.setting))


def windows_until(
    check: type[links.LinkCheck], measure: Callable[[], float], max_windows: int = 40
) -> int | None:
    """Number of windows until the value exceeds the limit; None if it never does."""
    return next((k for k in range(1, max_windows + 1) if measure() > limit(check)), None)


class TestReplies:
    @pytest.mark.parametrize(("lost", "after"), [(1, None), (2, None), (10, 15), (20, 8)])
    def test_lost_replies_are_noticed_by_their_share(self, go1: Robot, lost: int, after: int | None) -> None:
        link = Link(go1, links.Unanswered)
        found = windows_until(links.Unanswered, lambda: link.window(TICKS - lost))
        assert (found is None) == (after is None)
        assert found is None or after is None or found <= after

    def test_a_second_host_shows_within_a_window_and_late_replies_do_not(self, go1: Robot) -> None:
        link = Link(go1, links.Answers)
        assert link.window() == 0.0
        assert link.window(2 * TICKS) > limit(links.Answers)
        link = Link(go1, links.Answers)
        for answers in (TICKS // 2, 3 * TICKS // 2) * 20:
            assert link.window(answers) <= limit(links.Answers)


class TestImu:
    def test_an_imu_with_gaps_is_noticed(self, go1: Robot) -> None:
        link = Link(go1, links.ImuLost)
        for _ in range(20):
            assert link.window(resting=True) == 0.0
        assert windows_until(links.ImuLost, lambda: link.window(new=lambda update: update < 9)) is None
        assert windows_until(links.ImuLost, lambda: link.window(new=lambda update: update < 5)) is not None

    def test_a_reading_that_is_frozen_intermittently_is_noticed(self, go1: Robot) -> None:
        link = Link(go1, links.ImuFrozen)
        assert windows_until(links.ImuFrozen, link.window) is None
        frozen = lambda number: reading(number if number % 10 < 5 else number // 10 * 10 + 5)  # noqa: E731
        assert windows_until(links.ImuFrozen, lambda: link.window(imu=frozen)) is not None

    def test_samples_out_of_order_are_noticed_and_a_single_sample_is_not(self, go1: Robot) -> None:
        link = Link(go1, links.ImuOlder)
        assert link.window(older=1) <= limit(links.ImuOlder)
        assert windows_until(links.ImuOlder, lambda: link.window(older=10)) is not None

    def test_old_readings_are_noticed_unless_the_base_rests(self, go1: Robot) -> None:
        link = Link(go1, links.ImuReplayed)
        assert windows_until(links.ImuReplayed, link.window, max_windows=20) is None
        assert windows_until(links.ImuReplayed, lambda: link.window(imu=lambda n: reading(n % 50)), 10)
        link = Link(go1, links.ImuReplayed)
        for still in (lambda _: reading(0), lambda number: reading(number % 2)):
            assert windows_until(links.ImuReplayed, lambda imu=still: link.window(imu=imu)) is None


class TestSlow:
    @pytest.mark.parametrize("rate", [0.02, -0.05, 0.1])
    def test_an_encoder_that_drifts_slowly_is_noticed_in_seconds(self, go1: Robot, rate: float) -> None:
        def drifting(time_s: float) -> tuple[float, float]:
            angle = 15.0 * time_s
            return 0.1 * np.sin(angle) + rate * time_s, 1.5 * np.cos(angle)

        samples = round(0.08 / abs(rate) / 0.004)
        assert measured(go1, Creep, drifting, samples=samples)[0] > LIMITS.creep_rad
        assert measured(go1, Creep, samples=2000).max() < 0.5 * LIMITS.creep_rad


class TestUnexplained:
    def drops_out(self, go1: Robot, faulty_s: float) -> float:
        """Unexplained torque of a motor that has no current for `faulty_s` in each 200 ms."""
        torque = lambda t: (0.0 if t % 0.2 < faulty_s else 0.3, 0.3)  # noqa: E731
        return float(measured(go1, Unexplained, torque=torque, samples=500)[0])

    def test_a_motor_that_drops_out_intermittently_is_noticed(self, go1: Robot) -> None:
        assert self.drops_out(go1, 0.03) > LIMITS.unexplained
        assert self.drops_out(go1, 0.0) == 0.0

    def test_motors_that_are_weak_or_report_late_are_explained(self, go1: Robot) -> None:
        assert measured(go1, Unexplained, torque=lambda _: (0.3, 0.6), samples=500)[0] == 0.0
        commanded = lambda t: 0.5 * np.sign(np.sin(15.0 * t))  # noqa: E731
        torque = lambda t: (float(commanded(max(t - 0.04, 0.004))), float(commanded(t)))  # noqa: E731
        assert measured(go1, Unexplained, torque=torque, samples=500)[0] == 0.0


class TestCommandsIgnored:
    """A joint that swings by 0.1 rad under a target that swings by 0.15 rad."""

    def share(self, go1: Robot, target_of_motor: Callable[[float], float], strength: float = 1.0) -> float:
        """The check's value after 1.2 s of a motor that pulls to this target with 20 N m/rad."""
        readings, sent, joints = JointReadings(go1, CommandsIgnored), np.zeros((5, 12)), np.zeros((3, 12))
        sent[2], sent[3] = 20.0, 0.5
        readings.begin(0, np.zeros(12, np.int64), joints)
        for k in range(1, 301):
            time_s = k * SAMPLE_US * 1e-6
            position, velocity = swing(time_s)
            sent[0, 0] = self.target(time_s)
            torque = strength * (20.0 * (target_of_motor(time_s) - position) - 0.5 * velocity)
            joints = joints.copy()
            joints[:, 0] = position, velocity, torque
            readings.add(k * SAMPLE_US, joints, sent=sent.copy())
        return float(readings.values[0, 0])

    @staticmethod
    def target(time_s: float) -> float:
        return 1.5 * swing(time_s + 0.05)[0]

    def test_a_motor_that_obeys_an_old_command_is_noticed(self, go1: Robot) -> None:
        assert self.share(go1, lambda _: 0.02) > 0.95

    def test_a_motor_that_is_late_or_weak_obeys(self, go1: Robot) -> None:
        late = lambda time_s: self.target(time_s - 0.04)  # noqa: E731
        assert self.share(go1, self.target) < 0.1
        assert self.share(go1, late) < 0.1
        assert self.share(go1, late, strength=0.45) < 0.6 < LIMITS.commands_ignored

    def test_noise_of_a_still_joint_is_no_command(self, go1: Robot) -> None:
        """The controller holds the joint stiffly, and then only damps it."""
        readings, sent, rng = JointReadings(go1, CommandsIgnored), np.zeros((5, 12)), np.random.default_rng(0)
        readings.begin(0, np.zeros(12, np.int64), np.zeros((3, 12)))
        values = []
        for k in range(1, 301):
            sent[2], sent[3] = (200.0, 4.0) if k < 200 else (0.0, 0.5)
            joints = np.vstack((rng.normal(0.0, [[0.004], [0.4]], (2, 12)), np.zeros((1, 12))))
            readings.add(k * SAMPLE_US, joints, sent=sent.copy())
            values.append(readings.values.max())
        assert max(values) < 0.5 < LIMITS.commands_ignored
