"""Control loops for tests, built as by a session."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest
from deploy_policies import stand_still
from frame_robot import TICK_US, FrameRobot, Ticks

from footfall import Policy, Robot
from footfall.deploy.base_estimate import BaseEstimate, BaseStateFunction
from footfall.deploy.bus import Bus
from footfall.deploy.clock import LockstepClock
from footfall.deploy.command_source import CommandSource, VelocityFunction, source_of
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.handover import Handover
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.recovery import Recovery
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.steering import Steering
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.bus import SimulatedBus
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires


class RealtimeTicks(LockstepClock):
    """A clock without waiting whose ticks count as wall-clock time."""

    realtime = True  # type: ignore[assignment]

    def lateness_us(self) -> float:
        return 17.0


def loop_on(
    robot: Robot,
    policy: Any,
    bus: Bus,
    times_us: Iterable[int] | None = None,
    realtime: bool = False,
    command_source: CommandSource | VelocityFunction = stand_still,
    wiring: Wiring | None = None,
    driver: Driver | None = None,
    estimator: Any = None,
    base_state: BaseStateFunction | None = None,
    log: Any = None,
    lie_down: bool = False,
    taken_over: Callable[[], bool] = lambda: False,
    safety: SafetyConfig | None = None,
    get_up: Any = None,
    still_s: float = 0.0,  # the robot stands up as soon as all motors have replied
    **settings: Any,
) -> ControlLoop:
    """A loop on a bus, by default in lockstep at 500 Hz."""
    wiring = wiring or wiring_of(robot)
    safety = replace(safety or SafetyConfig(), still_s=still_s)
    config = DeployConfig(**{"stand_s": 0.099, **settings}, safety=safety)
    ticking = RealtimeTicks if realtime else LockstepClock
    clock: Any = ticking(TICK_US) if times_us is None else Ticks(times_us)
    steering = Steering(source_of(command_source), [policy], get_up="" if get_up is None else get_up.name)
    rate_hz, handover = config.joint_rate_hz, Handover([policy], None, get_up)
    runner = PolicyRunner(handover, steering, rate_hz, safety.late_limit_s, realtime, get_up=get_up)
    return ControlLoop(
        robot,
        wiring,
        driver or open_driver(wiring),
        bus,
        clock,
        config,
        runner,
        BaseEstimate(config.estimator_rate_hz, estimator, base_state),
        log,
        lie_down=lie_down,
        taken_over=taken_over,
        recovery=Recovery(robot, safety.recovery, consent=get_up is not None),
    )


def loop_of(robot: Robot, policy: Any, *args: Any, **settings: Any) -> tuple[ControlLoop, FrameRobot]:
    """A loop on a robot made of frames alone (see `loop_on`)."""
    body = FrameRobot(robot, settings.get("wiring"))
    return loop_on(robot, policy, body, *args, **settings), body


def simulated_loop(robot: Robot, policy: Policy, **settings: Any) -> ControlLoop:
    """A loop on a simulated robot that stands in the default pose."""
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses)
    body = SimulatedRobot(robot, wiring, wires)
    settings = {"stand_s": 0.1, "pose_rate_rad_s": 100.0, **settings}
    return loop_on(robot, policy, SimulatedBus(wires, body), **settings)


def until(loop: ControlLoop, mode: Mode, max_ticks: int = 2000) -> None:
    """Tick until the loop is in a mode."""
    for _ in range(max_ticks):
        if loop.state.mode is mode:
            return
        loop.tick()
    pytest.fail(f"{loop.state} never became {mode}")


def walk_for(loop: ControlLoop, walking_s: float) -> None:
    """Tick until the robot has walked for so long, or walks no more."""
    while loop.tick() and not (loop.walking and loop.walking_s >= walking_s - 1e-9):
        if loop.state.faults:
            return
