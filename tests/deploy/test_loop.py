"""The control loop tick by tick: sent and received frames, their times, the base's estimate, and the log."""

import math
from itertools import count
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import Hold, short_episode, stand_still
from frame_robot import ROWS, TICK_US, Notebook
from loops import loop_of, simulated_loop, until, walk_for

from footfall import Robot, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.last_resort import DISABLE_TIMEOUT_US
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.orders import Order, OrderKind
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.operate.inbox import Inbox
from footfall.plant.motor_ends.motor_end import Request


def fake_estimator() -> Mock:
    """A base estimator that records its calls. The forward velocity, m/s, is the number of updates."""
    estimator = Mock(notes=())
    estimator.update.side_effect = ((np.array([updates, 0.0, 0.0]), 0.25) for updates in count(1))
    estimator.pose.return_value = 0.0, 0.0, 0.0
    estimator.odometry.return_value = None
    return estimator


def ticks(loop: ControlLoop, number: int) -> None:
    for _ in range(number):
        loop.tick()


def test_a_policy_sees_the_readings_of_the_frames(go1: Robot) -> None:
    policy = Hold(go1)
    names = ("rotation_rad", "drift_rad", "wander_rad", "creep_rad", "stuck_rad")
    unmoved = SensorLimits(**dict.fromkeys(names, 3.0), lateral_error=2.0, unexplained=10.0)  # readings jump
    safety = SafetyConfig(sensors=unmoved)
    loop, body = loop_of(go1, policy, command_source=lambda t: np.array([t, 2 * t, 3 * t]), safety=safety)
    until(loop, Mode.WALKING)
    body.readings = np.array([go1.default_pose + 0.01 * ROWS, 0.1 * ROWS, -0.2 * ROWS])
    body.gyro, body.quaternion = (0.1, 0.2, -0.3), (0.96, 0.0, 0.28, 0.0)
    ticks(loop, 10)
    seen = policy.seen[-1]
    assert loop.state.faults == ()
    joints = np.array([seen.sensed.joint_position, seen.sensed.joint_velocity, seen.sensed.joint_torque])
    np.testing.assert_allclose(joints, body.readings, atol=0.02)
    np.testing.assert_allclose(joints[0], body.readings[0], atol=3e-4)
    np.testing.assert_allclose(seen.sensed.gyro, body.gyro, atol=1e-3)
    np.testing.assert_allclose(seen.sensed.quaternion, body.quaternion, atol=1e-4)
    np.testing.assert_allclose(seen.sensed.acceleration, [0.0, 0.0, 9.8], atol=0.005)
    np.testing.assert_allclose([seen.command, loop.requested_command], [[0.02, 0.04, 0.06]] * 2)


def test_the_estimator_gets_the_policys_contact_plan_once_it_has_begun(go1: Robot) -> None:
    """The pose is set to zero where the policy takes over, after 0.1 s of standing."""
    plan = np.array([1.0, 0.0, 0.0, 1.0])
    policy, estimator = Hold(go1), fake_estimator()
    # Before its reset a policy has the plan of the last episode.
    policy.stance = lambda: plan if policy.resets else 0.0 * plan  # type: ignore[assignment,method-assign]
    loop = simulated_loop(go1, policy, estimator=estimator, estimator_rate_hz=30.0)
    until(loop, Mode.WALKING)
    walk_for(loop, 0.1)
    _, stances, steps_s = zip(*(call.args for call in estimator.update.mock_calls), strict=True)
    calls = [name for name, *_ in estimator.mock_calls if name in ("reset", "start", "update")]
    assert calls == ["reset", "update", "update", "start", *["update"] * (len(stances) - 2)]
    assert stances[:3] == (None,) * 3
    assert all(stance is plan for stance in stances[3:])
    np.testing.assert_allclose(steps_s[:2], 0.034, atol=1e-9)  # 1/30 s, at the next tick
    np.testing.assert_allclose(steps_s[3:], 0.02, atol=1e-9)
    assert [seen.base_velocity[0] for seen in policy.seen] == [3, 4, 5, 6, 7, 8]  # one at each policy step
    assert policy.seen[-1].base_height == 0.25


class TestFaults:
    @pytest.mark.parametrize("before", [Mode.STANDING, Mode.WALKING])
    def test_a_fault_of_the_robot_is_named_and_damps_it(self, go1: Robot, before: Mode) -> None:
        for change, fault, mode in (
            ({"silent": [7]}, "no reply from RR_thigh_joint (can2, id 2)", Mode.ESTOP),
            ({"silent": [6, 7, 8]}, "no reply from any motor on can2 for 50 ms", Mode.ESTOP),
            ({"silent": list(range(12))}, "no reply from any motor for 50 ms", Mode.ESTOP),
            ({"imu_silent": True}, "no new IMU reading", Mode.ESTOP),
            ({"error": 3 * (ROWS == 4).astype(np.uint64)}, "motor FL_thigh_joint (can1, id 2)", Mode.ESTOP),
            ({"refuses": 2}, "bus overflow: 2 frames refused", Mode.ESTOP),
            ({"bus_fault": "bus can2 is bus-off"}, "bus can2 is bus-off", Mode.ESTOP),
            ({"quaternion": (0.8, 0.0, 0.6, 0.0)}, "tilt of 1.29 rad", Mode.FALLING),
        ):
            loop, body = loop_of(go1, Hold(go1))
            until(loop, before)
            loop.tick()
            vars(body).update(change)
            until(loop, mode, max_ticks=40)
            (found,) = loop.state.faults
            assert found.startswith(fault)
            assert not body.command().kp.any(), fault

    @pytest.mark.parametrize("part", ["reading", "sending", "policy", "command source", "log", "joint layer"])
    def test_an_exception_damps_the_robot(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, part: str
    ) -> None:
        """Its motors are disabled afterwards."""
        policy, log, source = Hold(go1), Notebook(), Mock(spec=stand_still, return_value=np.zeros(3))
        loop, body = loop_of(go1, policy, command_source=source, log=log, estimator=fake_estimator())
        until(loop, Mode.WALKING)
        ticks(loop, 5)
        owner, *methods = {
            "reading": (body, "receive"),
            "sending": (body, "send"),
            "policy": (policy, "stance"),
            "command source": (source, "side_effect"),
            "log": (log, "tick", "state", "policy_step", "note"),
            "joint layer": (JointLayer, "command", "damping"),
        }[part]
        for method in methods:
            monkeypatch.setattr(owner, method, Mock(side_effect=KeyError("no such\n thing")))
        if part == "sending":
            loop.tick()
            monkeypatch.undo()
        begun_us = loop.now_us
        while loop.tick():
            if loop.state.mode is Mode.ESTOP:
                assert not body.command().kp.any()
                np.testing.assert_allclose(body.command().kd, 3.0, atol=0.01)
            else:
                assert loop.now_us <= begun_us + 10 * TICK_US
        (fault,) = loop.state.faults
        assert "KeyError: 'no such" in fault
        assert "\n" not in fault
        assert body.kinds() == [Request.DISABLE] * 12
        assert 0.49 < (loop.now_us - begun_us) * 1e-6 < 0.53
        assert loop.walked_s > 0.0
        if part != "log":
            assert log.of("state")[-1][1].faults == loop.state.faults

    def test_a_bus_too_small_for_its_motors_overflows_into_an_emergency_stop(self, go1: Robot) -> None:
        trace = run_episode(go1, Hold(go1), short_episode(config=DeployConfig(host_queue=2)))
        assert trace.final_state == "ESTOP"
        assert "bus overflow" in trace.faults[0]

    @pytest.mark.parametrize("failed", [False, True])
    def test_a_run_that_a_guard_ended_has_its_fault_and_time(self, go1: Robot, failed: bool) -> None:
        """The fault is recorded even after another fault."""
        taken: list[bool] = []
        log = Notebook()
        loop, body = loop_of(go1, Hold(go1), log=log, taken_over=lambda: bool(taken))
        until(loop, Mode.WALKING)
        walk_for(loop, 0.05)
        if failed:
            body.bus_fault = "bus can2 is bus-off"
            until(loop, Mode.ESTOP)
        sent = len(body.sent)
        taken.append(True)
        assert not loop.tick()
        assert len(body.sent) == sent  # no frame after the guard's damping
        assert failed or loop.walked_s == pytest.approx(0.052)
        assert (loop.state.mode, loop.state.over) == (Mode.ESTOP, True)
        assert len(loop.state.faults) == 1 + failed
        assert "guard" in loop.state.faults[-1]
        assert log.of("state")[-1] == (loop.now_us, loop.state)

    @pytest.mark.parametrize("part", ["silent", "on"])
    def test_motors_that_do_not_confirm_disable_are_named(self, go1: Robot, part: str) -> None:
        """After 0.25 s. One motor never replies, or replies and stays enabled: it reports a torque."""
        loop, body = loop_of(go1, Hold(go1))
        until(loop, Mode.WALKING)
        if part == "silent":
            body.silent = [7]
        else:
            body.readings[2, 7] = 2.0
        sent = len(body.sent)
        loop.shut_down()
        times_us = [at_us - loop.now_us for at_us, _ in body.sent[sent:]]
        assert times_us == list(range(TICK_US, DISABLE_TIMEOUT_US + 2 * TICK_US, TICK_US))
        assert body.kinds() == [Request.DISABLE] * 12
        named = {"silent": loop.last_resort.silent_at_the_end, "on": loop.last_resort.on_at_the_end}
        assert named == {"silent": [], "on": []} | {part: ["RR_thigh_joint (can2, id 2)"]}


class TestRecord:
    def test_an_orderly_run_ends_idle_and_is_recorded_at_the_record_rate(self, go1: Robot) -> None:
        """The policy gets the ground truth instead of an estimate."""
        trace = run_episode(go1, Hold(go1), short_episode(ground_truth=True))
        assert (trace.final_state, trace.faults, trace.fell, trace.fall_reason) == ("IDLE", (), False, "")
        np.testing.assert_allclose(trace.time_s, np.arange(101) / 100, atol=1e-9)
        assert len(trace.compute_ms) == 51
        np.testing.assert_allclose(trace.estimated_velocity, trace.base_velocity, atol=1e-9)
        assert trace.estimated_height[-1] == pytest.approx(trace.base_position[-1, 2], abs=0.03)

    def test_each_tick_step_and_change_is_logged(self, go1: Robot) -> None:
        def source(time_s: float) -> np.ndarray:
            return np.array([math.nan if time_s > 0.03 else 0.5, 0.0, 0.0])

        policy, log = Hold(go1), Notebook()
        loop, body = loop_of(go1, policy, command_source=source, log=log)
        until(loop, Mode.WALKING)
        ticks(loop, 30)
        first, *_, last = logged = log.of("tick")
        assert [time_us for time_us, *_ in logged] == list(range(0, 162_000, TICK_US))
        assert last[1] is loop.sensed
        assert first[2] is not None
        np.testing.assert_array_equal(last[2][0], loop.target)
        np.testing.assert_allclose(body.command().kp, last[2][2], atol=0.2)  # a frame's rounding
        np.testing.assert_allclose(body.command().kd, last[2][3], atol=0.01)
        states = [(time_us, state.mode) for time_us, state in log.of("state")]
        assert states == [(0, Mode.STANDING), (100_000, Mode.WALKING)]
        steps = log.of("policy_step")
        assert [time_us for time_us, *_ in steps] == [100_000, 120_000, 140_000, 160_000]
        assert [each[1] for each in steps] == policy.seen
        np.testing.assert_array_equal(steps[0][2].position, go1.default_pose)
        assert log.of("note") == [(140_000, "a forward command of nan m/s was replaced with 0")]

    def test_an_order_is_logged_at_once_with_its_author_in_every_mode(self, go1: Robot) -> None:
        log, inbox = Notebook(), Inbox()
        loop, _ = loop_of(go1, Hold(go1), command_source=inbox, log=log, lie_down=True)
        until(loop, Mode.STANDING)
        inbox.take_over("page 1")
        until(loop, Mode.WALKING)
        assert [order for _, order in log.of("order")] == [Order(OrderKind.STEER, "page 1")]
        loop.finish()
        until(loop, Mode.LOWERING)
        inbox.stop("page 2")
        loop.tick()
        at_us, order = log.of("order")[-1]
        assert (at_us, order.kind, order.by) == (loop.now_us, OrderKind.STOP, "page 2")
