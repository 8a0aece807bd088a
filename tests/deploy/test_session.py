"""A session around its loop: signals, interfaces that are released, and defaults."""

import math
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from fake_estimator import FakeEstimator
from frame_robot import TICK_US, FrameRobot, Notebook
from relaxed_limits import RELAXED

from footfall.common.errors import UserError
from footfall.deploy import drive, session
from footfall.deploy.bus import BusStatistics
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.fit import check_joint_rate
from footfall.deploy.loop import ControlLoop
from footfall.deploy.process_end import ending_on_signals
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.session import Session, run_on_interface, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.motor_end import Request
from footfall.policies.contract import Contract
from footfall.robots.description import Robot, load_robot


class TestSignals:
    @pytest.fixture
    def loop(self) -> Any:
        loop = SimpleNamespace(calls=0)
        loop.finish = lambda: setattr(loop, "calls", loop.calls + 1)
        return loop

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT, signal.SIGUSR1, signal.SIGXCPU])
    def test_a_signal_asks_for_an_orderly_end(self, loop: Any, number: int) -> None:
        before = signal.getsignal(number)
        with ending_on_signals(loop.finish):
            signal.raise_signal(number)
            assert loop.calls == 1
            signal.raise_signal(number)  # a second signal
        assert loop.calls == 2
        assert signal.getsignal(number) is before

    def test_a_second_hangup_while_the_first_is_handled_counts_with_it(self) -> None:
        calls: list[int] = []

        def finish() -> None:
            calls.append(1)
            if len(calls) < 5:
                signal.raise_signal(signal.SIGHUP)

        with ending_on_signals(finish):
            signal.raise_signal(signal.SIGHUP)
        assert calls == [1]

    def test_signal_handlers_are_restored_and_threads_without_signals_run(self, loop: Any) -> None:
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        with pytest.raises(RuntimeError), ending_on_signals(loop.finish):
            raise RuntimeError
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
        ran: list[bool] = []

        def run() -> None:
            with ending_on_signals(loop.finish):
                ran.append(True)

        thread = threading.Thread(target=run)
        thread.start()
        thread.join()
        assert ran == [True]


class TestInterface:
    @pytest.fixture
    def opened(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """What was opened, and whether it was closed."""
        found: list[Any] = []

        class Bus:
            def __init__(self, *given: Any) -> None:
                found.append(given)

            def close(self) -> None:
                found.append("closed")

        monkeypatch.setattr("footfall.deploy.interfaces.open_interfaces", Bus)
        return found

    @pytest.mark.parametrize("fails", [False, True])
    def test_every_bus_is_opened_and_closed_again(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch, fails: bool
    ) -> None:
        run, handed = Session(stand_still, 1.0), []

        def run_or_fail(*given: Any) -> None:
            handed.append((given[0], given[1].name, given[3]))
            if fails:
                raise RuntimeError("no")

        monkeypatch.setattr(session, "run_session", run_or_fail)
        with pytest.raises(RuntimeError, match="no") if fails else nullcontext():
            run_on_interface(go1, Hold(go1), "socketcan", run)
        assert handed == [(go1, "hold", replace(run, stop_inputs=True))]
        (interface, names, filters), closed = opened
        assert (interface, closed) == ("socketcan", "closed")
        assert names == ("can0", "can1", "can2", "can3")
        assert filters == (*MitDriver.filters, *imu.ImuReader.filters)

    @pytest.mark.parametrize("kind", ["socketcan", "udp_multicast", "slcan", "virtual"])
    def test_a_second_run_on_shared_buses_is_refused_before_it_opens_them(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch, kind: str
    ) -> None:
        first, second = Session(stand_still, 1.0), Session(stand_still, 2.0)

        def run(robot: Robot, policy: Hold, _: Any, given: Session) -> Any:
            return given.duration_s == second.duration_s or run_on_interface(robot, policy, kind, second)

        monkeypatch.setattr(session, "run_session", run)
        if kind == "virtual":
            assert run_on_interface(go1, Hold(go1), kind, first)
            return
        with pytest.raises(UserError, match=r"bus can0 "):
            run_on_interface(go1, Hold(go1), kind, first)
        assert len(opened) == 2  # by the first, and closed


@pytest.mark.parametrize("realtime", [False, True])
def test_wall_clock_runs_are_undisturbed(go1: Robot, monkeypatch: pytest.MonkeyPatch, realtime: bool) -> None:
    calls: list[Any] = []

    @contextmanager
    def undisturbed(priority: int | None) -> Iterator[list[str]]:
        calls.append(priority)
        yield ["not permitted"]
        calls.append("over")

    monkeypatch.setattr(drive, "undisturbed", undisturbed)
    safety = replace(RELAXED.safety, damping_s=0.01)
    config = replace(RELAXED, stand_s=0.01, realtime_priority=42, safety=safety)
    run = Session(stand_still, 0.004, realtime, config=config)
    log = Notebook()
    log.close = lambda: ""  # type: ignore[attr-defined]
    monkeypatch.setattr(session, "_open_log", lambda *_: log)
    outcome = session.run_session(go1, Hold(go1), FrameRobot(go1), run)  # type: ignore[arg-type]
    assert log.of("note") == ([(0, "not permitted")] if realtime else [])
    assert calls == ([42, "over"] if realtime else [])
    assert outcome.notes == (("not permitted",) if realtime else ())


def test_a_wrong_rate_or_contract_is_refused_before_anything_is_sent(go1: Robot, contract: Contract) -> None:
    body, policy = FrameRobot(go1), Hold(go1)
    fast = Session(stand_still, 1.0, False, config=DeployConfig(joint_rate_hz=1600.0))
    with pytest.raises(UserError, match="joint_rate_hz is 1600"):
        session.run_session(go1, policy, body, fast)  # type: ignore[arg-type]
    policy.contract = replace(contract, robot="go2")
    with pytest.raises(UserError, match=r"'hold'.*'go1'.*go2"):
        session.run_session(go1, policy, body, Session(stand_still, 1.0, False))  # type: ignore[arg-type]
    assert body.sent == []


def session_of(**settings: Any) -> Session:
    config = DeployConfig(stand_s=0.02, safety=SafetyConfig(still_s=0.0, damping_s=0.01))
    plain = {"command_source": stand_still, "duration_s": 0.03, "realtime": False}
    return Session(**plain | {"config": config, "lie_down": False} | settings)


MANY_ON_CAN2 = {"channel": np.array([0, 0, 1, 2, 2, 2, 2, 3, 3, 3, 1, 1]), "motor_id": np.arange(1, 13)}


class TestSession:
    def test_the_outcome_of_an_orderly_run(self, go1: Robot) -> None:
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
        assert outcome.notes == ("a forward command of nan m/s was replaced with 0",)
        assert ticks == list(range(0, 62_000, TICK_US))
        assert len(shown) == 1
        assert body.kinds() == [Request.DISABLE] * 12

    @pytest.mark.parametrize(
        ("needs", "knows", "seen_m_s"), [(True, False, 10.0), (False, False, np.nan), (True, True, 0.5)]
    )
    def test_the_base_is_estimated_if_a_policy_needs_it_and_ground_truth_is_not_given(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, needs: bool, knows: bool, seen_m_s: float
    ) -> None:
        monkeypatch.setattr("footfall.deploy.estimation.estimator.BaseEstimator", FakeEstimator)
        policy = Hold(go1)
        policy.needs_estimate = needs
        base = (lambda: (np.array([0.5, 0.0, 0.0]), 0.5)) if knows else None
        run_session(go1, policy, FrameRobot(go1), session_of(), None, base)  # type: ignore[arg-type]
        np.testing.assert_equal(policy.seen[-1].base_velocity[0], seen_m_s)  # 10 updates before

    @pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf, 86_401.0])
    def test_a_duration_outside_a_day_is_refused(self, go1: Robot, duration_s: float) -> None:
        with pytest.raises(UserError):
            run_session(go1, Hold(go1), FrameRobot(go1), session_of(duration_s=duration_s))  # type: ignore[arg-type]

    @pytest.mark.parametrize(
        ("robot", "changes", "message"),
        [
            ("go1", {}, "3 motors on can0 .* 1234 Hz"),  # at most 135 bits there and as many back
            ("go1", MANY_ON_CAN2, "4 motors on can2 .* 925 Hz"),
            ("go1", {"models": ("RS03",) * 12}, "3 motors on can0 .* 1041 Hz"),  # 160 bits there and back
            (
                "go1",
                {"models": ("ODrive",) * 12},
                "3 motors on can0 .* 913 Hz",
            ),  # 95 there and twice 135 back
            ("hexapod", {"models": ("ODrive",) * 18}, "6 motors on can0 .* 456 Hz"),
        ],
    )
    def test_the_joint_rate_is_limited_by_the_fullest_bus(
        self, robot: str, changes: dict[str, Any], message: str
    ) -> None:
        wiring = replace(wiring_of(load_robot(robot)), **changes)
        fastest_hz = int(message.split()[-2])
        check_joint_rate(wiring, open_driver(wiring), fastest_hz)
        with pytest.raises(UserError, match=message):
            check_joint_rate(wiring, open_driver(wiring), fastest_hz + 1)

    @pytest.mark.parametrize("realtime", [False, True])
    def test_a_log_waits_for_the_disk_only_in_lockstep_and_its_end_is_noted(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, tmp_path: Any, realtime: bool
    ) -> None:
        waits: list[bool] = []

        class Log(Notebook):
            def __init__(
                self, path: Any, robot: Robot, policy: Any, facts: Any, may_wait: bool, *_: Any
            ) -> None:
                super().__init__()
                waits.append(may_wait)

            def close(self) -> str:
                return "the log is short"

        monkeypatch.setattr("footfall.deploy.log.McapLog", Log)
        config = DeployConfig(stand_s=0.01, joint_rate_hz=250.0)
        run = session_of(log=tmp_path / "a", config=config, realtime=realtime)
        outcome = run_session(go1, Hold(go1), FrameRobot(go1), run)  # type: ignore[arg-type]
        assert waits == [not realtime]
        assert outcome.notes == ("the log is short",)
