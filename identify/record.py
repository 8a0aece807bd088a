"""Runs the excitation on a robot that is fixed to a stand or hangs, with the control loop and a log."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Session, SessionResult, run_session
from footfall.identify.excitation import Excitation, ExcitationConfig
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

TEMPERATURE_MARGIN_C = 15.0  # the recording ends this far below a motor's temperature limit


def record(
    robot: Robot,
    bus: Bus,
    log: Path,
    excitation: ExcitationConfig | None = None,
    deploy: DeployConfig | None = None,
    realtime: bool = False,
) -> SessionResult:
    """Move the joints and log each tick.

    The supervisor's checks are active as in any run. The run ends early if a motor gets warm.

    Args:
        robot: robot bolted to a stand, or hanging, with its feet in the air.
        bus: bus of its motors.
        log: MCAP file to write.
        excitation: settings of the motion.
        deploy: settings of the loop.
        realtime: True for wall-clock time, as on a real bus.
    """
    deploy = deploy or DeployConfig()
    policy = Excitation(robot, excitation or ExcitationConfig(), deploy.joint_rate_hz)
    return run_on_stand(robot, policy, bus, policy.duration_s, deploy, realtime, log)


def run_on_stand(
    robot: Robot,
    policy: Policy,
    bus: Bus,
    duration_s: float,
    deploy: DeployConfig,
    realtime: bool,
    log: Path | None = None,
    done: Callable[[], bool] = lambda: False,
) -> SessionResult:
    """Run until `duration_s` is over, `done` is true, or a motor gets warm."""
    max_c = robot.motor_figures("temperature_limit_c") - TEMPERATURE_MARGIN_C
    warm_notes: list[str] = []

    def watch(loop: ControlLoop) -> None:
        warm = np.flatnonzero(loop.temperature_c > max_c)
        if len(warm) and not warm_notes:
            name = robot.joint_names[warm[0]]
            warm_notes.append(f"ended early: {name} is at {loop.temperature_c[warm[0]]:.0f} °C")
        if warm_notes or done():
            loop.finish(skip_lie_down=True)

    session = Session(
        command_source=lambda _: np.zeros(3),
        duration_s=duration_s,
        realtime=realtime,
        log=log,
        config=deploy,
        stand_up=False,
        lie_down=False,
        stop_inputs=realtime,
    )
    outcome = run_session(robot, policy, bus, session, watch)
    return replace(outcome, notes=(*outcome.notes, *warm_notes))
