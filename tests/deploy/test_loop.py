"""The control loop tick by tick: sent and received frames, their times, and the log."""

import math
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold
from fake_estimator import FakeEstimator
from frame_robot import ROWS, TICK_US, Notebook
from loops import loop_of, until, walk_for

from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.modes import Mode
from footfall.deploy.orders import Order, OrderKind
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.operate.inbox import Inbox
from footfall.plant.motor_ends.motor_end import Request
from footfall.robots.description import Robot


def test_a_policy_sees_the_readings_of_the_frames(go1: Robot) -> None:
    policy = Hold(go1)
    names = ("rotation_rad", "drift_rad", "wander_rad", "creep_rad", "stuck_rad")
    unmoved = SensorLimits(**dict.fromkeys(names, 3.0), lateral_error=2.0, unexplained=10.0)  # readings jump
    source = lambda t: np.array([t, 2 * t, 3 * t])  # noqa: E731
    loop, body = loop_of(go1, policy, command_source=source, safety=SafetyConfig(sensors=unmoved))
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
    np.testing.assert_allclose(loop.requested_command, [0.02, 0.04, 0.06])


class TestFaults:
    @pytest.mark.parametrize(
        ("change", "fault", "mode"),
        [
            ({"silent": [7]}, "no reply from RR_thigh_joint (can2, id 2)", Mode.ESTOP),
            ({"silent": [6, 7, 8]}, "no reply from any motor on can2 for 50 ms", Mode.ESTOP),
            ({"silent": list(range(12))}, "no reply from any motor for 50 ms", Mode.ESTOP),
            ({"imu_silent": True}, "no new IMU reading", Mode.ESTOP),
            ({"error": 3 * (ROWS == 4).astype(np.uint64)}, "motor FL_thigh_joint (can1, id 2)", Mode.ESTOP),
            ({"refuses": 2}, "bus overflow: 2 frames refused", Mode.ESTOP),
            ({"bus_fault": "bus can2 is bus-off"}, "bus can2 is bus-off", Mode.ESTOP),
            ({"quaternion": (0.8, 0.0, 0.6, 0.0)}, "tilt of 1.29 rad", Mode.FALLING),
        ],
    )
    @pytest.mark.parametrize("before", [Mode.STANDING, Mode.WALKING])
    def test_a_fault_of_the_robot_is_named_and_damps_it(
        self, go1: Robot, change: dict[str, Any], fault: str, mode: Mode, before: Mode
    ) -> None:
        loop, body = loop_of(go1, Hold(go1))
        until(loop, before)
        loop.tick()
        for name, value in change.items():
            setattr(body, name, value)
        until(loop, mode, max_ticks=40)
        assert len(loop.state.faults) == 1
        assert loop.state.faults[0].startswith(fault)
        assert not body.command().kp.any()

    @pytest.mark.parametrize("part", ["receive", "stance", "command", "log", "frames", "send"])
    def test_after_any_exception_the_robot_is_damped_and_its_motors_disabled(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, part: str
    ) -> None:
        """The exception comes from the readings, policy, command source, log, joint layer or bus."""
        broken: list[str] = []

        def failing(name: str, works: Any) -> Any:
            def act(*arguments: Any) -> Any:
                if name in broken:
                    raise KeyError("no such\n thing")
                return works(*arguments)

            return act

        policy, log = Hold(go1), Notebook()
        policy.stance = failing("stance", policy.stance)  # type: ignore[method-assign]
        for name in ("tick", "state", "policy_step", "note"):
            setattr(log, name, failing("log", getattr(log, name)))
        log.odometry = lambda *_: None  # type: ignore[attr-defined]
        for name in ("command", "damping"):
            monkeypatch.setattr(JointLayer, name, failing("frames", getattr(JointLayer, name)))
        source = failing("command", lambda _: np.zeros(3))
        loop, body = loop_of(go1, policy, command_source=source, log=log, estimator=FakeEstimator())
        body.receive = failing("receive", body.receive)  # type: ignore[method-assign]
        body.send = failing("send", body.send)  # type: ignore[method-assign]
        until(loop, Mode.WALKING)
        for _ in range(5):
            loop.tick()
        broken.append(part)
        if part == "send":
            loop.tick()
            broken.clear()
        begun_us, ticks = loop.now_us, 0
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
        if part != "log":
            assert log.of("state")[-1][1].faults == loop.state.faults

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


class TestLog:
    def test_each_tick_step_and_change_is_logged(self, go1: Robot) -> None:
        policy, log = Hold(go1), Notebook()
        source = lambda t: np.array([math.nan if t > 0.03 else 0.5, 0.0, 0.0])  # noqa: E731
        loop, body = loop_of(go1, policy, command_source=source, log=log)
        until(loop, Mode.WALKING)
        for _ in range(30):
            loop.tick()
        assert [time_us for time_us, *_ in log.of("tick")] == list(range(0, 162_000, TICK_US))
        assert log.of("tick")[-1][1] is loop.sensed
        assert log.of("tick")[0][2] is not None
        sent = log.of("tick")[-1][2]
        np.testing.assert_array_equal(sent[0], loop.target)
        np.testing.assert_allclose(body.command().kp, sent[2], atol=0.2)  # a frame's rounding
        np.testing.assert_allclose(body.command().kd, sent[3], atol=0.01)
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
