"""A session around its loop: signals, interfaces that are released, wall-clock time, late policies."""

import fcntl
import math
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import FailingPolicy, Hold, short_episode, slow, stand_still
from frame_robot import TICK_US, FrameRobot, Notebook
from relaxed_limits import RELAXED

from footfall import Robot, UserError, load_robot, run_episode
from footfall.deploy import run_loop, session
from footfall.deploy.bus import BusStatistics
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.fit import check_joint_rate
from footfall.deploy.process_end import ending_on_signals
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.session import Session, run_on_interface, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.motor_end import Request
from footfall.policies.contract import Contract


def test_each_signal_asks_for_an_orderly_end() -> None:
    for number in (signal.SIGINT, signal.SIGQUIT, signal.SIGUSR1, signal.SIGXCPU):
        before, finish = signal.getsignal(number), Mock()
        with ending_on_signals(finish):
            for count in (1, 2):
                signal.raise_signal(number)
                assert finish.call_count == count
        assert signal.getsignal(number) is before


@pytest.mark.parametrize("fails", [False, True])
def test_every_bus_is_opened_and_closed_again(
    go1: Robot, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    open_bus, run_bus = Mock(), Mock(side_effect=RuntimeError if fails else None)
    monkeypatch.setattr("footfall.deploy.interfaces.open_interfaces", open_bus)
    monkeypatch.setattr(session, "run_session", run_bus)
    policy, run = Hold(go1), Session(stand_still, 1.0)
    with pytest.raises(RuntimeError) if fails else nullcontext():
        run_on_interface(go1, policy, "socketcan", run)
    filters = (*MitDriver.filters, *imu.ImuReader.filters)
    open_bus.assert_called_once_with("socketcan", ("can0", "can1", "can2", "can3"), filters)
    open_bus.return_value.close.assert_called_once_with()
    assert run_bus.call_args.args[:2] == (go1, policy)
    assert run_bus.call_args.args[3] == replace(run, stop_inputs=True)


@pytest.mark.parametrize("realtime", [False, True])
def test_wall_clock_runs_are_realtime_threads(
    go1: Robot, monkeypatch: pytest.MonkeyPatch, realtime: bool
) -> None:
    calls: list[Any] = []

    @contextmanager
    def realtime_thread(priority: int | None) -> Iterator[list[str]]:
        calls.append(priority)
        yield ["not permitted"]
        calls.append("over")

    monkeypatch.setattr(run_loop, "realtime_thread", realtime_thread)
    safety = replace(RELAXED.safety, damping_s=0.01)
    config = replace(RELAXED, stand_s=0.01, realtime_priority=42, safety=safety)
    run = Session(stand_still, 0.004, realtime, config=config)
    log: Any = Notebook()
    log.close = lambda: ""
    monkeypatch.setattr(session, "_open_log", lambda *_: log)
    outcome = session.run_session(go1, Hold(go1), FrameRobot(go1), run)  # type: ignore[arg-type]
    assert log.of("note") == ([(0, "not permitted")] if realtime else [])
    assert calls == ([42, "over"] if realtime else [])
    assert outcome.notes == (("not permitted",) if realtime else ())


def test_a_wrong_rate_or_contract_is_refused_before_anything_is_sent(go1: Robot, contract: Contract) -> None:
    policy, run, body = Hold(go1), Session(stand_still, 1.0, False), FrameRobot(go1)
    with pytest.raises(UserError, match=r"joint_rate_hz .*1600"):
        run_session(go1, policy, body, replace(run, config=DeployConfig(joint_rate_hz=1600.0)))  # type: ignore[arg-type]
    policy.contract = replace(contract, robot="go2")
    with pytest.raises(UserError, match=r"'hold'.*'go1'.*go2"):
        run_session(go1, policy, body, run)  # type: ignore[arg-type]
    assert body.sent == []


def test_the_outcome_of_an_orderly_run(go1: Robot) -> None:
    body, display, ticks = FrameRobot(go1), Mock(side_effect=lambda _: nullcontext()), []
    config = DeployConfig(stand_s=0.02, safety=SafetyConfig(still_s=0.0, damping_s=0.01))
    run = Session(lambda t: np.array([math.nan, 0.0, 0.0]), 0.03, False, config=config, lie_down=False)
    run = replace(run, display=display)
    outcome = run_session(go1, Hold(go1), body, run, lambda loop: ticks.append(loop.now_us))  # type: ignore[arg-type]
    assert (outcome.final_state, outcome.faults, len(outcome.compute_ms)) == ("IDLE", (), 2)
    assert (outcome.walked_s, outcome.run_s) == pytest.approx((0.032, 0.062))
    assert (outcome.timing["ticks"], outcome.timing["ticks_skipped"]) == (31.0, 0.0)
    assert outcome.buses == (BusStatistics("can0", 7),)
    assert outcome.notes == ("a forward command of nan m/s was replaced with 0",)
    assert ticks == list(range(0, 62_000, TICK_US))
    display.assert_called_once()
    assert body.kinds() == [Request.DISABLE] * 12


def test_the_fullest_bus_limits_the_rate(go1: Robot) -> None:
    four_on_can2 = {"channel": np.array([0, 0, 1, 2, 2, 2, 2, 3, 3, 3, 1, 1]), "motor_id": np.arange(1, 13)}
    rows: list[tuple[Robot, dict[str, Any], str, int]] = [
        (go1, {}, "3 motors on can0", 1234),  # at most 135 bits there and as many back
        (go1, four_on_can2, "4 motors on can2", 925),
        (go1, {"models": ("RS03",) * 12}, "3 motors on can0", 1041),  # 160 bits there and back
        (load_robot("hexapod"), {"models": ("ODrive",) * 18}, "6 motors on can0", 456),
    ]
    for robot, changes, bus, fastest_hz in rows:
        wiring = replace(wiring_of(robot), **changes)
        check_joint_rate(wiring, open_driver(wiring), fastest_hz)
        with pytest.raises(UserError, match=f"{bus} .* {fastest_hz} Hz"):
            check_joint_rate(wiring, open_driver(wiring), fastest_hz + 1)


@contextmanager
def robot_on_multicast(*options: str) -> Iterator[None]:
    """Context with the simulated robot in a process of its own; skips the test without multicast.

    No other test of this machine has a robot on python-can's multicast buses meanwhile.
    """
    command = [sys.executable, "-m", "footfall.plant.serve", "--bus", "udp_multicast", *options]
    pipes: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with (Path(tempfile.gettempdir()) / "footfall-multicast.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with subprocess.Popen(command, **pipes, text=True) as server:
            try:
                if not server.stdout.readline():  # it reports that it is ready
                    pytest.skip(f"no multicast here: {server.communicate()[1].strip()}")
                yield
            finally:
                server.terminate()


class TestWallClock:
    """On the simulated bus, and on python-can's buses without hardware."""

    config = replace(RELAXED, joint_rate_hz=100.0, stand_s=0.4)

    def test_a_run_keeps_to_the_wall_clock(self, go1: Robot) -> None:
        episode = short_episode(duration_s=0.5, realtime=True, config=self.config)
        trace = run_episode(go1, Hold(go1), episode)
        assert trace.final_state == "IDLE"
        assert trace.wall_s >= trace.run_s - 0.01  # later on a busy machine, never earlier
        assert trace.run_s >= 0.4 + 0.5 + 0.5  # stand, walk, damp
        assert trace.timing["lateness_us_max"] >= trace.timing["lateness_us_p50"] > 0.0

    def test_late_policies(self, go1: Robot) -> None:
        late: Any = {"late_limit_s": 0.1}, 0.15, "ran late: no decision within 100 ms"
        often_late: Any = {"late_steps": 5}, 0.03, "5 steps in a row"
        for limit, seconds, message in (late, often_late):
            config = replace(self.config, safety=replace(RELAXED.safety, **limit))
            policy = FailingPolicy(go1, 0.1, partial(slow, seconds=seconds))
            trace = run_episode(go1, policy, short_episode(duration_s=20.0, realtime=True, config=config))
            assert (trace.final_state, message in trace.faults[0]) == ("ESTOP", True)

    def test_the_robot_walks_over_multicast_from_another_process(self, go1: Robot) -> None:
        run = Session(stand_still, 0.4, config=self.config, lie_down=False)
        with robot_on_multicast("--duration", "600", "--motor-timeout", f"{RELAXED.motor_timeout_s:g}"):
            outcome = run_on_interface(go1, Hold(go1), "udp_multicast", run)
        assert (outcome.faults, outcome.final_state) == ((), "IDLE")
        assert all(bus.frames_received >= 3 for bus in outcome.buses)
