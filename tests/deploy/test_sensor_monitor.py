"""What adds up of readings: ways by positions and by velocities, torques that were asked for and reported."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_limits import SensorLimits
from footfall.deploy.sensor_monitor import SensorMonitor, _up
from footfall.plant.ground_truth import COLLAPSED_SHARE
from footfall.robots.description import Robot, available_robots, load_robot

LIMITS = SensorLimits()
STILL = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))
SAMPLE_US = 4000
SWING_RAD, SWING_RAD_S = 0.1, 15.0  # of a leg: 2.4 swings a second

Reading = Callable[[float], tuple[float, float]]  # s to rad and rad/s


def swing(time_s: float) -> tuple[float, float]:
    angle = SWING_RAD_S * time_s
    return SWING_RAD * np.sin(angle), SWING_RAD * SWING_RAD_S * np.cos(angle)


def lying(robot: Robot) -> np.ndarray:
    """Legs folded, joint positions in rad: lying, or of a biped a squat at the end of its knees."""
    if robot.lying_pose is not None:
        return robot.lying_pose
    squat = {"hip_pitch": -1.9, "knee": 2.8, "ankle_pitch": -0.9}
    folded = robot.default_pose.copy()
    for joint, name in enumerate(robot.joint_names):
        folded[joint] = next((rad for part, rad in squat.items() if part in name), folded[joint])
    return folded


def told(
    robot: Robot,
    reading: Reading = swing,
    torque: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0),
    lost: Callable[[int], bool] = lambda _: False,
    samples: int = 250,
    stiffness: float = 0.0,
    target: Callable[[float], float] = lambda _: 0.0,
) -> SensorMonitor:
    """A monitor of which one joint moves; `torque` gives what it reports and what is expected, N m.

    A sample whose number is `lost` leaves the reading, and the time at which it arrived, as they were.
    """
    monitor = SensorMonitor(robot, LIMITS, 0.002)
    n, heard_us = len(robot.joint_names), np.zeros(12, np.int64)
    joints, zeros = np.zeros((3, n)), np.zeros(n)
    joints[:2, 0] = reading(0.0)
    monitor.begin(0, heard_us, STILL, joints, zeros)
    for k in range(1, samples + 1):
        now_us = k * SAMPLE_US
        expected = zeros.copy()
        if not lost(k):
            joints, heard_us = joints.copy(), np.full(n, now_us)
            joints[:2, 0] = reading(now_us * 1e-6)
            joints[2, 0], expected[0] = torque(now_us * 1e-6)
        if monitor.add(now_us, 0, heard_us, STILL, joints, expected):
            monitor.look(zeros + stiffness, zeros + target(now_us * 1e-6), zeros, zeros)
    return monitor


def told_late(robot: Robot, reading: Reading, late_ms: int, seed: int) -> tuple[float, float]:
    """Most drift and wander of a joint that is read every 2 ms, by frames in bunches, late but in order."""
    rng = np.random.default_rng(seed)
    read_us = np.arange(0, 1_000_000, 2000)
    late_us = np.repeat(rng.integers(0, 1000 * late_ms, len(read_us) // 25), 25)  # alike for 50 ms
    came_us = np.maximum.accumulate(read_us + late_us)
    monitor, zeros = SensorMonitor(robot, LIMITS, 0.002), np.zeros(12)
    most = np.zeros(2)
    for now_us in range(5 * SAMPLE_US, 1_000_000, SAMPLE_US):
        last = np.searchsorted(came_us, now_us, side="right") - 1
        joints, heard_us = np.zeros((3, 12)), np.full(12, came_us[last])
        joints[:2, 0] = reading(read_us[last] * 1e-6)
        if now_us == 5 * SAMPLE_US:
            monitor.begin(now_us, heard_us, STILL, joints, zeros)
        elif monitor.add(now_us, 0, heard_us, STILL, joints, zeros):
            monitor.look(zeros, zeros, zeros, zeros)
            most = np.maximum(most, [monitor.drift[0], monitor.wander[0]])
    return float(most[0]), float(most[1])


class TestWays:
    """A position against a velocity."""

    def test_of_a_joint_that_swings_agree(self, go1: Robot) -> None:
        assert told(go1).drift.max() <= 0.0

    def test_of_a_joint_that_speeds_up_agree(self, go1: Robot) -> None:
        """25 rad/s^2 for 40 ms make 0.02 rad, and an even change is added up without error."""
        monitor = told(go1, lambda t: (12.5 * t * t, 25.0 * t), samples=10)
        assert monitor.drift[0] == pytest.approx(-0.2 * 0.02, abs=1e-6)

    @pytest.mark.parametrize("factor", [-1.0, 0.0, 0.5, 2.0])
    def test_differ_where_a_velocity_has_another_sign_or_unit(self, go1: Robot, factor: float) -> None:
        """To and fro does not cancel out: within half a second, and of this joint alone."""
        monitor = told(go1, lambda t: (swing(t)[0], factor * swing(t)[1]), samples=125)
        assert monitor.drift[0] > LIMITS.drift_rad
        assert (monitor.drift[1:] == 0.0).all()

    def test_differ_where_a_position_stays(self, go1: Robot) -> None:
        assert told(go1, lambda t: (0.1, swing(t)[1])).drift[0] > LIMITS.drift_rad

    def test_by_how_much_is_a_root_of_squares_less_a_share(self, go1: Robot) -> None:
        """1 rad/s while nothing moves: on average 22 ms of the first 40. A fifth of 40 mrad is granted.

        The next ten readings are 40 ms later than these.
        """
        assert told(go1, lambda _: (0.0, 1.0), samples=10).drift[0] == pytest.approx(0.022 - 0.2 * 0.04)
        kept = math.exp(-0.04 / LIMITS.drift_memory_s)
        apart, way = math.sqrt(kept * 0.022**2 + 0.04**2), math.sqrt(kept * 0.04**2 + 0.04**2)
        assert told(go1, lambda _: (0.0, 1.0), samples=20).drift[0] == pytest.approx(apart - 0.2 * way)

    def test_wander_apart_with_their_signs_where_an_encoder_drifts(self, go1: Robot) -> None:
        """1 rad/s beside a swing: 0.04 rad a look, 0.022 the first as above, and all of it fades.

        Of the fastest, 1.24 rad/s at the first look, which fade likewise, 5 ms are the motor's filter's, and
        half of a sample's 4 ms may go unseen.
        """
        kept = math.exp(-0.04 / LIMITS.drift_memory_s)
        fastest = SWING_RAD * SWING_RAD_S * math.cos(0.04 * SWING_RAD_S) * kept**2
        drifting = told(go1, lambda t: (swing(t)[0] + t, swing(t)[1]), samples=30)
        wandered = kept**2 * 0.022 + kept * 0.04 + 0.04
        assert drifting.wander[0] == pytest.approx(wandered - 0.007 * fastest, abs=0.0005)
        assert drifting.wander[0] > LIMITS.wander_rad
        assert (drifting.wander[1:] == 0.0).all()

    def test_do_not_wander_where_the_velocity_lags_or_is_noisy(self, go1: Robot) -> None:
        rng = np.random.default_rng(0)

        def noisy(time_s: float) -> tuple[float, float]:
            position, velocity = swing(time_s)[0], swing(time_s - LIMITS.filter_s)[1]
            return position + rng.uniform(-0.002, 0.002), velocity + rng.uniform(-0.1, 0.1)

        assert told(go1, noisy).wander.max() < 0.3 * LIMITS.wander_rad

    @pytest.mark.parametrize("seed", range(4))
    @pytest.mark.parametrize("late_ms", [5, 10])
    def test_may_differ_by_what_late_frames_make_of_a_fast_swing(
        self, go1: Robot, late_ms: int, seed: int
    ) -> None:
        """10 ms at 7.5 rad/s are 0.075 rad: frames that come unevenly tell how late they may be."""

        def fast(time_s: float) -> tuple[float, float]:
            return 0.25 * np.sin(30.0 * time_s), 7.5 * np.cos(30.0 * time_s)

        drift, wander = told_late(go1, fast, late_ms, seed)
        assert drift < LIMITS.drift_rad
        assert wander < LIMITS.wander_rad
        drift, _ = told_late(go1, lambda t: (0.1, fast(t)[1]), late_ms, seed)
        assert drift > LIMITS.drift_rad

    def test_may_differ_by_what_a_robot_whose_time_stalls_makes_of_a_steady_motion(self, go1: Robot) -> None:
        """At 1 rad/s; of each 100 ms it does not live through 20, nor answers, as one in emulation."""
        monitor, zeros, wander = SensorMonitor(go1, LIMITS, 0.002), np.zeros(12), []
        joints, heard_us, lived_s = np.zeros((3, 12)), np.zeros(12, np.int64), 0.0
        monitor.begin(0, heard_us, STILL, joints, zeros)
        for now_us in range(SAMPLE_US, 1_000_000, SAMPLE_US):
            if now_us % 100_000 >= 20_000:
                lived_s += SAMPLE_US * 1e-6
                joints, heard_us = np.array([zeros + lived_s, zeros + 1.0, zeros]), np.full(12, now_us)
            if monitor.add(now_us, 0, heard_us, STILL, joints, zeros):
                monitor.look(zeros, zeros, zeros, zeros)
                wander.append(monitor.wander[0])
        assert max(wander) < 0.5 * LIMITS.wander_rad

    def test_bear_noise_of_a_hundredth_of_a_radian(self, go1: Robot) -> None:
        rng = np.random.default_rng(0)

        def noisy(time_s: float) -> tuple[float, float]:
            return rng.uniform(-0.01, 0.01), rng.uniform(-0.5, 0.5)

        assert told(go1, noisy, samples=500).drift[0] < 0.7 * LIMITS.drift_rad

    @pytest.mark.parametrize(("lag_s", "noticed"), [(0.005, False), (0.05, True)])
    def test_a_velocity_may_lag_as_a_filtered_one_does(self, go1: Robot, lag_s: float, noticed: bool) -> None:
        monitor = told(go1, lambda t: (swing(t)[0], swing(t - lag_s)[1]))
        assert (monitor.drift[0] > LIMITS.drift_rad) == noticed

    def test_are_those_between_the_readings_that_came(self, go1: Robot) -> None:
        """Every second reply is lost, two more in a row now and then."""
        monitor = told(go1, lost=lambda k: k % 2 == 1 or k % 14 < 4)
        assert monitor.drift[0] < 0.5 * LIMITS.drift_rad


class TestStuckWays:
    """A position or a velocity that is to the last digit the one before, where the other one moves."""

    @pytest.mark.parametrize("reading", [(0.1, 0.2), (0.0, 0.0)])
    def test_add_up_from_less_than_others(self, go1: Robot, reading: tuple[float, float]) -> None:
        """0.2 rad/s: 0.0044 rad in the first window, 0.008 in others, which fade; 7 ms of it are granted."""
        position, velocity = reading
        stuck = told(go1, lambda t: (position if velocity else 0.2 * t, velocity), samples=30)
        kept = math.exp(-0.04 / LIMITS.drift_memory_s)
        way = 0.0044 * kept**2 + 0.008 * kept + 0.008
        assert stuck.stuck[0] == pytest.approx(way - 0.007 * velocity, abs=1e-4)
        assert stuck.stuck[0] > LIMITS.stuck_rad
        assert stuck.wander[0] < LIMITS.wander_rad
        assert (stuck.stuck[1:] == 0.0).all()

    def test_begin_anew_where_both_move(self, go1: Robot) -> None:
        """One of ten readings is another one: a velocity that is 0.2 rad/s too high is no stuck one."""

        def alive(time_s: float) -> tuple[float, float]:
            other = 1e-4 * (round(time_s / 0.004) % 10 == 5)
            return 0.1 + other, 0.2 + other

        shaken = told(go1, alive)
        assert shaken.stuck[0] < 0.0
        assert shaken.wander[0] > LIMITS.wander_rad

    def test_of_a_joint_that_creeps_are_within_what_a_velocitys_rounding_hides(self, go1: Robot) -> None:
        """Half of a quantum of 12 bits over 30 rad/s to either side."""
        assert told(go1, lambda t: (0.007 * t, 0.0), samples=1000).stuck[0] < 0.5 * LIMITS.stuck_rad


class TestStuckTorques:
    """A torque that is to the last digit the one before, while what is asked moves. Of the peak torque."""

    def stuck(self, robot: Robot, reported: float, samples: int, stiffness: float = 0.0) -> float:
        """What is asked rises by the peak torque a second: 0.04 from each look to the next."""
        peak = float(robot.motor.peak_torque[0])
        monitor = told(
            robot, torque=lambda t: (reported * peak, t * peak), samples=samples, stiffness=stiffness
        )
        assert (monitor.torque_stuck[1:] == 0.0).all()
        return float(monitor.torque_stuck[0])

    def test_counts_from_the_window_in_which_it_began_to_the_one_before_the_last(self, go1: Robot) -> None:
        """By 0.04, 0.08 and 0.12, of which 0.03 may be hidden each time."""
        assert [self.stuck(go1, 0.3, samples) for samples in (10, 20)] == [0.0, 0.0]
        added_up = [0.01, 0.01 + 0.05, 0.01 + 0.05 + 0.09]
        assert [self.stuck(go1, 0.3, samples) for samples in (30, 40, 50)] == pytest.approx(added_up)
        assert added_up[1] < LIMITS.torque_stuck < added_up[2]

    def test_is_less_by_what_stiffness_makes_of_a_readings_noise(self, go1: Robot) -> None:
        """2 mrad at 500 N m/rad are 1 N m, of 23.7."""
        noise = 1.0 / 23.7
        expected = (0.08 - 0.03 - noise) + (0.12 - 0.03 - noise)
        assert self.stuck(go1, 0.3, 50, stiffness=500.0) == pytest.approx(expected, abs=1e-4)

    def test_may_be_all_that_a_motor_can_give(self, go1: Robot) -> None:
        assert self.stuck(go1, 1.0, 250) == 0.0
        assert self.stuck(go1, -0.95, 250) == 0.0

    def test_may_be_rounded_to_a_fiftieth_of_the_peak(self, go1: Robot) -> None:
        """Which is ten times what frames of 12 bits do."""
        peak = float(go1.motor.peak_torque[0])

        def coarse(time_s: float) -> tuple[float, float]:
            asked = 0.2 * math.sin(1.0 * time_s)
            return 0.02 * round(asked / 0.02) * peak, asked * peak

        assert all(told(go1, torque=coarse, samples=n).torque_stuck[0] == 0.0 for n in range(10, 800, 50))

    def test_may_be_late(self, go1: Robot) -> None:
        """A leap by half the peak torque just before a look, which a motor follows 25 ms later."""
        peak = float(go1.motor.peak_torque[0])

        def late(time_s: float) -> tuple[float, float]:
            return 0.5 * peak * (time_s > 0.424), 0.5 * peak * (time_s > 0.399)

        assert told(go1, torque=late, samples=110).torque_stuck[0] == 0.0


class TestTorques:
    """What a motor reports against what is asked of it."""

    def asked(self, robot: Robot, reported: float, lag_s: float = 0.0) -> SensorMonitor:
        """A tenth of the peak torque and a half, to and fro, of which a share is reported, later."""
        peak = float(robot.motor.peak_torque[0])

        def wave(time_s: float) -> float:
            return peak * (0.1 + 0.5 * np.sin(10.0 * time_s))

        return told(robot, torque=lambda t: (reported * wave(t - lag_s), wave(t)))

    @pytest.mark.parametrize(("reported", "opposing"), [(1.0, -1.0), (0.5, -0.5), (-1.0, 1.0), (-0.5, 0.5)])
    def test_are_compared_over_time_in_size_and_sign(
        self, go1: Robot, reported: float, opposing: float
    ) -> None:
        assert self.asked(go1, reported).opposing[0] == pytest.approx(opposing, abs=0.01)

    def test_may_lag(self, go1: Robot) -> None:
        """A radian is 100 ms here: half of that later it is not yet the other way."""
        assert self.asked(go1, 1.0, lag_s=0.05).opposing[0] < 0.0

    def test_may_lag_behind_a_target_that_runs_away(self, go1: Robot) -> None:
        """A stiff joint bears a tenth of its peak torque, which rounding hides, on a motor 25 ms late."""
        stiffness, load = 200.0, 0.1 * float(go1.motor.peak_torque[0])

        def target(time_s: float) -> float:
            return -max(time_s - 0.4, 0.0)

        def torque(time_s: float) -> tuple[float, float]:
            return load + stiffness * target(time_s - 0.025), stiffness * target(time_s)

        late = told(go1, lambda _: (0.0, 0.0), torque, samples=112, stiffness=stiffness, target=target)
        assert late.opposing[0] < 0.5 * LIMITS.opposing

    def test_of_a_joint_that_keeps_still_count_but_for_what_a_readings_rounding_makes(
        self, go1: Robot
    ) -> None:
        """A fifth of the peak the other way; 100 N m/rad make 0.2 N m of 0.002 rad, which nobody expects."""
        fifth = 0.2 * float(go1.motor.peak_torque[0])
        found = told(go1, lambda _: (0.0, 0.0), lambda _: (-fifth, fifth), stiffness=100.0)
        assert found.opposing[0] == pytest.approx(fifth / (fifth - 0.2))

    def test_of_a_motor_that_is_asked_for_little_do_not_count(self, go1: Robot) -> None:
        """1 % of the peak torque against the 5 % from which on a direction counts: 0.01^2 / 0.05^2."""
        little = 0.01 * float(go1.motor.peak_torque[0])
        assert told(go1, torque=lambda _: (-little, little)).opposing[0] == pytest.approx(0.04, rel=0.05)

    def test_a_motor_without_any_is_limp_as_long_as_much_is_asked(self, go1: Robot) -> None:
        peak = float(go1.motor.peak_torque[0])
        limp = told(go1, torque=lambda _: (0.01 * peak, 0.5 * peak), samples=50)
        assert limp.limp_s[0] == pytest.approx(0.2)
        half = told(go1, torque=lambda _: (0.01 * peak, 0.045 * peak), samples=50)  # between 3 and 6 %
        assert half.limp_s[0] == pytest.approx(0.1)
        assert told(go1, torque=lambda _: (0.03 * peak, 0.5 * peak)).limp_s[0] == 0.0
        hidden = told(go1, torque=lambda _: (0.0, 0.03 * peak), samples=50)
        assert hidden.limp_s[0] == pytest.approx(0.0, abs=1e-12)
        with pytest.raises(UserError, match="must be below torque_much"):
            SensorLimits(torque_hidden=0.1, torque_much=0.1)

    def test_of_a_stiff_joint_count_beyond_what_a_readings_rounding_makes(self, go1: Robot) -> None:
        """2 mrad at a stiffness of 1500 N m/rad are 3 N m; a hundredth of the peak torque is 0.24."""
        peak = float(go1.motor.peak_torque[0])
        rounding, still = 1500.0 * LIMITS.reading_rad, lambda _: (0.0, 0.0)

        def limp_s(expected: float) -> float:
            monitor = told(go1, still, lambda _: (0.0, expected), samples=50, stiffness=1500.0)
            return float(monitor.limp_s[0])

        assert limp_s(rounding + 0.03 * peak) == pytest.approx(0.0, abs=1e-12)
        assert limp_s(rounding + 0.06 * peak) == pytest.approx(0.2)

    def test_a_report_in_between_sets_a_limp_motors_time_back(self, go1: Robot) -> None:
        """One of ten samples of each look."""
        peak = float(go1.motor.peak_torque[0])
        spikes = told(go1, torque=lambda t: (0.15 * peak * (round(t / 0.004) % 10 == 5), 0.5 * peak))
        assert spikes.limp_s[0] == 0.0


class TestHeight:
    """How much of the base's clearance is gone: by the legs, the IMU, and the lowest corner of the base."""

    def test_a_level_robot_that_stands_has_all_of_it(self, go1: Robot) -> None:
        monitor = SensorMonitor(go1, LIMITS, 0.002)
        assert monitor.sunk_share(go1.default_pose, (1.0, 0.0, 0.0, 0.0)) == pytest.approx(0.0, abs=1e-3)

    def test_the_corner_that_a_tilt_brings_down_counts(self, go1: Robot) -> None:
        """Nose down by 0.5 rad: front feet 0.188 m ahead and 0.271 m below, a trunk of half 0.13 by 0.05 m.

        The origin is 0.188 sin 0.5 + 0.271 cos 0.5 + 0.023 = 0.351 m over the lowest foot, and the corner
        0.13 sin 0.5 + 0.05 cos 0.5 = 0.106 m below it: the clearance is 0.245 m, that of a level robot.
        """
        monitor = SensorMonitor(go1, LIMITS, 0.002)
        nose_down = (math.cos(0.25), 0.0, math.sin(0.25), 0.0)
        assert monitor.sunk_share(go1.default_pose, nose_down) == pytest.approx(0.0, abs=0.01)

    @pytest.mark.parametrize("name", available_robots())
    def test_a_level_robot_has_sunk_to_its_supervisor_before_a_simulator_calls_it_fallen(
        self, name: str
    ) -> None:
        """Else a run could end in an orderly way after a fall that nobody on the robot noticed."""
        robot = load_robot(name)
        folded = lying(robot)

        def above_feet(share: float) -> float:
            """Height of the base above its lowest foot, as the simulator measures it."""
            pose = robot.default_pose + share * (folded - robot.default_pose)
            return -float(robot.legs.pose(pose).foot[:, 2].min())

        least = COLLAPSED_SHARE * robot.description.standing_height_m
        share = next(s for s in np.linspace(0.0, 1.0, 1001) if above_feet(s) < least)
        pose = robot.default_pose + share * (folded - robot.default_pose)
        sunk = SensorMonitor(robot, LIMITS, 0.002).sunk_share(pose, (1.0, 0.0, 0.0, 0.0))
        assert sunk > deploy_config(robot).safety.sensors.sunk


class TestRepeated:
    """A reading that stays while its target moves."""

    def look(self, monitor: SensorMonitor, look: int, target: np.ndarray) -> float:
        """One look at a robot that does not move; how far targets have moved by it, rad."""
        zeros, every = np.zeros(12), round(LIMITS.period_s / 0.004)
        for k in range(look * every, (look + 1) * every):
            now_us = (k + 1) * SAMPLE_US
            monitor.add(now_us, 0, np.full(12, now_us), STILL, np.zeros((3, 12)), zeros)
        monitor.look(zeros, target, zeros, zeros)
        return float(monitor.repeated[0])

    def test_counts_from_the_look_after_the_one_in_which_the_target_moved(self, go1: Robot) -> None:
        """A leap may go out at the tick of a look: its answer cannot be there yet."""
        monitor = SensorMonitor(go1, LIMITS, 0.002)
        monitor.begin(0, np.zeros(12, np.int64), STILL, np.zeros((3, 12)), np.zeros(12))
        leapt = np.full(12, 0.12)
        assert self.look(monitor, 0, leapt) == 0.0
        assert self.look(monitor, 1, leapt) == pytest.approx(0.12)

    @pytest.mark.parametrize("part", [0, 1, 2])
    def test_a_reading_of_which_one_part_changes_is_not_repeated(self, go1: Robot, part: int) -> None:
        """Position, velocity or torque, once in a window."""
        monitor, zeros = SensorMonitor(go1, LIMITS, 0.002), np.zeros(12)
        monitor.begin(0, np.zeros(12, np.int64), STILL, np.zeros((3, 12)), zeros)
        for k in range(1, 21):
            joints = np.zeros((3, 12))
            joints[part, 0] = 0.01 * (k >= 15)
            if monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), STILL, joints, zeros):
                monitor.look(zeros, zeros + 0.12, zeros, zeros)
        np.testing.assert_allclose(monitor.repeated, np.where(np.arange(12) == 0, 0.0, 0.12))


class TestBody:
    """What is said of the body is looked at once, a tick after the joints, whatever has come since."""

    def test_a_look_leaves_it_as_it_was(self, go1: Robot) -> None:
        """A turn of 0.1 rad about z that no gyro reports, then a window without one."""
        monitor, zeros = SensorMonitor(go1, LIMITS, 0.002), np.zeros(12)
        joints = np.array([go1.default_pose, zeros, zeros])
        turned = STILL._replace(quaternion=(math.cos(0.05), 0.0, 0.0, math.sin(0.05)))
        monitor.begin(0, np.zeros(12, np.int64), STILL, joints, zeros)
        for k in range(1, 11):
            looks = monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), turned, joints, zeros)
        assert looks
        assert not monitor.look_at_body()
        assert monitor.look(zeros, zeros, zeros, zeros)
        assert monitor.rotation == [0.0, 0.0, 0.0]
        monitor.add(11 * SAMPLE_US, 0, np.full(12, 11 * SAMPLE_US), STILL, joints, zeros)
        assert monitor.look_at_body()
        assert monitor.rotation == pytest.approx([0.0, 0.0, 0.1], abs=1e-4)
        assert not monitor.look_at_body()

    def repeated(self, robot: Robot, reading: Callable[[int], Inertial]) -> dict[str, float]:
        """How long each part has repeated itself after two looks at joints that move at 1 rad/s."""
        monitor, zeros = SensorMonitor(robot, LIMITS, 0.002), np.zeros(12)
        joints = np.array([robot.default_pose, zeros + 1.0, zeros])
        monitor.begin(0, np.zeros(12, np.int64), reading(0), joints, zeros)
        for k in range(1, 21):
            if monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), reading(k), joints, zeros):
                monitor.look(zeros, zeros, zeros, zeros)
                monitor.look_at_body()
        return {part: monitor.imu_repeated(part) for part in Inertial._fields}

    @staticmethod
    def turning(k: int) -> Inertial:
        """About z at 0.1 rad/s, 0.004 rad in a window, by the quaternion alone."""
        half = 0.5 * 0.1 * k * 0.004
        return STILL._replace(quaternion=(math.cos(half), 0.0, 0.0, math.sin(half)))

    def test_an_acceleration_repeats_itself_half_where_the_body_does_not_turn(self, go1: Robot) -> None:
        """One of ten readings that differs is of a part that is alive."""
        assert self.repeated(go1, self.turning)["acceleration"] == pytest.approx(0.08)
        assert self.repeated(go1, lambda _: STILL)["acceleration"] == pytest.approx(0.04)
        shaken = STILL._replace(acceleration=(0.0, 0.0, 9.815))
        assert self.repeated(go1, lambda k: shaken if k % 10 == 5 else STILL)["acceleration"] == 0.0

    def test_gyro_and_quaternion_repeat_themselves_where_they_turn_apart(self, go1: Robot) -> None:
        still = self.repeated(go1, lambda _: STILL)
        assert (still["gyro"], still["quaternion"]) == (0.0, 0.0)
        steady = self.repeated(go1, lambda k: self.turning(k)._replace(gyro=(0.0, 0.0, 0.1)))
        assert steady["gyro"] == 0.0
        assert self.repeated(go1, self.turning)["gyro"] == pytest.approx(0.08)
        stuck = self.repeated(go1, lambda k: STILL._replace(gyro=(0.0, 0.1 + 0.001 * (k % 2), 0.0)))
        assert stuck["quaternion"] == pytest.approx(0.08)

    def test_nothing_is_left_of_a_window_with_a_gap(self, go1: Robot) -> None:
        monitor, zeros = SensorMonitor(go1, LIMITS, 0.002), np.zeros(12)
        joints = np.array([go1.default_pose, zeros, zeros])
        monitor.begin(0, np.zeros(12, np.int64), STILL, joints, zeros)
        for k in range(1, 11):
            silence_us = 50_000 if k == 5 else 0
            monitor.add(k * SAMPLE_US, silence_us, np.full(12, k * SAMPLE_US), STILL, joints, zeros)
        assert not monitor.look(zeros, zeros, zeros, zeros)
        assert not monitor.look_at_body()


ATTITUDES = Rotation.random(3, random_state=2).as_quat(scalar_first=True).tolist()
BY_EACH_NUMBER = [[0.96 if number == most else 0.16 for number in range(4)] for most in range(4)]
HALF_A_TURN = [0.0, 0.6, 0.8, 0.0]


class TestInertial:
    """What is said of the body's turn and of gravity, against scipy's rotations."""

    def begun(self, robot: Robot, quaternion: Sequence[float]) -> SensorMonitor:
        monitor, zeros = SensorMonitor(robot, LIMITS, 0.002), np.zeros(12)
        first = STILL._replace(quaternion=tuple(quaternion))
        monitor.begin(0, np.zeros(12, np.int64), first, np.array([robot.default_pose, zeros, zeros]), zeros)
        return monitor

    def look(self, monitor: SensorMonitor, look: int, reading: Inertial, speed_rad_s: float = 0.0) -> None:
        """One window of ten readings that are all the same, of joints at a speed."""
        zeros = np.zeros(12)
        joints = np.array([zeros, zeros + speed_rad_s, zeros])
        for k in range(10 * look + 1, 10 * look + 11):
            monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), reading, joints, zeros)
        assert monitor.look(zeros, zeros, zeros, zeros)
        assert monitor.look_at_body()

    @pytest.mark.parametrize("quaternion", [*ATTITUDES, *BY_EACH_NUMBER, HALF_A_TURN])
    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_a_turn_is_that_of_the_quaternion_in_the_bodys_axes_less_the_gyros(
        self, go1: Robot, quaternion: list[float], sign: float
    ) -> None:
        """In 40 ms; the difference adds up and fades over 0.25 s. A quaternion's negative is the same."""
        before, turn = Rotation.from_quat(quaternion, scalar_first=True), np.array([0.02, -0.05, 0.03])
        gyro = np.array([0.4, 0.2, -0.3])
        after = sign * (before * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)
        monitor = self.begun(go1, before.as_quat(scalar_first=True))
        reading = Inertial(tuple(gyro), (0.0, 0.0, 9.81), tuple(after))
        self.look(monitor, 0, reading)
        np.testing.assert_allclose(monitor.rotation, turn - 0.04 * gyro, atol=3e-5)
        self.look(monitor, 1, reading)
        kept = math.exp(-0.04 / 0.25)
        np.testing.assert_allclose(monitor.rotation, kept * turn - (1 + kept) * 0.04 * gyro, atol=5e-5)

    @pytest.mark.parametrize("quaternion", ATTITUDES)
    def test_what_is_up_is_turned_into_the_bodys_axes(self, quaternion: list[float]) -> None:
        turn = Rotation.from_quat(quaternion, scalar_first=True)
        np.testing.assert_allclose(_up(quaternion), turn.inv().apply([0.0, 0.0, 1.0]))

    @pytest.mark.parametrize("quaternion", ATTITUDES)
    def test_gravity_is_looked_for_in_the_worlds_axes(self, go1: Robot, quaternion: list[float]) -> None:
        """On average over 1 s, of which a window is 40 ms; before, it was gravity's opposite."""
        felt = np.array([3.0, -5.0, 7.0])
        monitor = self.begun(go1, quaternion)
        self.look(monitor, 0, Inertial((0.0,) * 3, tuple(felt), tuple(quaternion)))
        world = Rotation.from_quat(quaternion, scalar_first=True).apply(felt)
        kept = math.exp(-0.04)
        np.testing.assert_allclose(monitor._mean, kept * np.array([0, 0, 9.81]) + (1 - kept) * world)
        assert monitor.lean() == pytest.approx((1 - kept) * math.hypot(world[0], world[1]) / 9.81)
        assert monitor.lift() == pytest.approx((1 - kept) * abs(world[2] / 9.81 - 1.0))

    @pytest.mark.parametrize("quaternion", ATTITUDES)
    def test_at_rest_gravity_is_the_mean_of_all_of_it(self, go1: Robot, quaternion: list[float]) -> None:
        """Four windows of one reading and four of another are 0.32 s, and 0.3 s are asked for."""
        monitor, world = self.begun(go1, quaternion), np.array([[1.0, 2.0, 9.0], [3.0, -1.0, 12.0]])
        felt = Rotation.from_quat(quaternion, scalar_first=True).inv().apply(world)
        for look in range(8):
            assert monitor.rest_error == 0.0
            self.look(monitor, look, Inertial((0.0,) * 3, tuple(felt[look // 4]), tuple(quaternion)))
        expected = np.linalg.norm([2.0, 0.5, 10.5 - 9.81]) / 9.81
        assert monitor.rest_error == pytest.approx(expected)

    @pytest.mark.parametrize(
        ("gyro", "speed_rad_s", "rests"),
        [
            ((0.29, -0.29, 0.29), 0.29, True),
            ((0.31, 0.0, 0.0), 0.0, False),
            ((0.0, -0.31, 0.0), 0.0, False),
            ((0.0, 0.0, 0.31), 0.0, False),
            ((0.0, 0.0, 0.0), 0.31, False),
            ((0.0, 0.0, 0.0), -0.31, False),
        ],
    )
    def test_rest_is_over_as_soon_as_base_or_a_joint_moves(
        self, go1: Robot, gyro: tuple[float, float, float], speed_rad_s: float, rests: bool
    ) -> None:
        monitor, askew = self.begun(go1, STILL.quaternion), STILL._replace(acceleration=(9.81, 0.0, 9.81))
        for look in range(8):
            self.look(monitor, look, askew)
        assert monitor.rest_error == pytest.approx(1.0)
        self.look(monitor, 8, askew._replace(gyro=gyro), speed_rad_s)
        assert monitor.rest_error == (pytest.approx(1.0) if rests else 0.0)
        self.look(monitor, 9, STILL)
        assert (monitor.rest_error > 0.0) is rests

    def test_of_a_window_the_last_attitude_and_the_mean_rates_count(self, go1: Robot) -> None:
        """Ten gyro readings of 0.1 to 1 rad/s: 0.55 rad/s, 0.022 rad; a turn of 0.05 rad with the last."""
        monitor, zeros = self.begun(go1, STILL.quaternion), np.zeros(12)
        turned = (math.cos(0.025), math.sin(0.025), 0.0, 0.0)
        for k in range(1, 11):
            quaternion = turned if k == 10 else STILL.quaternion
            reading = Inertial((0.0, 0.1 * k, 0.0), (0.0, 2.0 * k, 9.81), quaternion)
            monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), reading, np.zeros((3, 12)), zeros)
        monitor.look(zeros, zeros, zeros, zeros)
        monitor._looks = 2  # the third is due, at which the height is looked at
        monitor.look_at_body()
        assert (
            monitor.sunk == monitor.sunk_share(zeros, turned) != monitor.sunk_share(zeros, STILL.quaternion)
        )
        np.testing.assert_allclose(monitor.rotation, [0.05, -0.022, 0.0], atol=1e-5)
        sideways = 11.0 * math.cos(0.05) - 9.81 * math.sin(0.05)
        assert monitor._mean[1] == pytest.approx((1 - math.exp(-0.04)) * sideways)

    @pytest.mark.parametrize(
        ("on_legs", "speed_rad_s", "looks"), [(True, 0.29, True), (True, 0.31, False), (False, 0.0, False)]
    )
    def test_the_legs_attitude_is_looked_at_while_the_robot_stands_nearly_still(
        self, go1: Robot, on_legs: bool, speed_rad_s: float, looks: bool
    ) -> None:
        """Its nose up by 0.2 rad: the way up is ahead by the sine."""
        asked: list[tuple] = []
        legs = SimpleNamespace(slope=0.1, turn=0.2, look=lambda *told: asked.append(told), resets=0)
        legs.reset = lambda: setattr(legs, "resets", legs.resets + 1)
        nose_up = (math.cos(0.1), 0.0, -math.sin(0.1), 0.0)
        monitor = self.begun(go1, nose_up)
        monitor._attitude, monitor.on_legs = legs, on_legs  # type: ignore[assignment]
        joints = np.array([go1.default_pose, np.full(12, speed_rad_s), np.zeros(12)])
        for k in range(1, 11):
            joints = joints.copy()
            joints[2] = 1.0 * k
            reading = STILL._replace(quaternion=nose_up)
            monitor.add(k * SAMPLE_US, 0, np.full(12, k * SAMPLE_US), reading, joints, np.zeros(12))
        monitor.look(*np.zeros((4, 12)))
        monitor.look_at_body()
        assert (len(asked), legs.resets) == ((1, 0) if looks else (0, 1))
        assert (monitor.slope(), monitor.leg_turn()) == (0.1, 0.2)
        for position, torque, up, elapsed_s in asked:
            np.testing.assert_array_equal(position, go1.default_pose)
            np.testing.assert_allclose(torque, 5.5)
            np.testing.assert_allclose(up, [math.sin(0.2), 0.0, math.cos(0.2)], atol=1e-12)
            assert elapsed_s == pytest.approx(0.04)

    @pytest.mark.parametrize(("tick_s", "share", "lag_s"), [(0.002, 0.2, 0.007), (0.02, 0.4, 0.015)])
    def test_readings_farther_apart_than_an_impact_are_granted_more(
        self, go1: Robot, tick_s: float, share: float, lag_s: float
    ) -> None:
        """Samples of 4 and 20 ms, an impact of 10 ms: a fifth, or twice that; half a sample beside 5 ms."""
        monitor = SensorMonitor(go1, LIMITS, tick_s)
        assert (monitor._share, monitor._lag_s) == pytest.approx((share, lag_s))

    @pytest.mark.parametrize(
        ("period_s", "silence_us", "compared"),
        [(0.04, 20_000, True), (0.04, 20_001, False), (0.004, 6000, True), (0.004, 6001, False)],
    )
    def test_a_gap_is_half_a_period_or_one_and_a_half_samples(
        self, go1: Robot, period_s: float, silence_us: int, compared: bool
    ) -> None:
        monitor, zeros = SensorMonitor(go1, replace(LIMITS, period_s=period_s), 0.002), np.zeros(12)
        monitor.begin(0, np.zeros(12, np.int64), STILL, np.zeros((3, 12)), zeros)
        monitor.add(SAMPLE_US, silence_us, np.full(12, SAMPLE_US), STILL, np.zeros((3, 12)), zeros)
        assert monitor.look(zeros, zeros, zeros, zeros) is compared

    def test_the_height_is_looked_at_every_third_time_of_a_robot_on_its_legs(self, go1: Robot) -> None:
        """Its joints read zero: legs straight down, longer than they stand, which is less than none."""
        monitor, sunk = self.begun(go1, STILL.quaternion), []
        for look in range(6):
            monitor.on_legs = look != 3
            self.look(monitor, look, STILL)
            sunk.append(monitor.sunk)
        assert sunk == [0.0, 0.0, sunk[2], 0.0, 0.0, sunk[2]]
        assert sunk[2] == pytest.approx(monitor.sunk_share(np.zeros(12), STILL.quaternion))
        assert sunk[2] < -0.1

    def test_readings_are_added_every_four_milliseconds_of_ticks_of_two(self, go1: Robot) -> None:
        monitor, zeros = SensorMonitor(go1, LIMITS, 0.002), np.zeros(12)
        monitor.begin(10_000, np.zeros(12, np.int64), STILL, np.zeros((3, 12)), zeros)
        assert [monitor.due(now_us) for now_us in (10_000, 12_000, 14_000, 16_000)] == [
            False,
            False,
            True,
            True,
        ]
        monitor.add(14_000, 0, np.zeros(12), STILL, np.zeros((3, 12)), zeros)
        assert [monitor.due(now_us) for now_us in (16_000, 18_000)] == [False, True]
