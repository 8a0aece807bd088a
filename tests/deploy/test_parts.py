"""The deploy loop on a robot made of frames alone: what goes out, what comes in, when, and who is told."""

import gc
import math
import os
import resource
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import FailingPolicy, Hold, stand_still
from fake_time import FakeTime
from frame_robot import ROWS, TICK_US, FrameRobot, Notebook, Ticks, Vector
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.deploy import clock as clock_module
from footfall.deploy import session
from footfall.deploy.bus import BusStatistics
from footfall.deploy.clock import LockstepClock, WallClock, undisturbed
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.first_rest import FirstRest
from footfall.deploy.loop import ControlLoop
from footfall.deploy.pose import _turns, impossible_pose
from footfall.deploy.replay import _difference
from footfall.deploy.safety import Mode, SafetyConfig
from footfall.deploy.sensor_limits import SensorLimits
from footfall.deploy.session import Session, run_session
from footfall.deploy.timing import Durations
from footfall.deploy.wiring import Wiring, wire
from footfall.plant.motor_ends.motor_end import Request
from footfall.policies.contract import CommandRange
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

RNG = np.random.default_rng(6)


def loop_of(
    robot: Robot,
    policy: Any,
    times_us: Any = None,
    command_source: Any = stand_still,
    wiring: Wiring | None = None,
    safety: SafetyConfig | None = None,
    still_s: float = 0.0,  # it stands up as soon as all are heard
    **settings: Any,
) -> tuple[ControlLoop, FrameRobot]:
    body = FrameRobot(robot, wiring)
    config = DeployConfig(
        **{"stand_s": 0.099, **settings}, safety=replace(safety or SafetyConfig(), still_s=still_s)
    )
    clock = LockstepClock(TICK_US) if times_us is None else Ticks(times_us)
    wiring = body.wiring
    loop = ControlLoop(robot, policy, wiring, open_driver(wiring), body, clock, config, command_source)  # type: ignore[arg-type]
    return loop, body


def until(loop: ControlLoop, mode: Mode, most: int = 2000) -> None:
    for _ in range(most):
        if loop.state.mode is mode:
            return
        loop.tick()
    pytest.fail(f"{loop.state} never became {mode}")


class TestLoop:
    def test_what_motors_say_from_the_second_tick_on_answers_being_switched_off(self, go1: Robot) -> None:
        """All answer at once: what they said before and a tick later may answer what was sent before."""
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        sent = len(body.sent)
        loop.shut_down()
        assert [at_us - loop.now_us for at_us, _ in body.sent[sent:]] == [2000, 4000]
        assert body.kinds() == [Request.DISABLE] * 12
        assert loop.silent_at_the_end == []

    def test_a_motor_that_never_says_that_it_is_off_is_asked_for_a_quarter_of_a_second(
        self, go1: Robot
    ) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        sent, body.silent = len(body.sent), [7]
        loop.shut_down()
        assert [at_us - loop.now_us for at_us, _ in body.sent[sent:]] == list(range(2000, 254_000, 2000))
        assert loop.silent_at_the_end == ["RR_thigh_joint (can2, id 2)"]

    def test_a_run_from_switching_on_to_switching_off(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1), safety=SafetyConfig(damping_kd=2.5, damping_s=0.019))
        assert loop.tick()
        assert loop.state.mode is Mode.STANDING  # everyone had answered
        until(loop, Mode.WALKING)
        assert loop.now_us == 100_000
        quantum = body._end._codec.quantum  # type: ignore[attr-defined]
        gains = body.command()
        np.testing.assert_array_less(np.abs(gains.kp - 4 * go1.kp), quantum[2])
        np.testing.assert_array_less(np.abs(gains.kd - np.minimum(2 * go1.kd, 5.0)), quantum[3])
        for _ in range(25):
            assert loop.tick()
        assert loop.walking
        assert loop.walking_s == pytest.approx(0.05)
        loop.finish()
        loop.tick()
        assert loop.state.mode is Mode.RELEASING
        assert loop.walked_s == pytest.approx(0.052)
        damped = body.command()
        assert not damped.kp.any()
        np.testing.assert_allclose(damped.kd, 2.5, atol=0.01)
        np.testing.assert_allclose([damped.velocity, damped.torque], 0.0, atol=0.05)
        ticks = 1
        while loop.tick():
            ticks += 1
        assert ticks == 10  # of damping
        assert loop.state.mode is Mode.IDLE
        assert loop.state.over
        assert body.kinds() == [Request.DISABLE] * 12
        assert loop.walked_s == pytest.approx(0.052)

    def test_it_stands_up_under_gains_of_its_own(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1), stand_kp_scale=2.0, stand_kd_scale=1.25)
        until(loop, Mode.STANDING)
        for _ in range(5):
            loop.tick()
        assert loop.state.mode is Mode.STANDING
        standing = body.command()
        np.testing.assert_allclose(standing.kp, 2.0 * go1.kp, atol=0.13)
        np.testing.assert_allclose(standing.kd, 1.25 * go1.kd, atol=2e-3)
        np.testing.assert_allclose([standing.velocity, standing.torque], 0.0, atol=0.05)

    def test_what_a_policy_notes_is_told_beside_what_became_of_commands(self, go1: Robot) -> None:
        policy = Hold(go1)
        policy.notes = notes = ["slower"]  # type: ignore[assignment]
        loop, _ = loop_of(go1, policy, command_source=lambda _: np.array([math.nan, 0.0, 0.0]))
        loop.log = notebook = Notebook()
        until(loop, Mode.WALKING)
        for _ in range(15):
            loop.tick()
        notes.append("lower")
        for _ in range(15):
            loop.tick()
        nan = "a forward command of nan m/s counted as 0"
        assert loop.notes == [nan, "slower", "lower"]
        assert [note for _, note in notebook.of("note")] == [nan, "slower", "lower"]

    def test_no_tick_is_skipped_before_the_first(self, go1: Robot) -> None:
        loop, _ = loop_of(go1, Hold(go1))
        assert loop.ticks_skipped == 0
        loop.tick()
        assert loop.ticks_skipped == 0

    def test_motors_are_switched_on_until_all_have_answered(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1))
        body.silent = [3]
        for _ in range(5):
            loop.tick()
            assert body.kinds() == [Request.ENABLE] * 12
        assert loop.state.mode is Mode.IDLE
        body.silent = []
        loop.tick()
        assert loop.state.mode is Mode.STANDING

    @pytest.mark.parametrize("rate_hz", [30.0, 50.0, 77.0, 500.0])
    def test_policy_steps_come_at_the_first_tick_of_their_time(self, go1: Robot, rate_hz: float) -> None:
        policy = Hold(go1)
        policy.rate_hz = rate_hz
        loop, _ = loop_of(go1, policy)
        until(loop, Mode.WALKING)
        for _ in range(300):
            loop.tick()
        times = [seen.time_s for seen in policy.seen]
        due = np.arange(len(times)) / rate_hz
        np.testing.assert_allclose(times, np.ceil(np.round(due / 0.002, 6)) * 0.002, atol=1e-9)
        assert len(times) == math.floor(0.6 * rate_hz + 1e-6) + 1
        assert policy.resets == 1

    def test_steps_that_were_missed_are_not_caught_up_on(self, go1: Robot) -> None:
        """A pause of 76 ms: one step at its end, and the next where the rhythm of 20 ms has it."""
        times = [*range(0, 152_000, TICK_US), *range(226_000, 286_000, TICK_US)]
        policy = Hold(go1)
        loop, _ = loop_of(go1, policy, times, safety=SafetyConfig(pause_limit_s=0.08))
        for _ in times:
            loop.tick()
        assert loop.ticks_skipped == 37
        assert [round(seen.time_s, 3) for seen in policy.seen] == [0, 0.02, 0.04, 0.126, 0.14, 0.16, 0.18]

    def test_commands_go_out_at_every_tick_decisions_at_every_step(self, go1: Robot) -> None:
        class Creep(Hold):
            def act(self, inputs: PolicyInput) -> JointCommand:
                hold = super().act(inputs)
                return hold._replace(position=hold.position + 0.01 * len(self.seen))

        loop, body = loop_of(go1, Creep(go1))
        until(loop, Mode.WALKING)
        sent = []
        for _ in range(25):
            loop.tick()
            sent.append(body.command().position[0] - go1.default_pose[0])
        np.testing.assert_allclose(sent, [0.01] * 9 + [0.02] * 10 + [0.03] * 6, atol=3e-4)
        assert [time_us for time_us, _ in body.sent[-25:]] == list(range(102_000, 152_000, TICK_US))

    def test_what_the_policy_sees_is_what_the_frames_said(self, go1: Robot) -> None:
        policy = Hold(go1)
        unmoved = SensorLimits(
            rotation_rad=3.0, drift_rad=3.0, wander_rad=3.0, stuck_rad=3.0, lean_error=2.0
        )  # jumps are what is tested
        safety = SafetyConfig(sensors=unmoved)
        loop, body = loop_of(go1, policy, command_source=lambda t: np.array([t, 2 * t, 3 * t]), safety=safety)
        until(loop, Mode.WALKING)
        body.readings = np.array([go1.default_pose + 0.01 * ROWS, 0.1 * ROWS, -0.2 * ROWS])
        body.gyro, body.quaternion = (0.1, 0.2, -0.3), (0.96, 0.0, 0.28, 0.0)
        for _ in range(10):
            loop.tick()
        seen = policy.seen[-1]
        assert loop.state.faults == ()
        np.testing.assert_allclose(seen.sensed.joint_position, body.readings[0], atol=3e-4)
        np.testing.assert_allclose(seen.sensed.joint_velocity, body.readings[1], atol=0.02)
        np.testing.assert_allclose(seen.sensed.joint_torque, body.readings[2], atol=0.02)
        np.testing.assert_allclose(seen.sensed.gyro, body.gyro, atol=1e-3)
        np.testing.assert_allclose(seen.sensed.quaternion, body.quaternion, atol=1e-4)
        np.testing.assert_allclose(seen.sensed.acceleration, [0.0, 0.0, 9.8], atol=0.005)
        np.testing.assert_allclose(seen.command, [0.02, 0.04, 0.06])
        np.testing.assert_allclose(loop.asked_command, [0.02, 0.04, 0.06])
        assert np.isnan(seen.base_velocity).all()
        assert math.isnan(seen.base_height)

    def test_who_knows_the_base_better_is_asked_instead_of_the_estimator(self, go1: Robot) -> None:
        policy = Hold(go1)
        loop, _ = loop_of(go1, policy)
        loop._estimator = SimpleNamespace(reset=lambda sensed: None, start=lambda: None)  # type: ignore[assignment]
        loop.base_state = lambda: (np.array([1.0, 2.0, 3.0]), 0.4)
        until(loop, Mode.WALKING)
        loop.tick()
        assert policy.seen[-1].base_velocity.tolist() == [1.0, 2.0, 3.0]
        assert policy.seen[-1].base_height == 0.4

    @pytest.mark.parametrize(
        ("change", "says", "mode"),
        [
            (lambda body: body.silent.append(7), "no reply from RR_thigh_joint (can2, id 2)", Mode.ESTOP),
            (lambda body: setattr(body, "imu_silent", True), "no new IMU reading", Mode.ESTOP),
            (
                lambda body: body.error.__setitem__(4, 3),
                "motor FL_thigh_joint (can1, id 2) reports over-voltage",
                Mode.ESTOP,
            ),
            (lambda body: setattr(body, "refuses", 2), "bus overflow: 2 frames refused", Mode.ESTOP),
            (
                lambda body: setattr(body, "quaternion", (0.8, 0.0, 0.6, 0.0)),
                "tilt of 1.29 rad",
                Mode.FALLING,
            ),
        ],
    )
    @pytest.mark.parametrize("before", [Mode.STANDING, Mode.WALKING])
    def test_a_fault_is_named_and_damps(
        self, go1: Robot, change: Any, says: str, mode: Mode, before: Mode
    ) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, before)
        loop.tick()
        change(body)
        until(loop, mode, most=40)
        assert len(loop.state.faults) == 1
        assert loop.state.faults[0].startswith(says)
        assert not body.command().kp.any()

    def test_of_two_motors_that_report_errors_the_first_is_named(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        body.error[[4, 9]] = 1, 2
        loop.tick()
        assert loop.state.faults == ("motor FL_thigh_joint (can1, id 2) reports over-temperature",)

    @pytest.mark.parametrize(
        ("change", "says"),
        [
            (lambda hold: hold._replace(torque=hold.torque + np.inf), "the policy's command is not finite"),
            (lambda hold: hold._replace(kd=-np.inf * hold.kd), "the policy's command is not finite"),
            (lambda hold: hold._replace(velocity=np.nan * hold.kd), "the policy's command is not finite"),
            (lambda hold: [part[:11] for part in hold], "the policy failed: ValueError: it decides on shape"),
            (lambda hold: hold[:4], "the policy failed: ValueError: it decides on shape (4, 12)"),
            (lambda hold: {}["legs"], "the policy failed: KeyError: 'legs'"),
        ],
    )
    def test_what_is_no_command_damps_the_robot_in_the_same_tick(
        self, go1: Robot, change: Any, says: str
    ) -> None:
        loop, body = loop_of(go1, FailingPolicy(go1, 0.04, change))
        until(loop, Mode.WALKING)
        while loop.now_us < 140_000:
            loop.tick()
        assert loop.state.mode is Mode.ESTOP
        assert len(loop.state.faults) == 1
        assert loop.state.faults[0].startswith(says)
        assert not body.command().kp.any()
        assert loop.walked_s == pytest.approx(0.04)

    def test_an_imu_on_a_bus_of_its_own_is_heard_there(self, go1: Robot) -> None:
        usual = wire(go1)
        for channel in (0, 3):
            loop, _ = loop_of(go1, Hold(go1), wiring=replace(usual, imu_channel=channel))
            loop.tick()
            assert loop.state.mode is Mode.STANDING

    def test_targets_of_a_leaping_policy_move_at_the_robots_rate(self, go1: Robot) -> None:
        """60 rad/s in ticks of 2 ms."""

        class Leap(Hold):
            def act(self, inputs: PolicyInput) -> JointCommand:
                hold = super().act(inputs)
                return hold._replace(position=hold.position + 0.5)

        loop, _ = loop_of(go1, Leap(go1))
        until(loop, Mode.WALKING)
        assert go1.description.target_rate_rad_s == 60.0
        for tick in (1, 2, 3):
            np.testing.assert_allclose(loop.target - go1.default_pose, 0.12 * tick, atol=1e-9)
            loop.tick()

    @pytest.mark.parametrize(
        ("times", "says"),
        [
            ([*range(0, 150_000, TICK_US), *range(360_000, 380_000, TICK_US)], "the loop paused for 212 ms"),
            (
                [*range(0, 150_000, TICK_US), *range(150_000, 900_000, 2 * TICK_US)],
                "of the last second's ticks were left out",
            ),
        ],
    )
    def test_ticks_that_are_left_out_are_a_fault(self, go1: Robot, times: list[int], says: str) -> None:
        loop, body = loop_of(go1, Hold(go1), times)
        for _ in times[:76]:
            loop.tick()
        for _ in times[76:]:
            if loop.state.mode is Mode.WALKING:
                loop.tick()
        assert loop.state.mode is Mode.ESTOP
        assert says in loop.state.faults[0]
        assert not body.command().kp.any()

    def test_a_few_ticks_that_are_left_out_are_forgiven(self, go1: Robot) -> None:
        """One of six, and a pause of 60 ms."""
        times = [at for at in range(0, 1_500_000, TICK_US) if at % (6 * TICK_US)]
        times = [at for at in times if not 700_000 < at < 760_000]
        loop, _ = loop_of(go1, Hold(go1), times)
        for _ in times:
            loop.tick()
        assert loop.state.faults == ()

    @pytest.mark.parametrize("joint", [3, 10])
    @pytest.mark.parametrize(
        ("offset", "says"),
        [
            (2 * np.pi, "off by +1 turn of the joint (+6.28 rad)?"),
            (-2 * np.pi, "off by -1 turn of the joint (-6.28 rad)?"),
        ],
    )
    def test_a_joint_that_cannot_be_where_it_says_gets_no_stiffness(
        self, go1: Robot, joint: int, offset: float, says: str
    ) -> None:
        loop, body = loop_of(go1, Hold(go1))
        body.readings[0, joint] += offset
        while loop.tick():
            values = body.sent[-1][1].values[2]
            assert body.kinds()[joint] != Request.COMMAND or not values.any()
        assert loop.state.mode is Mode.ESTOP
        assert loop.state.faults[0].startswith(body.wiring.place(joint))
        assert says in loop.state.faults[0]

    @pytest.mark.parametrize(
        ("temperature_c", "speed_rad_s", "error", "says"),
        [
            (90, 0.0, 0, "FR_hip_joint (can0, id 1): the motor is at 90 degrees Celsius"),
            (30, 50.0, 0, "FR_hip_joint (can0, id 1): turns at 50.0 rad/s, faster than its motor can"),
            (30, 0.0, 1, "motor FR_hip_joint (can0, id 1) reports "),
        ],
    )
    def test_a_motor_that_is_not_well_gets_no_stiffness(
        self, go1: Robot, temperature_c: int, speed_rad_s: float, error: int, says: str
    ) -> None:
        loop, body = loop_of(go1, Hold(go1))
        body.temperature_c, body.readings[1, 0], body.error[0] = temperature_c, speed_rad_s, error
        while loop.tick():
            assert body.kinds()[0] != Request.COMMAND or not body.sent[-1][1].values[2].any()
        assert loop.state.mode is Mode.ESTOP
        assert loop.state.faults[0].startswith(says)

    @pytest.mark.parametrize(
        ("lean_rad", "acceleration", "off"),
        [
            (0.0, (0.0, 0.0, 1.0), "90%"),  # in units of g
            (0.0, (0.0, 0.0, -9.8), "200%"),
            (math.radians(15), (0.0, 0.0, 9.8), "26%"),  # askew: 2 sin(7.5 degrees)
            (math.radians(30), (0.0, 0.0, 9.8), "52%"),  # 2 sin(15 degrees)
        ],
    )
    def test_an_imu_whose_parts_disagree_on_gravity_keeps_a_still_robot_from_getting_stiffness(
        self, go1: Robot, lean_rad: float, acceleration: tuple[float, float, float], off: str
    ) -> None:
        loop, body = loop_of(go1, Hold(go1), still_s=0.05)
        body.quaternion = (math.cos(lean_rad / 2), 0.0, math.sin(lean_rad / 2), 0.0)
        body.acceleration = acceleration
        while loop.tick():
            assert body.kinds()[0] != Request.COMMAND or not body.sent[-1][1].values[2].any()
        assert loop.state.faults == (
            f"the IMU: before the start its acceleration is off its quaternion's gravity by {off}",
        )

    @pytest.mark.parametrize("what", ["not_ready", "not_enabled"])
    def test_no_joint_gets_stiffness_before_each_motor_is_ready_and_on(self, go1: Robot, what: str) -> None:
        """All are heard meanwhile; in the end it is told who was not."""
        loop, body = loop_of(go1, Hold(go1))
        setattr(loop._driver, what, lambda: "motor knee is not there yet")
        while loop.tick():
            assert loop.state.mode in (Mode.IDLE, Mode.ESTOP)
            assert Request.COMMAND not in body.kinds() or not body.sent[-1][1].values[2].any()
        assert loop.state.faults == ("motor knee is not there yet",)

    def test_a_robot_that_keeps_still_stands_up_after_that_time_level_or_not(self, go1: Robot) -> None:
        """A robot on a slope of 15 degrees: the accelerometer feels the same lean that the quaternion has."""
        loop, body = loop_of(go1, Hold(go1), still_s=0.05)
        lean = math.radians(15)
        body.quaternion = (math.cos(lean / 2), 0.0, math.sin(lean / 2), 0.0)
        body.acceleration = (-9.8 * math.sin(lean), 0.0, 9.8 * math.cos(lean))
        until(loop, Mode.STANDING)
        assert loop.now_us == 50_000

    @pytest.mark.parametrize("who", ["the IMU's gyro", "FL_thigh_joint (can1, id 2)"])
    def test_a_robot_that_moves_waits_and_is_refused_in_the_end(self, go1: Robot, who: str) -> None:
        loop, body = loop_of(go1, Hold(go1), still_s=0.05)
        if who.startswith("FL"):
            body.readings[1, 4] = -0.5
        else:
            body.gyro = (0.0, 0.5, 0.0)
        until(loop, Mode.ESTOP)
        assert loop.now_us == 1_000_000
        assert loop.state.faults == (
            f"the robot does not keep still for 0.05 s before it gets stiffness: {who} reads 0.50 rad/s",
        )

    def test_what_is_refused_is_counted_over_the_run(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        body.refuses = 3
        loop.tick()
        body.refuses = 0
        loop.tick()
        assert loop.state.faults == ("bus overflow: 3 frames refused",)

    def test_a_bus_that_does_not_work_is_a_fault(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        body.bus_fault = "bus can2 is bus-off"
        loop.tick()
        assert (loop.state.mode, loop.state.faults) == (Mode.ESTOP, ("bus can2 is bus-off",))

    def test_the_log_is_told_of_each_tick_step_change_and_note_once(self, go1: Robot) -> None:
        policy = Hold(go1)
        loop, body = loop_of(
            go1, policy, command_source=lambda t: np.array([9.0, 0.0, 9.0 if t > 0.03 else 0.0])
        )
        loop.log = notebook = Notebook()
        loop._command_limits._ranges = ((-1.0, 1.0), (-1.0, 1.0), (-2.0, 2.0))
        until(loop, Mode.WALKING)
        for _ in range(30):
            loop.tick()
        assert [time_us for time_us, *_ in notebook.of("tick")] == list(range(0, 162_000, TICK_US))
        assert notebook.of("tick")[-1][1] is loop.sensed
        sent = notebook.of("tick")[-1][2]
        np.testing.assert_array_equal(sent[0], loop.target)
        np.testing.assert_allclose(body.command().kp, sent[2], atol=0.2)  # a frame's rounding
        np.testing.assert_allclose(body.command().kd, sent[3], atol=0.01)
        assert [(time_us, state.mode) for time_us, state in notebook.of("state")] == [
            (0, Mode.STANDING),
            (100_000, Mode.WALKING),
        ]
        steps = notebook.of("policy_step")
        assert [time_us for time_us, *_ in steps] == [100_000, 120_000, 140_000, 160_000]
        assert [each[1] for each in steps] == policy.seen
        np.testing.assert_array_equal(steps[0][2].position, go1.default_pose)
        notes = notebook.of("note")
        assert [time_us for time_us, _ in notes] == [100_000, 140_000]
        assert "forward" in notes[0][1]
        assert "yaw" in notes[1][1]
        assert policy.seen[-1].command.tolist() == [1.0, 0.0, 2.0]
        assert loop.asked_command.tolist() == [9.0, 0.0, 9.0]

    def test_lateness_counts_on_the_wall_clock_alone(self, go1: Robot) -> None:
        loop, _ = loop_of(go1, Hold(go1), range(0, 20_000, TICK_US))
        for realtime in (False, True):
            loop._clock.realtime = realtime
            for _ in range(4):
                loop.tick()
        assert loop.timing.tick_us.count == 8
        assert loop.timing.lateness_us.values().tolist() == [17.0] * 4

    @pytest.mark.parametrize("part", ["receive", "stance", "command", "log", "frames", "send"])
    def test_whatever_raises_the_robot_is_damped_and_then_switched_off(self, go1: Robot, part: str) -> None:
        """Of readings, a policy, what steers it, a log, the joint layer, the bus."""

        def fails(*_: object) -> None:
            raise KeyError("no such\n thing")

        loop, body = loop_of(go1, Hold(go1))
        loop._estimator = SimpleNamespace(
            reset=lambda sensed: None, start=lambda: None, update=lambda *_: (np.zeros(3), 0.3)
        )
        until(loop, Mode.WALKING)
        for _ in range(5):
            loop.tick()
        if part == "receive":
            body.receive = fails  # type: ignore[assignment, method-assign]
        elif part == "stance":
            loop._policy.stance = fails  # type: ignore[assignment, method-assign]
        elif part == "command":
            loop._command_source = fails  # type: ignore[assignment]
        elif part == "log":
            loop.log = SimpleNamespace(tick=fails, state=fails, policy_step=fails, note=fails)
        elif part == "frames":
            loop._joints.command = loop._joints.damping = fails  # type: ignore[assignment, method-assign]
        else:
            send, body.send = body.send, fails  # type: ignore[assignment, method-assign]
            loop.tick()
            body.send = send  # type: ignore[method-assign]
        begun_us = loop.now_us
        ticks = 0
        while loop.tick():
            ticks += 1
            assert loop.state.mode is Mode.ESTOP or ticks <= 10
            if loop.state.mode is Mode.ESTOP:
                damped = body.command()
                assert not damped.kp.any()
                np.testing.assert_allclose(damped.kd, 3.0, atol=0.01)
        assert len(loop.state.faults) == 1
        assert "KeyError: 'no such" in loop.state.faults[0]
        assert "\n" not in loop.state.faults[0]
        assert body.kinds() == [Request.DISABLE] * 12
        assert 0.49 < (loop.now_us - begun_us) * 1e-6 < 0.53
        assert loop.walked_s > 0.0

    def test_shutting_down_switches_every_motor_off(self, go1: Robot) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        loop.shut_down()
        assert body.kinds() == [Request.DISABLE] * 12
        assert body.sent[-1][0] <= loop.now_us + 4000  # as soon as each has answered it ends
        assert loop.silent_at_the_end == []

    @pytest.mark.parametrize(("rate_hz", "fits"), [(500.0, True), (500.1, False), (0.0, False), (0.1, True)])
    def test_a_policys_rate_is_above_zero_and_at_most_the_joints(
        self, go1: Robot, rate_hz: float, fits: bool
    ) -> None:
        policy = Hold(go1)
        policy.rate_hz = rate_hz
        if fits:
            loop_of(go1, policy)
        else:
            with pytest.raises(UserError, match="the policy cannot be faster"):
                loop_of(go1, policy)


class TestFirstRest:
    """A level robot that shall keep still for 0.05 s, by readings at 500 Hz."""

    TURNING = (0.0, 1.0, 0.0)  # rad/s
    STILL = (0.0, 0.0, 0.0)
    GRAVITY = (0.0, 0.0, 9.81)

    def looked(self, before: list[tuple[Vector, Vector]], at_rest: Vector) -> tuple[FirstRest, int]:
        """At the first tick at which nothing is waited for any more, and when that is.

        `before` are gyro and acceleration of ticks up to the last motion; from then on it rests.
        """
        rest = FirstRest(0.05, SensorLimits(), ["hip"])
        for tick, (gyro, acceleration) in enumerate([*before, *[(self.STILL, at_rest)] * 100]):
            now_us = tick * TICK_US
            rest.look(now_us, imu.Inertial(gyro, acceleration, (1.0, 0.0, 0.0, 0.0)), np.zeros(1))
            if not rest.awaited(now_us):
                return rest, now_us
        pytest.fail("it waits for ever")

    @pytest.mark.parametrize(
        "before",
        [
            [(TURNING, (0.0, 0.0, 150.0))],
            [(STILL, (0.0, 0.0, 0.0))] * 20 + [(TURNING, GRAVITY)],
        ],
        ids=["it is set down hard", "it was let fall"],
    )
    def test_what_was_felt_up_to_the_last_motion_is_not_held_against_it(
        self, before: list[tuple[Vector, Vector]]
    ) -> None:
        rest, ready_us = self.looked(before, self.GRAVITY)
        assert ready_us == (len(before) - 1) * TICK_US + 50_000
        assert rest.contradiction() is None

    @pytest.mark.parametrize("seed", range(3))
    def test_accelerations_are_turned_into_the_worlds_axes_and_their_mean_counts(self, seed: int) -> None:
        """By scipy: 0.8 and 1.4 of gravity upwards, and to and fro sideways, are 10 % too much."""
        rng = np.random.default_rng(seed)
        rest = FirstRest(0.05, replace(SensorLimits(), rest_error=0.05), ["hip"])
        for sideways, upwards in ((7.0, 0.8), (-7.0, 1.4)):
            turn = Rotation.random(random_state=rng)
            felt = turn.inv().apply([sideways, 2 * sideways, upwards * 9.81])
            inertial = imu.Inertial(self.STILL, tuple(felt), tuple(turn.as_quat(scalar_first=True)))
            rest.look(0, inertial, np.zeros(1))
        found = rest.contradiction()
        assert found is not None
        assert (found.fault[-14:], found.leads_to) == ("gravity by 10%", Mode.ESTOP)

    @pytest.mark.parametrize(
        ("gyro", "velocity", "who"),
        [
            ((0.0, 0.0, -0.31), (0.0, 0.2), "the IMU's gyro reads 0.31 rad/s"),
            ((0.31, 0.0, 0.0), (0.0, 0.0), "the IMU's gyro reads 0.31 rad/s"),
            ((0.2, 0.0, 0.0), (0.0, -0.31), "knee reads 0.31 rad/s"),
            ((0.0, 0.0, 0.0), (0.31, 0.0), "hip reads 0.31 rad/s"),
            ((0.29, -0.29, 0.29), (-0.29, 0.29), ""),
        ],
    )
    def test_who_is_fastest_is_named_of_base_and_joints(
        self, gyro: Vector, velocity: tuple[float, float], who: str
    ) -> None:
        """0.3 rad/s is no rest: a robot that moves like this at each tick never begins."""
        rest = FirstRest(0.05, SensorLimits(), ["hip", "knee"])
        assert rest.awaited(0) == ""  # nothing was heard yet
        for now_us in range(0, 200_000, TICK_US):
            rest.look(now_us, imu.Inertial(gyro, self.GRAVITY, (1.0, 0.0, 0.0, 0.0)), np.array(velocity))
        says = "the robot does not keep still for 0.05 s before it gets stiffness: "
        assert rest.awaited(200_000) == (says + who if who else "")

    def test_who_need_not_keep_still_is_not_looked_at(self) -> None:
        rest = FirstRest(0.0, SensorLimits(), ["hip"])
        rest.look(0, imu.Inertial(self.STILL, (0.0, 0.0, -9.81), (1.0, 0.0, 0.0, 0.0)), np.zeros(1))
        assert (rest.awaited(0), rest.contradiction()) == ("", None)

    def test_nor_does_it_hide_what_is_felt_at_rest(self) -> None:
        """A fifth too much."""
        before = [(self.STILL, self.GRAVITY)] * 20 + [(self.TURNING, self.GRAVITY)]
        rest, _ = self.looked(before, (0.0, 0.0, 1.2 * 9.81))
        found = rest.contradiction()
        assert found is not None
        assert found.fault.endswith("gravity by 20%")

    def test_gravity_is_looked_for_where_the_quaternion_has_it(self) -> None:
        """Rolled by 0.5 rad to its right: gravity's opposite is 9.81 (0, sin 0.5, cos 0.5) in the body."""
        felt = (0.0, 9.81 * math.sin(0.5), 9.81 * math.cos(0.5))
        for side in (1.0, -1.0):
            rest = FirstRest(0.05, SensorLimits(), ["hip"])
            rolled = (math.cos(0.25), side * math.sin(0.25), 0.0, 0.0)
            rest.look(0, imu.Inertial(self.STILL, felt, rolled), np.zeros(1))
            assert (rest.contradiction() is None) == (side > 0)


@pytest.mark.parametrize(
    ("position", "says"),
    [
        (7.5, ": off by +1 turn of the joint (+6.00 rad)?"),  # at 1.5
        (7.95, ": off by +1 turn of the joint (+6.00 rad)?"),
        (8.05, ""),  # 2.05 is above the range, and a turn less below it
        (13.5, ": off by +2 turns of the joint (+12.00 rad)?"),
        (-4.5, ": off by -1 turn of the joint (-6.00 rad)?"),
        (-5.05, ""),  # 0.95
        (math.nan, ""),
        (math.inf, ""),
    ],
)
def test_a_position_may_be_off_by_whole_turns_alone(position: float, says: str) -> None:
    """A range from 1 to 2 rad, in turns of 6 rad."""
    assert _turns(position, 1.0, 2.0, 6.0, "of the joint") == says


@pytest.mark.parametrize(("position", "says"), [(15.0, "+1 turn "), (-1.0, "-1 turn ")])
def test_of_several_numbers_of_turns_the_least_is_told(position: float, says: str) -> None:
    """A range from 0 to 14 rad has two turns of 6 rad in it."""
    assert f": off by {says}" in _turns(position, 0.0, 14.0, 6.0, "of the joint")


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_joint_may_begin_beyond_its_range_by_a_margin_also_after_a_turn(go1: Robot, side: float) -> None:
    """0.1 rad: 0.09 rad beyond it is where it says, and a turn away it is one turn off."""
    places = [f"joint {joint}" for joint in ROWS]
    position = go1.default_pose.copy()
    position[4] = (go1.upper_rad if side > 0 else go1.lower_rad)[4] + 0.09 * side
    assert impossible_pose(go1, places, position, 0.1) == ""
    assert impossible_pose(go1, places, position, 0.08).startswith("joint 4 reads")
    position[4] += side * math.tau
    assert f"off by {'+' if side > 0 else '-'}1 turn of the joint" in impossible_pose(
        go1, places, position, 0.1
    )


def test_a_joint_off_by_a_turn_of_its_rotor_is_told_so(go1: Robot) -> None:
    """A hip's gear has 6.33 turns for one: 0.99 rad, beyond which its range of 1.7 rad says nothing else."""
    gear = go1.motor_figures("gear_ratio")[0]
    position = go1.default_pose.copy()
    position[0] = go1.upper_rad[0] + 0.5
    says = impossible_pose(go1, [""] * 12, position, 0.1)
    assert says.endswith(f"off by +1 turn of its rotor (+{math.tau / gear:.2f} rad)?")


# -- time --------------------------------------------------------------------------------------------


class TestClocks:
    def test_wall_time_keeps_to_its_deadlines_and_skips_what_was_missed(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fake = FakeTime()
        monkeypatch.setattr(clock_module, "time", fake)
        clock = WallClock(2000)
        assert (clock.next_tick(), clock.lateness_us()) == (0, 0.0)
        fake.ns += 500_000
        assert (clock.next_tick(), clock.lateness_us()) == (2000, 7.0)
        assert fake.slept == pytest.approx([0.0015])
        fake.ns = 5_004_300_000  # 2.3 ms later, due 0.3 ms ago
        assert (clock.next_tick(), clock.lateness_us()) == (4000, pytest.approx(300.0))
        fake.ns = 5_011_900_000
        assert (clock.next_tick(), clock.lateness_us()) == (10_000, pytest.approx(1900.0))
        assert (clock.next_tick(), clock.lateness_us()) == (12_000, 7.0)
        assert fake.slept == pytest.approx([0.0015, 0.0001])

    def test_lockstep_time_begins_at_zero(self) -> None:
        clock = LockstepClock(1500)
        assert [clock.next_tick() for _ in range(3)] == [0, 1500, 3000]
        assert clock.lateness_us() == 0.0

    @pytest.mark.parametrize("priority", [None, 42])
    @pytest.mark.parametrize("refused", [False, True])
    def test_a_priority_is_taken_for_as_long_as_it_lasts_where_it_is_given(
        self, monkeypatch: pytest.MonkeyPatch, priority: int | None, refused: bool
    ) -> None:
        calls: list[tuple] = []

        def set_scheduler(pid: int, policy: int, parameter: Any) -> None:
            if refused:
                raise PermissionError
            calls.append((pid, policy, parameter))

        library = SimpleNamespace(
            mlockall=lambda flags: calls.append(("lock", flags)), munlockall=lambda: calls.append(("unlock",))
        )
        monkeypatch.setattr(clock_module, "ctypes", SimpleNamespace(CDLL=lambda _, use_errno=False: library))
        unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
        monkeypatch.setattr(clock_module.resource, "getrlimit", lambda _: unlimited)
        monkeypatch.setattr(os, "sched_getscheduler", lambda _: 1)
        monkeypatch.setattr(os, "sched_getparam", lambda _: "usual")
        monkeypatch.setattr(os, "sched_param", lambda value: value)
        monkeypatch.setattr(os, "sched_setscheduler", set_scheduler)
        with undisturbed(priority):
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
        assert gc.isenabled()
        assert gc.get_freeze_count() == 0
        fifo, back = (0, os.SCHED_FIFO, 42), (0, 1, "usual")
        if priority is None:
            assert calls == []
        else:
            assert calls == [("lock", 3), *([] if refused else [fifo, back]), ("unlock",)]


def test_durations_are_the_last_ones_in_order_however_often_they_go_round() -> None:
    kept = Durations(kept=3)
    for count, expected in enumerate(
        ([], [5.0], [5.0, 9.0], [5.0, 9.0, 1.0], [9.0, 1.0, 2.0], [1.0, 2.0, 3.0])
    ):
        assert kept.values().tolist() == expected
        kept.add([5.0, 9.0, 1.0, 2.0, 3.0, 4.0][count])
    assert (kept.count, kept.longest) == (6, 9.0)


# -- sessions, logs, replays -------------------------------------------------------------------------


def session_of(**settings: Any) -> Session:
    config = DeployConfig(stand_s=0.02, safety=SafetyConfig(still_s=0.0, damping_s=0.01))
    plain = {
        "command_source": stand_still,
        "duration_s": 0.03,
        "realtime": False,
        "config": config,
        "lie_down": False,
    }
    return Session(**{**plain, **settings})


class TestSession:
    def test_its_outcome_says_how_it_went(self, go1: Robot) -> None:
        body, ticks = FrameRobot(go1), []
        shown: list[ControlLoop] = []

        def display(loop: ControlLoop) -> Any:
            shown.append(loop)
            return nullcontext()

        run = session_of(display=display, command_source=lambda t: np.array([math.nan, 0.0, 0.0]))
        outcome = run_session(go1, Hold(go1), body, run, lambda loop: ticks.append(loop.now_us))  # type: ignore[arg-type]
        assert (outcome.final_state, outcome.faults) == ("IDLE", ())
        assert outcome.walked_s == pytest.approx(0.032)
        assert outcome.run_s == pytest.approx(0.062)
        assert len(outcome.compute_ms) == 2
        assert outcome.timing["ticks_skipped"] == 0.0
        assert outcome.timing["ticks"] == 31.0
        assert outcome.buses == (BusStatistics("can0", 7),)
        assert outcome.notes == ("a forward command of nan m/s counted as 0",)
        assert ticks == list(range(0, 62_000, TICK_US))
        assert len(shown) == 1
        assert body.kinds() == [Request.DISABLE] * 12

    def test_whatever_happens_the_motors_are_switched_off(self, go1: Robot) -> None:
        body = FrameRobot(go1)

        def trip(loop: ControlLoop) -> None:
            if loop.walking:
                raise RuntimeError("over the cable")

        with pytest.raises(RuntimeError, match="cable"):
            run_session(go1, Hold(go1), body, session_of(), trip)  # type: ignore[arg-type]
        assert body.kinds() == [Request.DISABLE] * 12

    @pytest.mark.parametrize(
        ("needs", "knows", "estimates"), [(True, False, True), (False, False, False), (True, True, False)]
    )
    def test_the_base_is_estimated_where_a_policy_needs_it_and_nobody_knows_better(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, needs: bool, knows: bool, estimates: bool
    ) -> None:
        estimated = []

        class Estimator:
            def __init__(self, robot: Robot, config: Any) -> None:
                estimated.append(config)

            def reset(self, sensed: Any) -> None: ...

            def start(self) -> None: ...

            def update(self, *_: Any) -> tuple:
                return np.array([7.0, 0.0, 0.0]), 0.7

        monkeypatch.setattr(session, "_estimator", Estimator)
        policy = Hold(go1)
        policy.needs_estimate = needs
        base = (lambda: (np.array([5.0, 0.0, 0.0]), 0.5)) if knows else None
        run_session(go1, policy, FrameRobot(go1), session_of(), None, base)  # type: ignore[arg-type]
        assert estimated == [DeployConfig().estimator] * estimates
        seen = policy.seen[-1].base_velocity[0]
        assert seen == (7.0 if estimates else 5.0) or (np.isnan(seen) and not needs)

    @pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf, 86_401.0])
    def test_a_duration_without_sense_is_refused(self, go1: Robot, duration_s: float) -> None:
        with pytest.raises(UserError, match="above 0, and a day at most"):
            run_session(go1, Hold(go1), FrameRobot(go1), session_of(duration_s=duration_s))  # type: ignore[arg-type]

    def test_joints_are_asked_no_faster_than_their_fullest_bus_allows(self, go1: Robot) -> None:
        """Three motors on a bus, 111 bits there and as many back without stuffing: 1501.5 times a second."""
        wiring = wire(go1)
        driver = open_driver(wiring)
        session._check_joint_rate(wiring, driver, 1501.0)
        crowded = wiring.__class__(
            **{**vars(wiring), "channel": np.array([0, 0, 1, 2, 2, 2, 2, 3, 3, 3, 1, 1])}
        )
        session._check_joint_rate(crowded, driver, 1126.0)
        with pytest.raises(UserError, match=r"is 1127: 4 motors on can2 .* 1126 times"):
            session._check_joint_rate(crowded, driver, 1127.0)

    @pytest.mark.parametrize(
        ("model", "fastest_hz"),
        [("RS03", 1272), ("ODrive", 1107)],
    )
    def test_what_motors_of_a_maker_send_counts(self, go1: Robot, model: str, fastest_hz: int) -> None:
        """Three motors: 131 bits there and back; an ODrive has 79 there (4 bytes) and twice 111 back."""
        wiring = replace(wire(go1), models=(model,) * 12)
        driver = open_driver(wiring)
        session._check_joint_rate(wiring, driver, fastest_hz)
        with pytest.raises(UserError, match=f"3 motors on can0 can be asked {fastest_hz} times"):
            session._check_joint_rate(wiring, driver, fastest_hz + 1)

    def test_how_a_run_ended_is_told_as_it_was(self, go1: Robot) -> None:
        body = FrameRobot(go1)

        def mute(loop: ControlLoop) -> None:
            if loop.walking:
                body.silent = [4]

        outcome = run_session(go1, Hold(go1), body, session_of(duration_s=1.0), mute)  # type: ignore[arg-type]
        assert outcome.final_state == "ESTOP"
        assert outcome.faults == ("no reply from FL_thigh_joint (can1, id 2) for 50 ms",)
        assert outcome.walked_s == pytest.approx(0.052)  # the first tick past 50 ms
        assert outcome.wall_s > 0.0
        assert body.kinds() == [Request.DISABLE] * 12

    @pytest.mark.parametrize(("realtime", "spec"), [(False, "hold"), (True, "runs/mine")])
    def test_a_log_is_opened_with_what_is_known_of_the_run(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, tmp_path: Any, realtime: bool, spec: str
    ) -> None:
        from footfall.deploy import log as log_module

        opened: list[tuple] = []
        closed: list[int] = []

        class Log(Notebook):
            def __init__(self, *arguments: Any, may_wait: bool) -> None:
                super().__init__()
                opened.append((*arguments, may_wait))

            def close(self) -> str:
                closed.append(len(self.told))
                return "the log is short"

        monkeypatch.setattr(log_module, "McapLog", Log)
        monkeypatch.setattr(session.time, "time_ns", lambda: 123)
        config = DeployConfig(stand_s=0.01, joint_rate_hz=250.0)
        told = {"seed": 3} | ({"policy_spec": spec} if realtime else {})
        run = session_of(log=tmp_path / "a", facts=told, config=config, realtime=realtime)
        policy = Hold(go1)
        outcome = run_session(go1, policy, FrameRobot(go1), run)  # type: ignore[arg-type]
        facts = {"policy_spec": spec, "seed": 3, "joint_rate_hz": 250.0}
        assert opened == [(tmp_path / "a", go1, policy, facts, 123 if realtime else 0, not realtime)]
        assert outcome.notes == ("the log is short",)
        assert closed
        assert closed[0] > 5


def test_numbers_that_are_none_differ_from_those_that_are() -> None:
    again = np.array([1.0, 2.0, np.nan, np.nan, np.inf, np.inf, 3.0])
    before = np.array([1.0, 2.5, np.nan, 1.0, np.inf, -np.inf, np.nan])
    assert _difference(again, before).tolist() == [0.0, 0.5, 0.0, np.inf, 0.0, np.inf, np.inf]


def test_commands_inside_the_ranges_pass_as_they_are() -> None:
    from footfall.deploy.commands import CommandLimits

    limits = CommandLimits(CommandRange((-0.5, 1.0), (-0.2, 0.3), (-2.0, 1.5)))
    inside = np.array([-0.5, 0.3, 1.5])
    assert limits.apply(inside) is inside
    assert limits.apply(np.array([1.2, -0.3, -2.5])).tolist() == [1.0, -0.2, -2.0]
    assert limits.apply(np.array([-0.6, 0.4, 1.6])).tolist() == [-0.5, 0.3, 1.5]
    assert [note.split(" commands from ")[1] for note in limits.notes] == [
        "-0.5 to 1 m/s: 1.2 became 1",
        "-0.2 to 0.3 m/s: -0.3 became -0.2",
        "-2 to 1.5 rad/s: -2.5 became -2",
    ]
    assert limits.apply(np.array([0.1, math.inf, -math.inf])).tolist() == [0.1, 0.0, 0.0]
    assert len(limits.notes) == 3
