"""Exceptions that end the program during a walk: first the robot is damped and its motors are disabled."""

from typing import NoReturn

import pytest
from deploy_policies import Hold, stand_still
from watched_simulation import Simulation, motor_commands

from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Session, run_session
from footfall.robots.description import Robot

SESSION = Session(stand_still, 9.0, realtime=False, config=DeployConfig(stand_s=0.2))
DAMPED_TICKS = 250  # damping_s, 0.5 s at 500 Hz
ENDING = [KeyboardInterrupt, SystemExit, GeneratorExit]


@pytest.mark.parametrize("ends", ENDING)
def test_an_exception_from_each_tick_damps_and_disables(go1: Robot, ends: type[BaseException]) -> None:
    simulation = Simulation(go1)

    def end(loop: ControlLoop) -> None:
        if loop.walking:
            raise ends

    with pytest.raises(ends):
        run_session(go1, Hold(go1), simulation.bus, SESSION, end)
    (stiff, _), (damped, ticks), (off, _) = motor_commands(go1, simulation.sent)[-3:]
    assert (stiff, damped, off) == ("stiff", "damped", "off")
    assert DAMPED_TICKS <= ticks <= DAMPED_TICKS + 1
    assert not simulation.body.motors_on.any()


def test_repeated_exceptions_do_not_stop_the_damping(go1: Robot) -> None:
    simulation = Simulation(go1)
    receive = simulation.bus.receive

    def end(loop: ControlLoop) -> None:
        if loop.walking:
            simulation.bus.receive = refuse  # type: ignore[method-assign]
            raise KeyboardInterrupt

    def refuse(now_us: int) -> NoReturn:
        receive(now_us)
        raise SystemExit

    with pytest.raises(KeyboardInterrupt):
        run_session(go1, Hold(go1), simulation.bus, SESSION, end)
    (damped, ticks), (off, _) = motor_commands(go1, simulation.sent)[-2:]
    assert (damped, off) == ("damped", "off")
    assert DAMPED_TICKS <= ticks <= DAMPED_TICKS + 1
    assert not simulation.body.motors_on.any()
