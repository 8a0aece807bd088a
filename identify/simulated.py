"""A simulated robot on a stand, for recordings."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant.bus import SimulatedBus
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot

# Without noise, the readings of an IMU on a stand would repeat: a fault to the sensor checks.
IMU_NOISE = Noise(gyro=0.005, gravity=0.002, joint_position=0.0, joint_velocity=0.0)


def on_a_stand(sample: Sample | None = None, plant: Path | None = None, clamped: bool = True) -> PlantConfig:
    """A simulated robot on a stand; if not `clamped`, in a slightly elastic frame."""
    return PlantConfig(
        plant=plant, sample=sample or {}, noise=IMU_NOISE, clamped=clamped, hanging=not clamped
    )


def simulated_bus(
    robot: Robot, sample: Sample | None = None, plant: Path | None = None, seed: int = 0, clamped: bool = True
) -> SimulatedBus:
    """The bus of a simulated robot that differs from the nominal one by `sample`.

    Args:
        robot: nominal robot.
        sample: differences from the nominal robot.
        plant: another MJCF than the robot's own.
        seed: seed of the sensors' noise.
        clamped: True on a stand; False in a slightly elastic frame.
    """
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses)
    config = on_a_stand(sample, plant, clamped)
    return SimulatedBus(wires, SimulatedRobot(robot, wiring, wires, config, seed))


class OnScales(NamedTuple):
    """A simulated robot on a stand whose feet touch scales."""

    bus: SimulatedBus
    weigh: Callable[[int], float]  # what the scale below a foot shows, N


def on_scales(robot: Robot, sample: Sample | None = None, seed: int = 0) -> OnScales:
    """A simulated robot on a stand, lowered until its feet touch; arguments as for `simulated_bus`."""
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses)
    simulated = SimulatedRobot(robot, wiring, wires, replace(on_a_stand(sample), lowered=True), seed)
    return OnScales(SimulatedBus(wires, simulated), lambda foot: float(simulated.truth().foot_force[foot]))
