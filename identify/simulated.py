"""A simulated robot on a stand, for recordings."""

from pathlib import Path

from footfall.deploy.wiring import wire
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant.bus import SimulatedBus
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot

# An IMU without noise would read the same on a stand, which the sensor checks take for a fault.
IMU_NOISE = Noise(gyro=0.005, gravity=0.002, joint_position=0.0, joint_velocity=0.0)


def on_a_stand(sample: Sample | None = None, plant: Path | None = None, clamped: bool = True) -> PlantConfig:
    """A simulated robot on a stand; if not `clamped`, in a frame that gives way a little."""
    return PlantConfig(
        plant=plant, sample=sample or {}, noise=IMU_NOISE, clamped=clamped, hanging=not clamped
    )


def simulated_bus(
    robot: Robot, sample: Sample | None = None, plant: Path | None = None, seed: int = 0, clamped: bool = True
) -> SimulatedBus:
    """The bus of a simulated robot that differs from the nominal one by `sample`.

    Args:
        robot: whose description it has.
        sample: its differences.
        plant: another MJCF than the robot's own.
        seed: of its sensors' noise.
        clamped: on a stand; else it hangs in a frame that gives way a little.
    """
    wiring = wire(robot)
    wires = SimulatedWires(wiring.buses)
    config = on_a_stand(sample, plant, clamped)
    return SimulatedBus(wires, SimulatedRobot(robot, wiring, wires, config, seed))
