"""A session about its loop: signals, interfaces that are let go of, and what it is told by default."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from frame_robot import FrameRobot, Notebook
from relaxed_limits import RELAXED

from footfall.common.errors import UserError
from footfall.deploy import session
from footfall.deploy.bus import HOST_QUEUE
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.session import Session, run_on_interface
from footfall.deploy.timing import KEPT, Durations, Timing
from footfall.policies.contract import Contract
from footfall.robots.description import Robot


class TestSignals:
    @pytest.fixture
    def loop(self) -> Any:
        loop = SimpleNamespace(asked=0)
        loop.finish = lambda: setattr(loop, "asked", loop.asked + 1)
        return loop

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_ctrl_c_and_a_polite_kill_ask_for_an_orderly_end(self, loop: Any, number: int) -> None:
        before = signal.getsignal(number)
        with session._ending_on_signals(loop):
            signal.raise_signal(number)
            assert loop.asked == 1
            signal.raise_signal(number)  # an impatient one
        assert loop.asked == 2
        assert signal.getsignal(number) is before

    def test_signals_are_given_back_whatever_happens(self, loop: Any) -> None:
        before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
        with pytest.raises(RuntimeError), session._ending_on_signals(loop):
            raise RuntimeError
        assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before

    def test_a_thread_that_gets_no_signals_runs_all_the_same(self, loop: Any) -> None:
        ran: list[bool] = []

        def run() -> None:
            with session._ending_on_signals(loop):
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

    def test_it_hears_motors_and_imu_of_every_bus_and_is_let_go_of(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        run = Session(stand_still, 1.0)
        monkeypatch.setattr(session, "run_session", lambda *given: given)
        robot, policy, _, handed = run_on_interface(go1, Hold(go1), "socketcan", run)  # type: ignore[misc]
        assert (robot, policy.name, handed) == (go1, "hold", run)
        (interface, names, filters), closed = opened
        assert (interface, closed) == ("socketcan", "closed")
        assert names == ("can0", "can1", "can2", "can3")
        assert filters == (*MitDriver.filters, *imu.FILTERS)

    def test_also_where_a_run_fails(
        self, go1: Robot, opened: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: Any) -> None:
            raise RuntimeError("no")

        monkeypatch.setattr(session, "run_session", fail)
        with pytest.raises(RuntimeError, match="no"):
            run_on_interface(go1, Hold(go1), "socketcan", Session(stand_still, 1.0))
        assert opened[1:] == ["closed"]


@pytest.mark.parametrize("realtime", [False, True])
def test_only_a_run_by_the_wall_clock_is_left_undisturbed_at_its_priority(
    go1: Robot, monkeypatch: pytest.MonkeyPatch, realtime: bool
) -> None:
    asked: list[Any] = []

    @contextmanager
    def undisturbed(priority: int | None) -> Iterator[list[str]]:
        asked.append(priority)
        yield ["not permitted"]
        asked.append("over")

    monkeypatch.setattr(session, "undisturbed", undisturbed)
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


def test_a_policy_of_another_contract_is_refused_before_anything_is_sent(
    go1: Robot, contract: Contract
) -> None:
    body, policy = FrameRobot(go1), Hold(go1)
    policy.contract = replace(contract, robot="go2")
    with pytest.raises(UserError, match="policy 'hold' does not fit robot 'go1': robot: policy has go2"):
        session.run_session(go1, policy, body, Session(stand_still, 1.0, False))  # type: ignore[arg-type]
    assert body.sent == []


def test_what_nobody_says_is_wall_clock_time_without_a_log() -> None:
    plain = Session(stand_still, 1.0)
    assert plain.realtime
    assert plain.log is None
    assert plain.facts == {}
    assert plain.config == DeployConfig()


def test_limits_that_nobody_sets() -> None:
    """As docs/safety.md has them."""
    plain = SafetyConfig()
    assert (plain.start_timeout_s, plain.silence_timeout_s, plain.tilt_limit_rad) == (1.0, 0.05, 1.05)
    assert (plain.late_steps, plain.late_limit_s, plain.damping_kd, plain.damping_s) == (5, 0.07, 3.0, 0.5)
    assert (plain.pause_limit_s, plain.guard_share) == (0.07, 1.1)
    assert plain.guard_after_s == pytest.approx(0.077)
    assert replace(plain, late_limit_s=0.03).guard_after_s == pytest.approx(0.077)  # the longer one counts
    assert replace(plain, pause_limit_s=0.03).guard_after_s == pytest.approx(0.077)
    assert HOST_QUEUE == 10  # what Linux has


class TestTiming:
    def test_two_minutes_of_ticks_at_500_hz_are_kept(self) -> None:
        assert KEPT >= 120 * 500
        kept = Durations()
        for value in (3.0, 1.0, 2.0):
            kept.add(value)
        assert kept.values().tolist() == [3.0, 1.0, 2.0]

    def test_the_longest_is_of_all_and_the_rest_of_the_last(self) -> None:
        timing = Timing(Durations(4), Durations(4), Durations(4))
        for value in (90.0, 1.0, 2.0, 3.0, 4.0):
            timing.lateness_us.add(10 * value)
            timing.tick_us.add(value)
        for value in (0.5, 0.25):
            timing.policy_ms.add(value)
        figures = timing.summary()
        assert figures["ticks"] == 5.0
        assert (figures["tick_us_p50"], figures["tick_us_max"]) == (2.5, 90.0)
        assert (figures["lateness_us_p50"], figures["lateness_us_max"]) == (25.0, 900.0)
        assert figures["tick_us_p99"] == pytest.approx(np.percentile([1.0, 2.0, 3.0, 4.0], 99))
        assert (figures["policy_ms_p50"], figures["policy_ms_max"]) == (0.375, 0.5)
