"""A simulated robot into which faults can be injected, and runs of it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from fault_kinds import KINDS

from footfall import Policy, Robot
from footfall.deploy.config import DeployConfig
from footfall.deploy.session import Session, SessionResult, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.bus import SimulatedBus
from footfall.plant.injection import FaultInjector, InjectingBus, InjectingCommandSource, InjectingPolicy
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires

FAULTS = {kind.name: kind.inject for kind in KINDS}


class Injected:
    """A simulated robot, its bus, its policy, and the fault injector."""

    def __init__(
        self,
        robot: Robot,
        policy: Policy,
        plant: PlantConfig,
        command: np.ndarray | None = None,
        config: DeployConfig | None = None,
    ) -> None:
        self.robot, self.wiring, self.config = robot, wiring_of(robot), config or DeployConfig()
        wires = SimulatedWires(self.wiring.buses, self.config.host_queue)
        self.body = SimulatedRobot(robot, self.wiring, wires, plant)
        self.bus = InjectingBus(SimulatedBus(wires, self.body))
        self.policy = InjectingPolicy(policy)
        self.command = InjectingCommandSource(np.zeros(3) if command is None else command)
        parts = (self.body, self.bus, self.policy, self.command)
        self.injector = FaultInjector(robot, self.wiring, *parts, np.random.default_rng(1))

    def run(self, duration_s: float, each_tick: Callable | None = None, **settings: object) -> SessionResult:
        """A session in lockstep; settings are those of `Session`."""
        session = Session(self.command, duration_s, realtime=False, config=self.config)
        session = replace(session, **settings)  # type: ignore[arg-type]
        return run_session(self.robot, self.policy, self.bus, session, each_tick)
