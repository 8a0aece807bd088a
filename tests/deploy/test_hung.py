"""Code that never returns or ends the program: the robot is damped, then its motors are disabled."""

import queue
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import count

import pytest
from deploy_policies import FailingPolicy, Hold, stand_still
from relaxed_limits import RELAXED
from watched_simulation import Simulation, motor_commands

from footfall import JointCommand, Robot
from footfall.deploy.config import DeployConfig
from footfall.deploy.deadline import OverdueError, deadlines
from footfall.deploy.frames import Frames
from footfall.deploy.guard import Guard
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Session, run_session

SAFETY = replace(RELAXED.safety, late_limit_s=0.3, damping_s=0.2)
CONFIG = replace(RELAXED, joint_rate_hz=100.0, stand_s=0.3, safety=SAFETY)


def spin(_: JointCommand) -> JointCommand:
    while True:
        try:
            sum(range(1000))
        except Exception:  # such a policy catches every exception
            continue


@pytest.mark.parametrize("hang", [spin, lambda _: time.sleep(60.0)], ids=["spin", "sleep"])
def test_a_hanging_call_is_interrupted_at_its_deadline(go1: Robot, hang: Callable) -> None:
    simulation, began = Simulation(go1), time.monotonic()
    session = Session(stand_still, 9.0, config=CONFIG)
    outcome = run_session(go1, FailingPolicy(go1, 0.2, hang), simulation.bus, session)
    assert outcome.final_state == "ESTOP"
    assert outcome.faults == ("the policy ran late: no decision within 300 ms",)
    assert time.monotonic() - began < 30.0
    assert not simulation.body.motors_on.any()


def test_only_a_call_in_the_main_thread_is_interrupted() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with deadlines() as arm:
        arm(0.02)
        with pytest.raises(OverdueError):
            time.sleep(30.0)
        arm(0.3)
        arm(0.0)
        time.sleep(0.4)
    assert signal.getsignal(signal.SIGALRM) is before

    def elsewhere() -> None:
        with deadlines() as arm:
            arm(0.01)
            time.sleep(0.03)

    with ThreadPoolExecutor(1) as threads:
        threads.submit(elsewhere).result()


@pytest.mark.parametrize("repeated", [False, True])
@pytest.mark.parametrize("ends", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_an_exception_that_ends_the_program(go1: Robot, ends: type[BaseException], repeated: bool) -> None:
    """It comes during a walk, once or in each tick from then on."""
    simulation = Simulation(go1)
    receive = simulation.bus.receive

    def end(loop: ControlLoop) -> None:
        if loop.walking:
            if repeated:
                simulation.bus.receive = refuse  # type: ignore[method-assign]
            raise ends

    def refuse(now_us: int) -> list[Frames]:
        receive(now_us)
        raise SystemExit

    session = Session(stand_still, 9.0, realtime=False, config=DeployConfig(stand_s=0.2))
    with pytest.raises(ends):
        run_session(go1, Hold(go1), simulation.bus, session, end)
    (stiff, _), (damped, ticks), (off, _) = motor_commands(go1, simulation.sent)[-3:]
    assert (stiff, damped, off) == ("stiff", "damped", "off")
    assert ticks in (250, 251)  # damping_s, 0.5 s at 500 Hz
    assert not simulation.body.motors_on.any()


class TestGuard:
    def test_a_loop_that_does_not_return_is_damped(self, capsys: pytest.CaptureFixture[str]) -> None:
        acts: list[str] = []
        began, taken_over, codes = time.perf_counter(), threading.Event(), queue.Queue()

        def damp() -> None:
            acts.append("damp" if taken_over.is_set() else "damp while the loop may send")
            raise OSError("a failing bus must not stop the guard")

        Guard(lambda: began, damp, lambda: acts.append("off"), 0.05, 0.06, taken_over, codes.put)
        assert codes.get(timeout=30.0) == 1
        assert codes.empty()
        assert (set(acts[:-1]), acts[-1]) == ({"damp"}, "off")
        assert capsys.readouterr().err

    def test_the_guard_does_nothing_while_the_loop_is_in_time(self) -> None:
        taken_over = threading.Event()
        guard = Guard(time.perf_counter, pytest.fail, pytest.fail, 0.05, 0.05, taken_over, pytest.fail)
        time.sleep(0.15)
        guard.close()
        assert not taken_over.is_set()

    def test_a_loop_that_returns_within_a_tick_leaves_its_damping(self, go1: Robot) -> None:
        """A bus blocks while it is read, so the tick's decision is out of date."""
        simulation, ticks = Simulation(go1), count()
        receive = simulation.bus.receive

        def block(now_us: int) -> list[Frames]:
            if next(ticks) == 60:
                time.sleep(1.8)
            return receive(now_us)

        simulation.bus.receive = block  # type: ignore[method-assign]
        safety = replace(SAFETY, pause_limit_s=1.0, damping_s=0.6)  # the guard takes over after 1.1 s
        session = Session(stand_still, 9.0, config=replace(CONFIG, safety=safety))
        assert "guard" in run_session(go1, Hold(go1), simulation.bus, session).faults[-1]
        assert [what for what, _ in motor_commands(go1, simulation.sent)] == ["on", "stiff", "damped", "off"]
