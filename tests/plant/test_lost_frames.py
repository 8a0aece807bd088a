"""Lost frames behind the bus: fewer replies reach the loop, and motors follow older commands."""

import numpy as np
import pytest

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.sample import Sample
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot

TICKS, TICK_US = 500, 2000


def replies(robot: Robot, sample: Sample) -> tuple[int, int]:
    """Frames of the motors and the IMU that arrive while 500 commands are sent to enabled motors."""
    wiring = wiring_of(robot)
    wires, driver = SimulatedWires(wiring.buses), open_driver(wiring)
    body = SimulatedRobot(robot, wiring, wires, PlantConfig(sample=sample))
    zeros = np.zeros_like(robot.default_pose)
    hold = driver.command(np.stack([robot.default_pose, zeros, robot.kp, robot.kd, zeros]))
    of_motors = of_imu = 0
    for tick in range(TICKS):
        wires.send(Side.HOST, driver.enable() if tick == 0 else hold, tick * TICK_US)
        body.advance((tick + 1) * TICK_US)
        for frames in wires.receive(Side.HOST, (tick + 1) * TICK_US):
            imu = np.isin(frames.id, (0x300, 0x301, 0x302))
            of_imu += int(imu.sum())
            of_motors += int((~imu).sum())
    return of_motors, of_imu


def test_the_declared_shares_of_commands_and_replies_never_arrive(go1: Robot) -> None:
    """A motor replies to each command that reaches it; the IMU sends by itself."""
    motors, imu = replies(go1, {})
    sample = {"lost_commands": np.array(0.2), "lost_replies": np.array(0.25)}
    fewer_of_motors, fewer_of_imu = replies(go1, sample)
    assert fewer_of_motors / motors == pytest.approx(0.8 * 0.75, abs=0.03)
    assert fewer_of_imu / imu == pytest.approx(0.75, abs=0.04)
