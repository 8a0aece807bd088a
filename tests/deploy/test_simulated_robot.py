"""The simulated robot: motors with timeouts, sensors with declared errors, any plant."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.deploy.drivers import imu, mit
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.sample import Sample
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot

TICK_US = 2000


class Bench:
    """A simulated robot and the controller's end of its buses."""

    def __init__(self, robot: Robot, seed: int = 0, **difference: object) -> None:
        self.robot, self.wiring = robot, wiring_of(robot)
        self.codec = mit.Codec(self.wiring.models)
        self.driver = open_driver(self.wiring)
        self.wires = SimulatedWires(self.wiring.buses)
        self.body = SimulatedRobot(
            robot, self.wiring, self.wires, PlantConfig(**{"held": False, **difference}), seed
        )
        self.now_us = 0
        self.position = np.full(len(robot.joint_names), np.nan)
        self.velocity, self.error = self.position.copy(), np.zeros(len(self.position))
        self.replies = 0
        self.imu: dict[int, bytes] = {}

    def tick(self, data: np.ndarray | None = None) -> None:
        """Send one frame to each motor (or nothing), let a tick pass, read the replies."""
        if data is not None:
            w = self.wiring
            self.wires.send(
                Side.HOST, Frames(w.channel, w.motor_id, data, np.full(len(data), 8)), self.now_us
            )
        self.now_us += TICK_US
        self.body.advance(self.now_us)
        for frames in self.wires.receive(Side.HOST, self.now_us):
            if frames.id[0] in imu.IDS:
                self.imu = {int(i): d.tobytes() for i, d in zip(frames.id, frames.data, strict=True)}
                continue
            replies = self.driver.replies(frames)
            motor = replies.motor
            self.position[motor], self.velocity[motor], _ = replies.values
            self.error[motor] = replies.error
            self.replies += len(replies.error)

    def enter(self) -> None:
        self.tick(mit.special(mit.ENTER, len(self.position)))

    def hold(self, kp: float = 60.0, kd: float = 2.0, offset: float = 0.0) -> np.ndarray:
        one = np.ones(len(self.position))
        pose = self.robot.default_pose + offset
        return self.codec.encode(np.array([pose, 0 * one, kp * one, kd * one, 0 * one]))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_tilt_past_70_degrees_is_a_fall(go1: Robot, axis: int) -> None:
    """A turn about the vertical is none."""
    body = Bench(go1).body
    for degrees in (69.0, 71.0, -71.0, 150.0):
        half = np.deg2rad(degrees) / 2
        body.data.qpos[2:7] = 2.0, np.cos(half), 0.0, 0.0, 0.0
        body.data.qpos[4 + axis] = np.sin(half)
        mujoco.mj_forward(body.model, body.data)
        assert bool(body.fall()) is (axis < 2 and abs(degrees) > 70.0)


def test_a_sample_for_another_body_count_is_refused(go1: Robot) -> None:
    with pytest.raises(UserError, match=r"3 bodies.* 13"):
        Bench(go1, sample=Sample(link_mass=np.ones(3)))


def rewritten(robot: Robot, path: Path, *changes: tuple[str, str], extra: str = "") -> Path:
    """The robot's own MJCF with some text changed, and elements added before its end."""
    text = robot.xml_path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text.replace("</mujoco>", f"{extra}</mujoco>"))
    return path


class TestPlants:
    def stands(self, bench: Bench) -> bool:
        bench.enter()
        for _ in range(250):
            bench.tick(bench.hold())
        return bench.body.fall() is None

    def test_a_plant_without_reflected_inertia_gets_the_robots(self, go1: Robot, tmp_path: Path) -> None:
        plant = rewritten(
            go1, tmp_path / "light.xml", (' armature="0.00403"', ""), (' armature="0.00906"', "")
        )
        bench = Bench(go1, plant=plant)
        assert "reflected inertia" in bench.body.notes[0]
        np.testing.assert_allclose(bench.body.model.dof_armature[6:], go1.armature)
        assert self.stands(bench)
