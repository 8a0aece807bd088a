"""A session about its loop: signals, interfaces that are let go of, and what it is told by default."""

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
from frame_robot import TICK_US, FrameRobot, Notebook
from odrives import with_odrives
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
from footfall.deploy.wiring import wire
from footfall.plant.motor_ends.motor_end import Request
from footfall.policies.contract import Contract
from footfall.robots.description import Robot, load_robot


class TestSignals:
    @pytest.fixture
    def loop(self) -> Any:
        loop = SimpleNamespace(asked=0)
        loop.finish = lambda: setattr(loop, "asked", loop.asked + 1)
        return loop

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGQUIT, signal.SIGUSR1, signal.SIGXCPU])
    def test_ctrl_c_and_a_polite_kill_ask_for_an_orderly_end(self, loop: Any, number: int) -> None:
        before = signal.getsignal(number)
        with ending_on_signals(loop.finish):
            signal.raise_signal(number)
            assert loop.asked == 1
            signal.raise_signal(number)  # an impatient one
        assert loop.asked == 2
        assert signal.getsignal(number) is before

    def test_a_terminal_that_goes_away_tells_it_twice_and_means_it_once(self, loop: Any) -> None:
        with ending_on_signals(loop.finish):
            signal.raise_signal(signal.SIGHUP)
            signal.raise_signal(signal.SIGHUP)
        assert loop.asked == 1

    def test_signals_are_given_back_whatever_happens(self, loop: Any) -> None:
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        with pytest.raises(RuntimeError), ending_on_signals(loop.finish):
            raise RuntimeError
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before

    def test_a_thread_that_gets_no_signals_runs_all_the_same(self, loop: Any) -> None:
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

    def test_every_bus_is_used(self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
        run = Session(stand_still, 1.0)
        monkeypatch.setattr(session, "run_session", lambda *given: given)
        robot, policy, _, handed = run_on_interface(go1, Hold(go1), "socketcan", run)  # type: ignore[misc]
        assert (robot, policy.name, handed) == (go1, "hold", replace(run, stop_inputs=True))
        (interface, names, filters), closed = opened
        assert (interface, closed) == ("socketcan", "closed")
        assert names == ("can0", "can1", "can2", "can3")
        assert filters == (*MitDriver.filters, *imu.ImuReader.filters)

    def test_also_where_a_run_fails(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: Any) -> None:
            raise RuntimeError("no")

        monkeypatch.setattr(session, "run_session", fail)
        with pytest.raises(RuntimeError, match="no"):
            run_on_interface(go1, Hold(go1), "socketcan", Session(stand_still, 1.0))
        assert opened[1:] == ["closed"]

    @pytest.mark.parametrize("kind", ["socketcan", "udp_multicast", "slcan", "virtual"])
    def test_a_second_run_on_buses_that_processes_share_is_refused_before_it_opens_them(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch, kind: str
    ) -> None:
        first, second = Session(stand_still, 1.0), Session(stand_still, 2.0)

        def run(robot: Robot, policy: Hold, _: Any, given: Session) -> Any:
            return given.duration_s == second.duration_s or run_on_interface(robot, policy, kind, second)

        monkeypatch.setattr(session, "run_session", run)
        if kind == "virtual":
            assert run_on_interface(go1, Hold(go1), kind, first)
            return
        with pytest.raises(UserError, match=r"bus can0 .* is in use by this process"):
            run_on_interface(go1, Hold(go1), kind, first)
        assert len(opened) == 2  # by the first, and closed


@pytest.mark.parametrize("realtime", [False, True])
def test_wall_clock_runs_are_undisturbed(go1: Robot, monkeypatch: pytest.MonkeyPatch, realtime: bool) -> None:
    asked: list[Any] = []

    @contextmanager
    def undisturbed(priority: int | None) -> Iterator[list[str]]:
        asked.append(priority)
        yield ["not permitted"]
        asked.append("over")

    monkeypatch.setattr(drive, "undisturbed", undisturbed)
    safety = replace(RELAXED.safety, damping_s=0.01)
    config = replace(RELAXED, stand_s=0.01, realtime_priority=42, safety=safety)
    run = Session(stand_still, 0.004, realtime, config=config)
    log = Notebook()
    log.close = lambda: ""  # type: ignore[attr-defined]
    monkeypatch.setattr(session, "_open_log", lambda *_: log)
    outcome = session.run_session(go1, Hold(go1), FrameRobot(go1), run)  # type: ignore[arg-type]
    assert log.of("note") == ([(0, "not permitted")] if realtime else [])
    assert asked == ([42, "over"] if realtime else [])
    assert outcome.notes == (("not permitted",) if realtime else ())


def test_a_rate_that_no_bus_can_carry_is_refused_before_anything_is_sent(go1: Robot) -> None:
    body = FrameRobot(go1)
    run = Session(stand_still, 1.0, False, config=DeployConfig(joint_rate_hz=1600.0))
    with pytest.raises(UserError, match="joint_rate_hz is 1600"):
        session.run_session(go1, Hold(go1), body, run)  # type: ignore[arg-type]
    assert body.sent == []


def test_another_contract_is_refused_before_anything_is_sent(go1: Robot, contract: Contract) -> None:
    body, policy = FrameRobot(go1), Hold(go1)
    policy.contract = replace(contract, robot="go2")
    with pytest.raises(UserError, match="policy 'hold' does not fit robot 'go1': robot: policy has go2"):
        session.run_session(go1, policy, body, Session(stand_still, 1.0, False))  # type: ignore[arg-type]
    assert body.sent == []


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
        assert outcome.notes == ("a forward command of nan m/s was replaced with 0",)
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
            notes = ()

            def __init__(self, robot: Robot, config: Any) -> None:
                estimated.append(config)

            def reset(self, sensed: Any) -> None: ...

            def start(self) -> None: ...

            def update(self, *_: Any) -> tuple:
                return np.array([7.0, 0.0, 0.0]), 0.7

            def pose(self) -> tuple[float, float, float]:
                return 0.0, 0.0, 0.0

        monkeypatch.setattr("footfall.deploy.estimation.estimator.BaseEstimator", Estimator)
        policy = Hold(go1)
        policy.needs_estimate = needs
        base = (lambda: (np.array([5.0, 0.0, 0.0]), 0.5)) if knows else None
        run_session(go1, policy, FrameRobot(go1), session_of(), None, base)  # type: ignore[arg-type]
        assert estimated == [DeployConfig().estimator] * estimates
        seen = policy.seen[-1].base_velocity[0]
        assert seen == (7.0 if estimates else 5.0) or (np.isnan(seen) and not needs)

    @pytest.mark.parametrize("duration_s", [0.0, -1.0, math.nan, math.inf, 86_401.0])
    def test_a_duration_without_sense_is_refused(self, go1: Robot, duration_s: float) -> None:
        with pytest.raises(UserError, match="positive, and at most a day"):
            run_session(go1, Hold(go1), FrameRobot(go1), session_of(duration_s=duration_s))  # type: ignore[arg-type]

    def test_joints_are_asked_no_faster_than_their_fullest_bus_allows(self, go1: Robot) -> None:
        """Three motors on a bus, at most 135 bits there and as many back: 1234.6 times a second."""
        wiring = wire(go1)
        driver = open_driver(wiring)
        check_joint_rate(wiring, driver, 1234.0)
        crowded = wiring.__class__(
            **{**vars(wiring), "channel": np.array([0, 0, 1, 2, 2, 2, 2, 3, 3, 3, 1, 1])}
        )
        check_joint_rate(crowded, driver, 925.0)
        with pytest.raises(UserError, match=r"is 926: 4 motors on can2 .* 925 Hz"):
            check_joint_rate(crowded, driver, 926.0)

    @pytest.mark.parametrize(("model", "fastest_hz"), [("RS03", 1041), ("ODrive", 913)])
    def test_what_motors_of_a_maker_send_counts(self, go1: Robot, model: str, fastest_hz: int) -> None:
        """Three motors: 160 bits there and back; an ODrive has 95 there (4 bytes) and twice 135 back."""
        wiring = replace(wire(go1), models=(model,) * 12)
        driver = open_driver(wiring)
        check_joint_rate(wiring, driver, fastest_hz)
        with pytest.raises(UserError, match=f"3 motors on can0 allow at most {fastest_hz} Hz"):
            check_joint_rate(wiring, driver, fastest_hz + 1)

    def test_six_odrives_on_a_bus_are_refused_before_it_overflows(self) -> None:
        """At 500 Hz they fit without stuff bits alone; the hexapod's own motors do in any case."""
        hexapod = load_robot("hexapod")
        check_joint_rate(wire(hexapod), open_driver(wire(hexapod)), 500.0)
        wiring = wire(with_odrives(hexapod, "servo"))
        with pytest.raises(UserError, match=r"6 motors on can0 .* 456 Hz.* joint_rate_hz .* another bus"):
            check_joint_rate(wiring, open_driver(wiring), 500.0)

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

    @pytest.mark.parametrize("realtime", [False, True])
    def test_a_log_waits_for_the_disk_in_lockstep_alone_and_its_end_is_told(
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
