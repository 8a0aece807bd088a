"""The simulated robot: motors with timeouts, sensors with declared errors, any plant."""

from dataclasses import replace
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
        """Send one frame to each motor (or nothing), let a tick pass, read what comes back."""
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

    def gyro(self) -> np.ndarray:
        return np.array(imu.decode_gyro(self.imu[imu.GYRO_ID])[0])


class TestMotors:
    @pytest.mark.parametrize("start", [{}, {"lying": True}, {"hanging": True}])
    def test_it_does_not_move_before_its_motors_are_enabled(self, go1: Robot, start: dict[str, bool]) -> None:
        """Off or on, standing, lying or hanging: the robot is held at first, then released."""
        bench = Bench(go1, held=True, **start)
        before = bench.body.data.qpos.copy()
        bench.tick(bench.hold())  # the motors are off
        for _ in range(50):
            bench.enter()
        np.testing.assert_array_equal(bench.body.data.qpos, before)
        acceleration = imu.decode_acceleration(bench.imu[imu.ACCELERATION_ID])
        np.testing.assert_allclose(acceleration, [0.0, 0.0, 9.81], atol=0.01)
        assert not bench.gyro().any()
        bench.tick(bench.hold())
        bench.tick(mit.special(mit.EXIT, len(before) - 7))
        for _ in range(50):
            bench.tick(bench.hold())
        assert np.abs(bench.body.data.qpos - before).max() > 0.05

    @pytest.mark.parametrize(("result", "knees", "others"), [(None, 0.02, 0.1), (0.05, 0.05, 0.05)])
    def test_motor_timeouts_come_from_robot_yaml_or_the_option(
        self, go1: Robot, result: float | None, knees: float, others: float
    ) -> None:
        motors = go1.description.motors
        sooner = {**motors, "knee": replace(motors["knee"], timeout_s=0.02)}
        robot = replace(go1, description=replace(go1.description, motors=sooner))
        bench = Bench(robot, motor_timeout_s=result)
        bench.enter()
        on_us = np.zeros(12)
        for _ in range(100):
            bench.tick()
            on_us += TICK_US * bench.body.motors_on
        expected_s = [knees if joint.motor == "knee" else others for joint in robot.description.joints]
        np.testing.assert_allclose(1e-6 * on_us, expected_s, atol=0.0021)  # by a tick


class TestFalls:
    @pytest.mark.parametrize(
        ("axis", "degrees", "fallen"),
        [
            *(
                (axis, degrees, abs(degrees) > 70.0)
                for axis in (0, 1)
                for degrees in (69.0, 71.0, -71.0, 150.0)
            ),
            (2, 180.0, False),  # about the vertical
        ],
    )
    def test_a_base_tilted_past_70_degrees_has_fallen(
        self, go1: Robot, axis: int, degrees: float, fallen: bool
    ) -> None:
        body = Bench(go1).body
        half = np.deg2rad(degrees) / 2
        body.data.qpos[2:7] = 2.0, np.cos(half), 0.0, 0.0, 0.0
        body.data.qpos[4 + axis] = np.sin(half)
        mujoco.mj_forward(body.model, body.data)
        reason = body.fall()
        assert (reason is not None) is fallen
        assert not fallen or reason == "the base tilted past 70 degrees"


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

    def test_a_plant_may_have_actuators_sensors_keyframe_and_floor(self, go1: Robot, tmp_path: Path) -> None:
        extra = """
          <worldbody><geom name="floor" type="plane" size="0 0 1"/></worldbody>
          <actuator><position joint="FR_hip_joint" kp="300"/><motor joint="FL_calf_joint"/></actuator>
          <sensor><gyro site="imu"/><actuatorfrc actuator="m"/></sensor>
          <keyframe><key name="home" qpos="1 2 9  1 0 0 0  0 0 0 0 0 0 0 0 0 0 0 0"/></keyframe>
        """.replace('<motor joint="FL', '<motor name="m" joint="FL')
        bench = Bench(go1, plant=rewritten(go1, tmp_path / "full.xml", extra=extra))
        assert bench.body.model.nu == 0
        assert not bench.body.notes
        planes = bench.body.model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        assert planes.sum() == 1
        assert self.stands(bench)

    @pytest.mark.parametrize(
        ("changes", "stands"),
        [
            ([('name="trunk"', 'name="base_link"'), ('site name="imu"', 'site name="sensor"')], True),
            ([('geom name="toe"', 'geom name="toe" contype="0" conaffinity="1"')], True),  # is only touched
            ([('"FR_thigh" pos="0 -0.08 0">', '"FR_thigh" pos="0 -0.25 0">')], False),  # wider hips
        ],
        ids=["names", "passive", "wide"],
    )
    def test_feet_of_a_plant_with_other_names_are_found(
        self, go1: Robot, tmp_path: Path, changes: list[tuple[str, str]], stands: bool
    ) -> None:
        renamed = ('geom name="FR_foot"', 'geom name="toe"')
        bench = Bench(go1, plant=rewritten(go1, tmp_path / "other.xml", renamed, *changes))
        assert all(name in bench.body.notes[0] for name in ("FR_foot", "toe", "FR_calf"))
        if stands:
            assert self.stands(bench)
            assert bench.body.truth().foot_contact.all()

    def test_feet_of_another_makers_plant_are_found_by_position(self, go1: Robot, tmp_path: Path) -> None:
        """Nameless geoms: a mesh and a capsule along the shank, a foot on a body that is fixed to it."""
        shank = """<geom class="collision" type="mesh" mesh="shank"/>
          <geom class="collision" type="capsule" size="0.012" fromto="0 0 -0.02 0 0 -0.2"/>
          <body name="{leg}_end" pos="0 0 -0.15"><geom class="foot" pos="0 0 -0.063"/></body>"""
        mesh = '<asset><mesh name="shank" vertex="-.01 -.01 0 .01 -.01 0 0 .01 0 0 0 -.2"/></asset>'
        feet = [
            (f'<geom name="{leg}_foot" class="foot"/>', shank.format(leg=leg))
            for leg in ("FR", "FL", "RR", "RL")
        ]
        own = Bench(go1)
        other = Bench(go1, plant=rewritten(go1, tmp_path / "other.xml", *feet, extra=mesh))
        assert all(name in other.body.notes[0] for name in ("FR_foot", "FR_end"))
        positions = [bench.body.truth().foot_position for bench in (own, other)]
        np.testing.assert_allclose(*positions, atol=1e-4)
        assert self.stands(other)
        truth = other.body.truth()
        assert truth.foot_contact.all()
        assert truth.foot_force.sum() == pytest.approx(other.body.model.body_subtreemass[0] * 9.81, rel=0.05)
        slippery = Bench(go1, plant=tmp_path / "other.xml", sample=Sample(friction=np.array(0.2))).body.model
        toes = slippery.geom_friction[slippery.geom_bodyid == slippery.body("FR_end").id]
        assert toes[:, 0] == pytest.approx(0.2)
        assert (slippery.geom_friction[:, 0] > 0.5).any()  # the shanks keep their names

    def test_a_plant_without_shapes_at_its_feet_still_stands(self, go1: Robot, tmp_path: Path) -> None:
        """Shanks end where the feet would be. No foot's motion is known; the rest works."""
        shank = '<geom class="collision" type="capsule" size="0.023" fromto="0 0 0 0 0 -0.213"/>'
        feet = [(f'<geom name="{leg}_foot" class="foot"/>', shank) for leg in ("FR", "FL", "RR", "RL")]
        bench = Bench(go1, plant=rewritten(go1, tmp_path / "stilts.xml", *feet))
        assert self.stands(bench)
        truth = bench.body.truth()
        assert np.isnan(truth.foot_position).all()
        assert not truth.foot_contact.any()
        assert len(bench.body.notes) == 1

    def test_a_plant_without_reflected_inertia_gets_the_robots(self, go1: Robot, tmp_path: Path) -> None:
        plant = rewritten(
            go1, tmp_path / "light.xml", (' armature="0.00403"', ""), (' armature="0.00906"', "")
        )
        bench = Bench(go1, plant=plant)
        assert "reflected inertia" in bench.body.notes[0]
        np.testing.assert_allclose(bench.body.model.dof_armature[6:], go1.armature)
        assert self.stands(bench)
