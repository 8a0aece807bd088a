"""A session around its loop: signals, interfaces that are released, and defaults."""

import math
import signal
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from frame_robot import TICK_US, FrameRobot, Notebook
from relaxed_limits import RELAXED

from footfall import Robot, UserError, load_robot
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


class TestInterface:
    @pytest.fixture
    def opened(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """The opened interfaces, and "closed" once they are closed."""
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
        with pytest.raises(RuntimeError) if fails else nullcontext():
            run_on_interface(go1, Hold(go1), "socketcan", run)
        assert handed == [(go1, "hold", replace(run, stop_inputs=True))]
        (interface, names, filters), closed = opened
        assert (interface, closed) == ("socketcan", "closed")
        assert names == ("can0", "can1", "can2", "can3")
        assert filters == (*MitDriver.filters, *imu.ImuReader.filters)


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
    with pytest.raises(UserError, match=r"joint_rate_hz .*1600"):
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
        ("robot", "changes", "message"),
        [
            ("go1", {}, "3 motors on can0 .* 1234 Hz"),  # at most 135 bits there and as many back
            ("go1", MANY_ON_CAN2, "4 motors on can2 .* 925 Hz"),
            ("go1", {"models": ("RS03",) * 12}, "3 motors on can0 .* 1041 Hz"),  # 160 bits there and back
            ("hexapod", {"models": ("ODrive",) * 18}, "6 motors on can0 .* 456 Hz"),
        ],
    )
    def test_the_fullest_bus_limits_the_rate(self, robot: str, changes: dict[str, Any], message: str) -> None:
        wiring = replace(wiring_of(load_robot(robot)), **changes)
        fastest_hz = int(message.split()[-2])
        check_joint_rate(wiring, open_driver(wiring), fastest_hz)
        with pytest.raises(UserError, match=message):
            check_joint_rate(wiring, open_driver(wiring), fastest_hz + 1)
