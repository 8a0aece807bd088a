"""Checks of joint readings, their torques, and their links: lost, frozen, replayed and ignored frames."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from sensor_readings import LIMITS, SAMPLE_US, JointReadings, Reading, measured, swing

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks import links
from footfall.deploy.sensor_checks.link_window import LinkSums
from footfall.deploy.sensor_checks.torque import NoTorque, Opposing, ReplyRepeated, TorqueStuck
from footfall.deploy.sensor_checks.travel import Creep, Drift, Stuck, Wander
from footfall.deploy.sensor_checks.unexplained import CommandsIgnored, Unexplained
from footfall.robots.description import Robot


def measured_late(robot: Robot, reading: Reading, late_ms: int, seed: int) -> tuple[float, float]:
    """Largest drift and wander of a joint read every 2 ms from frames in bunches, late but in order."""
    rng = np.random.default_rng(seed)
    read_us = np.arange(0, 1_000_000, 2000)
    late_us = np.repeat(rng.integers(0, 1000 * late_ms, len(read_us) // 25), 25)  # alike for 50 ms
    came_us = np.maximum.accumulate(read_us + late_us)
    result, largest = JointReadings(robot, Drift, Wander), np.zeros(2)
    for now_us in range(5 * SAMPLE_US, 1_000_000, SAMPLE_US):
        last = np.searchsorted(came_us, now_us, side="right") - 1
        joints, arrived_us = np.zeros((3, 12)), np.full(12, came_us[last])
        joints[:2, 0] = reading(read_us[last] * 1e-6)
        if now_us == 5 * SAMPLE_US:
            result.begin(now_us, arrived_us, joints)
        elif result.add(now_us, joints, arrived_us):
            largest = np.maximum(largest, result.values[:, 0])
    return float(largest[0]), float(largest[1])


KEPT = math.exp(-0.04 / LIMITS.drift_memory_s)  # of a sum, from one window to the next


def test_the_drift_is_a_root_of_squares_minus_a_share(go1: Robot) -> None:
    """1 rad/s without motion count for 22 ms of the first 40 on average, then for 40. A fifth passes."""
    error, travel = math.sqrt(KEPT * 0.022**2 + 0.04**2), math.sqrt(KEPT * 0.04**2 + 0.04**2)
    for samples, drift in ((10, 0.022 - 0.2 * 0.04), (20, error - 0.2 * travel)):
        assert measured(go1, Drift, lambda _: (0.0, 1.0), samples=samples)[0] == pytest.approx(drift)


def test_an_encoder_that_drifts_beside_its_velocity_is_noticed(go1: Robot) -> None:
    """The encoder drifts at 1 rad/s beside a swing: 0.04 rad per window, 0.022 in the first; all fades.

    The fastest, 1.24 rad/s at the first window, fades likewise: 5 ms of it are the motor's filter's, and
    half of a sample's 4 ms may go unseen.
    """
    fastest = 1.5 * math.cos(0.04 * 15.0) * KEPT**2
    wander = measured(go1, Wander, lambda t: (swing(t)[0] + t, swing(t)[1]), samples=30)
    wandered = KEPT**2 * 0.022 + KEPT * 0.04 + 0.04 - 0.007 * fastest
    assert LIMITS.wander_rad < wander[0] == pytest.approx(wandered, abs=0.0005)
    assert (wander[1:] == 0.0).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("late_ms", [5, 10])
def test_late_frames_of_a_fast_swing_pass(go1: Robot, late_ms: int, seed: int) -> None:
    """10 ms at 7.5 rad/s are 0.075 rad: unevenly timed frames show the possible delay."""

    def fast(time_s: float) -> tuple[float, float]:
        return 0.25 * np.sin(30.0 * time_s), 7.5 * np.cos(30.0 * time_s)

    drift, wander = measured_late(go1, fast, late_ms, seed)
    assert (drift < LIMITS.drift_rad, wander < LIMITS.wander_rad) == (True, True)
    assert measured_late(go1, lambda t: (0.1, fast(t)[1]), late_ms, seed)[0] > LIMITS.drift_rad


@pytest.mark.parametrize("stuck_part", ["position", "velocity"])
def test_a_stuck_reading_is_noticed_early(go1: Robot, stuck_part: str) -> None:
    """At 0.2 rad/s the joint moves 0.0044 rad in the first window and 0.008 in others, which fade."""
    velocity = 0.2 if stuck_part == "position" else 0.0
    read: Reading = lambda t: (0.1 if velocity else 0.2 * t, velocity)  # noqa: E731
    stuck, wander = (measured(go1, check, read, samples=30) for check in (Stuck, Wander))
    error = 0.0044 * KEPT**2 + 0.008 * KEPT + 0.008 - 0.007 * velocity
    assert LIMITS.stuck_rad < stuck[0] == pytest.approx(error, abs=1e-4)
    assert wander[0] < LIMITS.wander_rad
    assert (stuck[1:] == 0.0).all()


def test_an_encoder_that_drifts_slowly_is_noticed_in_seconds(go1: Robot) -> None:
    for rate in (0.02, -0.05, 0.1):
        drifting: Reading = lambda t, rate=rate: (swing(t)[0] + rate * t, swing(t)[1])  # noqa: E731
        creep = measured(go1, Creep, drifting, samples=round(0.08 / abs(rate) / 0.004))
        assert creep[0] > LIMITS.creep_rad
    assert measured(go1, Creep, samples=2000).max() < 0.5 * LIMITS.creep_rad


class TestTorques:
    """Torques relative to the peak torque."""

    def test_a_stuck_torque_counts_from_its_first_window_to_the_last_but_one(self, go1: Robot) -> None:
        """The command rises by 0.04 a window: 0.04, 0.08 and 0.12 are due; 0.03 may be hidden each time."""
        added_up = [0.0, 0.0, 0.01, 0.01 + 0.05, 0.01 + 0.05 + 0.09]
        for samples, expected in zip((10, 20, 30, 40, 50), added_up, strict=True):
            share = measured(go1, TorqueStuck, torque=lambda t: (0.3, t), samples=samples)
            assert share.tolist() == pytest.approx([expected] + [0.0] * 11, abs=1e-12)
        assert added_up[-2] < LIMITS.torque_stuck < added_up[-1]

    def test_a_stuck_torque_is_zero_for_a_sound_motor(self, go1: Robot) -> None:
        """The motor reports the commanded shares of the peak torque; frames are ten times finer."""
        rows: list[tuple[Reading, Sequence[int]]] = [
            (lambda t: (1.0, t), [250]),  # all that the motor can give
            (lambda t: (-0.95, t), [250]),
            (lambda t: (0.02 * round(10.0 * math.sin(t)), 0.2 * math.sin(t)), range(10, 800, 50)),  # coarse
            (lambda t: (0.3, 0.3 * (t > 0.041)), [60]),  # what the command has come to
            (lambda t: (0.5 * (t > 0.424), 0.5 * (t > 0.399)), [110]),  # a leap, 25 ms late
        ]
        for share, samples in rows:
            assert all(measured(go1, TorqueStuck, torque=share, samples=n)[0] == 0.0 for n in samples)

    @pytest.mark.parametrize("reported", [1.0, 0.5, -1.0, -0.5])
    def test_torque_and_command_are_compared_in_size_and_sign(self, go1: Robot, reported: float) -> None:
        """Commands alternate between shares of the peak torque; a share of them is reported."""

        def torque(time_s: float) -> tuple[float, float]:
            commanded = 0.1 + 0.5 * np.sin(10.0 * time_s)
            return reported * commanded, commanded

        assert measured(go1, Opposing, torque=torque)[0] == pytest.approx(-reported, abs=0.01)

    def test_the_time_of_a_limp_motor(self, go1: Robot) -> None:
        """For 0.2 s a torque is reported and another expected. Between 3 % and 6 % time counts in part."""
        rows = ((0.01, 0.5), 0.2), ((0.01, 0.045), 0.1), ((0.03, 0.5), 0.0), ((0.0, 0.03), 0.0)
        for torque, no_torque_s in rows:
            found_s = measured(go1, NoTorque, torque=lambda _, shares=torque: shares, samples=50)
            assert found_s[0] == pytest.approx(no_torque_s, abs=1e-12)

    def test_a_repeated_reply_counts_from_the_window_after_the_targets_motion(self, go1: Robot) -> None:
        """The target leaps, perhaps with a window's last tick: only what the next window expects counts."""
        stiffness, peak = 50.0, float(go1.motor.peak_torque[0])

        def leap(time_s: float) -> float:
            return 0.12 * (time_s > 0.119)

        def torque(time_s: float) -> tuple[float, float]:
            return 0.0, stiffness * leap(time_s) / peak

        for samples, expected in ((30, 0.0), (40, 0.0), (50, 0.12)):
            value = measured(go1, ReplyRepeated, lambda _: (0.0, 0.0), torque, samples, stiffness, leap)
            assert value[0] == pytest.approx(expected)

    def test_a_joint_is_judged_alike_whether_or_not_another_one_is_stuck(self, go1: Robot) -> None:
        """Joint 0 repeats one reading in each second group of four windows, joint 5 never or always."""
        checks, values = (Stuck, NoTorque, TorqueStuck, ReplyRepeated), []
        joints = np.random.default_rng(3).normal(size=(400, 3, 12))
        joints[np.arange(400) // 40 % 2 == 1, :, 0] = 0.1
        for _ in range(2):
            result, found = JointReadings(go1, *checks), []
            for k, each in enumerate(joints, 1):
                if result.add(k * SAMPLE_US, each, None, 5.0 * np.sin(0.1 * k), 5.0, 0.01 * k):
                    found.append(result.values[:, 0])
            values.append(found)
            joints[:, :, 5] = 0.0
        assert (np.max(values[0], axis=0) > 0.0).all()
        np.testing.assert_allclose(values[0], values[1])

    def test_a_motor_that_drops_out_intermittently_is_noticed(self, go1: Robot) -> None:
        """It has no current for a time in each 200 ms. A motor that is weak or reports late is explained."""

        def commanded(time_s: float) -> float:
            return 0.5 * float(np.sign(np.sin(15.0 * time_s)))

        unexplained = partial(measured, go1, Unexplained, swing, samples=500)
        assert unexplained(lambda t: (0.0 if t % 0.2 < 0.03 else 0.3, 0.3))[0] > LIMITS.unexplained
        assert unexplained(lambda _: (0.3, 0.3))[0] == unexplained(lambda _: (0.3, 0.6))[0] == 0.0
        assert unexplained(lambda t: (commanded(max(t - 0.04, 0.004)), commanded(t)))[0] == 0.0


class TestCommandsIgnored:
    """A joint that swings by 0.1 rad under a target that swings by 0.15 rad."""

    def share(
        self,
        go1: Robot,
        target_of_motor: Callable[[float], float],
        strength: float = 1.0,
        time_s: float = 0.6,
    ) -> float:
        """The check's value after 1.2 s of a motor that pulls to this target with 20 N m/rad."""
        limits = replace(LIMITS, commands_ignored_s=time_s)
        readings = JointReadings(go1, CommandsIgnored, limits=limits)
        sent, joints = np.zeros((5, 12)), np.zeros((3, 12))
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

    def test_an_old_command_is_noticed_and_a_late_or_weak_motor_is_not(self, go1: Robot) -> None:
        late = lambda time_s: self.target(time_s - 0.04)  # noqa: E731
        assert self.share(go1, lambda _: 0.02) > 0.95
        assert max(self.share(go1, self.target), self.share(go1, late)) < 0.1
        assert self.share(go1, late, strength=0.45) < 0.6 < LIMITS.commands_ignored

    def test_two_windows_show_no_change(self, go1: Robot) -> None:
        assert self.share(go1, lambda _: 0.02, time_s=0.01) == 0.0

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


TICKS, LOOKS = 20, 10  # in a window of 40 ms


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
        self.replies, self.older = self.replies + TICKS, self.older + older
        self.replies[3] += answers - TICKS
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


def windows_until(check: type[links.LinkCheck], measure: Callable[[], float], most: int = 40) -> int | None:
    """Number of windows until the value exceeds the limit; None if it never does."""
    limit = getattr(LIMITS, check.limit.setting)
    return next((k for k in range(1, most + 1) if measure() > limit), None)


class TestLinks:
    def test_lost_replies_are_noticed_by_their_share(self, go1: Robot) -> None:
        for lost, after in ((1, None), (2, None), (10, 15), (20, 8)):
            window = partial(Link(go1, links.Unanswered).window, TICKS - lost)
            found = windows_until(links.Unanswered, window)
            assert found is None if after is None else found <= after

    def test_a_second_host_shows_within_a_window_and_late_replies_do_not(self, go1: Robot) -> None:
        link = Link(go1, links.Answers)
        assert link.window() == 0.0
        assert windows_until(links.Answers, lambda: link.window(2 * TICKS)) == 1
        bunches = iter((TICKS // 2, 3 * TICKS // 2) * 20)
        link = Link(go1, links.Answers)
        assert windows_until(links.Answers, lambda: link.window(next(bunches))) is None

    def test_an_imu_with_gaps_is_noticed(self, go1: Robot) -> None:
        link = Link(go1, links.ImuLost)
        assert {link.window(resting=True) for _ in range(20)} == {0.0}
        assert windows_until(links.ImuLost, lambda: link.window(new=lambda update: update < 9)) is None
        assert windows_until(links.ImuLost, lambda: link.window(new=lambda update: update < 5)) is not None

    def test_a_reading_that_is_frozen_intermittently_is_noticed(self, go1: Robot) -> None:
        link = Link(go1, links.ImuFrozen)
        assert windows_until(links.ImuFrozen, link.window) is None
        frozen = lambda number: reading(number if number % 10 < 5 else number // 10 * 10 + 5)  # noqa: E731
        assert windows_until(links.ImuFrozen, lambda: link.window(imu=frozen)) is not None

    def test_samples_out_of_order_are_noticed_and_a_single_sample_is_not(self, go1: Robot) -> None:
        link = Link(go1, links.ImuOlder)
        assert windows_until(links.ImuOlder, lambda: link.window(older=1), most=1) is None
        assert windows_until(links.ImuOlder, lambda: link.window(older=10)) is not None

    def test_old_readings_are_noticed_unless_the_base_rests(self, go1: Robot) -> None:
        link = Link(go1, links.ImuReplayed)
        assert windows_until(links.ImuReplayed, link.window, most=20) is None
        assert windows_until(links.ImuReplayed, lambda: link.window(imu=lambda n: reading(n % 50)), 10)
        link = Link(go1, links.ImuReplayed)
        for still in (lambda _: reading(0), lambda number: reading(number % 2)):
            assert windows_until(links.ImuReplayed, lambda imu=still: link.window(imu=imu)) is None
