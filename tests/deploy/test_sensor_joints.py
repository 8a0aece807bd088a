"""Checks of joint readings: travel by positions and by velocities, commanded and reported torques."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from sensor_readings import LIMITS, SAMPLE_US, JointReadings, Reading, measured, swing

from footfall.deploy.sensor_checks.torque import NoTorque, Opposing, ReplyRepeated, TorqueStuck
from footfall.deploy.sensor_checks.travel import Drift, Stuck, Wander
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


def test_the_drift_is_a_root_of_squares_minus_a_share(go1: Robot) -> None:
    """1 rad/s without motion count for 22 ms of the first 40 on average. A fifth of 40 mrad passes.

    The next ten readings are 40 ms later than these.
    """
    first = measured(go1, Drift, lambda _: (0.0, 1.0), samples=10)
    assert first[0] == pytest.approx(0.022 - 0.2 * 0.04)
    kept = math.exp(-0.04 / LIMITS.drift_memory_s)
    error, travel = math.sqrt(kept * 0.022**2 + 0.04**2), math.sqrt(kept * 0.04**2 + 0.04**2)
    second = measured(go1, Drift, lambda _: (0.0, 1.0), samples=20)
    assert second[0] == pytest.approx(error - 0.2 * travel)


def test_an_encoder_that_drifts_beside_its_velocity_is_noticed(go1: Robot) -> None:
    """The encoder drifts at 1 rad/s beside a swing: 0.04 rad per window, 0.022 in the first; all fades.

    The fastest, 1.24 rad/s at the first window, fades likewise: 5 ms of it are the motor's filter's, and
    half of a sample's 4 ms may go unseen.
    """
    kept = math.exp(-0.04 / LIMITS.drift_memory_s)
    fastest = 1.5 * math.cos(0.04 * 15.0) * kept**2
    wander = measured(go1, Wander, lambda t: (swing(t)[0] + t, swing(t)[1]), samples=30)
    wandered = kept**2 * 0.022 + kept * 0.04 + 0.04
    assert wander[0] == pytest.approx(wandered - 0.007 * fastest, abs=0.0005)
    assert wander[0] > LIMITS.wander_rad
    assert (wander[1:] == 0.0).all()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("late_ms", [5, 10])
def test_late_frames_of_a_fast_swing_pass(go1: Robot, late_ms: int, seed: int) -> None:
    """10 ms at 7.5 rad/s are 0.075 rad: unevenly timed frames show the possible delay."""

    def fast(time_s: float) -> tuple[float, float]:
        return 0.25 * np.sin(30.0 * time_s), 7.5 * np.cos(30.0 * time_s)

    drift, wander = measured_late(go1, fast, late_ms, seed)
    assert drift < LIMITS.drift_rad
    assert wander < LIMITS.wander_rad
    drift, _ = measured_late(go1, lambda t: (0.1, fast(t)[1]), late_ms, seed)
    assert drift > LIMITS.drift_rad


@pytest.mark.parametrize("reading", [(0.1, 0.2), (0.0, 0.0)])
def test_a_stuck_reading_is_noticed_early(go1: Robot, reading: tuple[float, float]) -> None:
    """At 0.2 rad/s the joint moves 0.0044 rad in the first window and 0.008 in others, which fade."""
    position, velocity = reading

    def read(time_s: float) -> tuple[float, float]:
        return (position if velocity else 0.2 * time_s), velocity

    stuck, wander = (measured(go1, check, read, samples=30) for check in (Stuck, Wander))
    kept = math.exp(-0.04 / LIMITS.drift_memory_s)
    error = 0.0044 * kept**2 + 0.008 * kept + 0.008
    assert stuck[0] == pytest.approx(error - 0.007 * velocity, abs=1e-4)
    assert stuck[0] > LIMITS.stuck_rad
    assert wander[0] < LIMITS.wander_rad
    assert (stuck[1:] == 0.0).all()


class TestTorqueStuck:
    """A torque that equals the previous torque while the command changes, relative to the peak torque."""

    def test_a_stuck_torque_counts_from_its_first_window_to_the_last_but_one(self, go1: Robot) -> None:
        """The command rises by the peak torque a second: 0.04 from each window to the next.

        The torque should change by 0.04, 0.08 and 0.12, of which 0.03 may be hidden each time.
        """
        added_up = [0.0, 0.0, 0.01, 0.01 + 0.05, 0.01 + 0.05 + 0.09]
        for samples, expected in zip((10, 20, 30, 40, 50), added_up, strict=True):
            share = measured(go1, TorqueStuck, torque=lambda t: (0.3, t), samples=samples)
            assert share.tolist() == pytest.approx([expected] + [0.0] * 11, abs=1e-12)
        assert added_up[-2] < LIMITS.torque_stuck < added_up[-1]

    @pytest.mark.parametrize(
        ("share", "samples"),
        [
            (lambda t: (1.0, t), [250]),  # all that the motor can give
            (lambda t: (-0.95, t), [250]),
            (lambda t: (0.02 * round(10.0 * math.sin(t)), 0.2 * math.sin(t)), range(10, 800, 50)),  # coarse
            (lambda t: (0.3, 0.3 * (t > 0.041)), [60]),  # what the command has come to
            (lambda t: (0.5 * (t > 0.424), 0.5 * (t > 0.399)), [110]),  # a leap, 25 ms late
        ],
        ids=["full", "nearly full", "coarse", "reached", "late"],
    )
    def test_a_stuck_torque_is_zero_for_a_sound_motor(
        self, go1: Robot, share: Callable[[float], tuple[float, float]], samples: Sequence[int]
    ) -> None:
        """The motor reports the commanded shares of the peak torque; frames are ten times finer."""
        assert all(measured(go1, TorqueStuck, torque=share, samples=n)[0] == 0.0 for n in samples)


@pytest.mark.parametrize(("reported", "opposing"), [(1.0, -1.0), (0.5, -0.5), (-1.0, 1.0), (-0.5, 0.5)])
def test_torque_and_command_are_compared_in_size_and_sign(
    go1: Robot, reported: float, opposing: float
) -> None:
    """Commands alternate between shares of the peak torque; a share of them is reported."""

    def torque(time_s: float) -> tuple[float, float]:
        commanded = 0.1 + 0.5 * np.sin(10.0 * time_s)
        return reported * commanded, commanded

    assert measured(go1, Opposing, torque=torque)[0] == pytest.approx(opposing, abs=0.01)


@pytest.mark.parametrize(
    ("reported", "expected", "no_torque_s"),
    [(0.01, 0.5, 0.2), (0.01, 0.045, 0.1), (0.03, 0.5, 0.0), (0.0, 0.03, 0.0)],
)
def test_the_time_of_a_limp_motor(go1: Robot, reported: float, expected: float, no_torque_s: float) -> None:
    """Torques are shares of the peak torque, for 0.2 s. Between 3 % and 6 % time counts in part."""
    found = measured(go1, NoTorque, torque=lambda _: (reported, expected), samples=50)
    assert found[0] == pytest.approx(no_torque_s, abs=1e-12)


def test_a_repeated_reply_counts_from_the_window_after_the_targets_motion(go1: Robot) -> None:
    """The joint reports no motion and no torque. Its target leaps, perhaps with a window's last tick.

    Only what the next window expects of the leap counts.
    """
    stiffness, peak = 50.0, float(go1.motor.peak_torque[0])

    def leap(time_s: float) -> float:
        return 0.12 * (time_s > 0.119)

    def torque(time_s: float) -> tuple[float, float]:
        return 0.0, stiffness * leap(time_s) / peak

    for samples, expected in ((30, 0.0), (40, 0.0), (50, 0.12)):
        more = {"samples": samples, "stiffness": stiffness, "target": leap}
        value = measured(go1, ReplyRepeated, lambda _: (0.0, 0.0), torque, **more)[0]  # type: ignore[arg-type]
        assert value == pytest.approx(expected)
