"""A simulated robot whose frames are kept."""

from itertools import groupby
from typing import Any

from footfall.deploy.drivers import mit
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wiring_of
from footfall.plant.bus import SimulatedBus
from footfall.plant.injection import InjectingBus
from footfall.plant.motor_ends.mit import MitMotorEnd
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot


class Simulation:
    """A robot whose motors time out after 30 s by default, its bus, and the frames sent to it."""

    def __init__(self, robot: Robot, **plant: Any) -> None:
        self.wiring, config = wiring_of(robot), PlantConfig(**{"motor_timeout_s": 30.0, **plant})
        wires = SimulatedWires(self.wiring.buses, host_queue=20)
        self.body = SimulatedRobot(robot, self.wiring, wires, config)
        self.bus = InjectingBus(SimulatedBus(wires, self.body))
        self.sent: list[Frames] = []
        self.bus.watch = self.sent.append


def motor_commands(robot: Robot, sent: list[Frames]) -> list[tuple[str, int]]:
    """Commands to the motors, tick after tick: kind, and number of ticks in a row."""
    end = MitMotorEnd(wiring_of(robot))

    def kind(frames: Frames) -> str:
        word = mit.words(frames.data)[0]
        if word in (mit.ENTER, mit.EXIT):
            return "on" if word == mit.ENTER else "off"
        _, _, stiffness, damping, _ = end.requests(frames).values
        return "stiff" if stiffness.any() else "damped" if damping.all() else "limp"

    return [(what, len(list(ticks))) for what, ticks in groupby(map(kind, sent))]
