"""The parts of the simulated machine, each by itself: truth, motors, sensors, wires, what a trial records."""

import time
from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from footfall.common.arrays import as_slice
from footfall.deploy.bus import BusStatistics
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.driver import Motors
from footfall.deploy.frames import Frames, frame_bits
from footfall.deploy.modes import Mode
from footfall.deploy.session import SessionResult
from footfall.deploy.wiring import wire
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant import episode as episode_module
from footfall.plant import serve
from footfall.plant.bus import SimulatedBus
from footfall.plant.energy import EnergyMeter
from footfall.plant.episode import Episode, Push, _Trial, run_episode
from footfall.plant.ground_truth import GroundTruth
from footfall.plant.motor_ends.motor_end import Request, Requests
from footfall.plant.motors import SimulatedMotors
from footfall.plant.progress import Progress
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.sensors import Layout, SimulatedSensors
from footfall.plant.trace import Recorder
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.actuator import JointCommand, Motor, friction_torque, motor_torque
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import joint_addresses, read_plant

ORDER = [7, 2, 11, 0, 5, 9, 4, 1, 10, 3, 8, 6]  # of the joints, none where it was nor beside its neighbour


@pytest.fixture
def odd(own_folder: Path) -> Robot:
    """go1 with its joints in another order, a foot of two balls, behind a gate that swings in its world."""
    xml = own_folder / "robot.xml"
    text = xml.read_text()
    gate = '<body pos="3 0 1"><joint name="gate" axis="0 0 1" ref="0.7"/><geom size="0.2"/></body>'
    # three centimetres behind it in the default pose
    heel = '<geom name="FR_foot" class="foot"/><geom name="FR_heel" class="foot" pos="-0.01865 0 -0.1895"/>'
    text = text.replace("<worldbody>", f"<worldbody>{gate}")
    xml.write_text(text.replace('<geom name="FR_foot" class="foot"/>', heel))
    declaration = own_folder / "robot.yaml"
    content = yaml.safe_load(declaration.read_text())
    content["joints"] = [content["joints"][k] for k in ORDER]
    content["feet"][0]["geoms"] = ["FR_foot", "FR_heel"]
    declaration.write_text(yaml.safe_dump(content))
    return load_robot(own_folder)


def body_of(robot: Robot, **difference: Any) -> SimulatedRobot:
    wiring = wire(robot)
    return SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses), PlantConfig(held=False, **difference))


def thrown(body: SimulatedRobot) -> None:
    """High above the ground, tilted about all axes, with every joint and the gate in motion."""
    data, model = body.data, body.model
    rng = np.random.default_rng(8)
    turned = Rotation.from_euler("xyz", [0.4, -0.3, 2.0]).as_quat(scalar_first=True)
    data.qpos[1:8] = [1.0, -2.0, 6.0, *turned]
    data.qpos[8:] += rng.uniform(-0.2, 0.2, model.nq - 8)
    data.qvel[:] = rng.uniform(-2.0, 2.0, model.nv)
    mujoco.mj_forward(model, data)


def thrown_up(body: SimulatedRobot, pose: np.ndarray) -> None:
    """A metre above the ground, in a pose (n,) of go1's joints."""
    body.data.qpos[2], body.data.qpos[7:] = 1.0, pose
    mujoco.mj_forward(body.model, body.data)


class TestTruth:
    def test_every_part_of_the_state_is_found_in_a_plant_of_more_than_the_robot(self, odd: Robot) -> None:
        body = body_of(odd)
        thrown(body)
        data, model = body.data, body.model
        body._torque = np.arange(12.0)
        truth = body.truth()
        turn = Rotation.from_quat(data.qpos[4:8], scalar_first=True)
        np.testing.assert_array_equal(truth.base_position, [1.0, -2.0, 6.0])
        np.testing.assert_array_equal(truth.base_quaternion, data.qpos[4:8])
        np.testing.assert_allclose(truth.base_velocity, turn.inv().apply(data.qvel[1:4]), atol=1e-12)
        np.testing.assert_array_equal(truth.base_angular_velocity, data.qvel[4:7])
        for k, name in enumerate(odd.joint_names):
            assert truth.joint_position[k] == data.joint(name).qpos[0]
            assert truth.joint_velocity[k] == data.joint(name).qvel[0]
        np.testing.assert_array_equal(truth.qpos, data.qpos)
        np.testing.assert_array_equal(truth.motor_torque, np.arange(12.0))
        places = []
        for dt in (-1e-6, 0.0, 1e-6):
            moved = mujoco.MjData(model)
            moved.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, moved.qpos, data.qvel, dt)
            mujoco.mj_kinematics(model, moved)
            places.append(
                [np.mean([moved.geom(g).xpos for g in foot.geoms], axis=0) for foot in odd.description.feet]
            )
        np.testing.assert_allclose(truth.foot_position, places[1], atol=1e-12)
        velocity = np.subtract(places[2], places[0]) / 2e-6
        np.testing.assert_allclose(truth.foot_velocity, velocity, atol=1e-6)
        assert np.abs(truth.foot_velocity).min() > 0.01

    def test_what_was_read_does_not_move_on(self, odd: Robot) -> None:
        body = body_of(odd)
        thrown(body)
        truth = body.truth()
        kept = [np.array(part) for part in truth]
        body._torque += 1.0
        body.advance(20_000)
        body.truth()
        for part, before in zip(truth, kept, strict=True):
            np.testing.assert_array_equal(part, before)

    @pytest.mark.parametrize("foot", range(4))
    def test_a_foot_that_alone_touches_the_ground_bears_all_of_what_it_pushes_back_with(
        self, odd: Robot, foot: int
    ) -> None:
        """The other legs are drawn up; the feet are listed FR, FL, RR, RL, and FR has two balls."""
        body = body_of(odd)
        data, model = body.data, body.model
        drawn = [joint for k in range(4) if k != foot for joint in odd.foot_joints[k]]
        qpos = joint_addresses(model, odd)[0]
        for joint in drawn:
            if "calf" in odd.joint_names[joint]:
                data.qpos[qpos[joint]] = -2.4
        for _ in range(3):
            mujoco.mj_step(model, data)
        truth = body.truth()
        assert truth.foot_contact.tolist() == [k == foot for k in range(4)]
        upward = data.qfrc_constraint[3]
        assert upward > 5.0
        assert truth.foot_force[foot] == pytest.approx(upward)
        assert data.ncon == (2 if foot == 0 else 1)

    def test_a_foot_that_bears_a_newton_touches(self, go1: Robot) -> None:
        """go1 of 12 kg where weight is a thirtieth of the earth's."""
        body = body_of(go1)
        body.model.opt.gravity[2] = -0.3
        body.data.qvel[2] = -0.02
        for _ in range(5):
            mujoco.mj_step(body.model, body.data)
            truth = body.truth()
            np.testing.assert_array_equal(truth.foot_contact, truth.foot_force > 0.0)
            if truth.foot_force.min() > 0.0 and truth.foot_force.max() < 5.0:
                break
        else:
            pytest.fail("no foot touched lightly")

    def test_legs_touch_where_two_of_them_press_on_each_other(self, go1: Robot) -> None:
        """Standing they do not; in the air, the feet of the front or of the rear are led together."""
        body = body_of(go1)
        data, model = body.data, body.model
        mujoco.mj_forward(model, data)
        assert body.truth().foot_contact.all()
        assert not body.truth().legs_touch
        for leg in (0, 2):
            thrown_up(body, go1.default_pose * np.tile((-1.0, 1.0, 1.0), 4))
            assert not body.truth().legs_touch
            inwards = go1.default_pose.copy()
            inwards[[3 * leg, 3 * leg + 3]] = 0.45, -0.45
            thrown_up(body, inwards)
            assert body.truth().legs_touch
            assert len({model.geom_bodyid[geom] for geom in data.contact.geom.ravel()}) == 2

    def test_shanks_that_press_on_each_other_touch_too(self, go1: Robot) -> None:
        body = body_of(go1)
        pose = go1.default_pose.copy()
        pose[:6] = 0.8, 0.9, -1.8, -0.8, 0.75, -1.8
        thrown_up(body, pose)
        feet = {body.model.geom(name).id for foot in go1.description.feet for name in foot.geoms}
        assert body.data.ncon
        assert not feet & set(body.data.contact.geom.ravel().tolist())
        assert body.truth().legs_touch

    def test_parts_of_one_leg_that_press_on_each_other_do_not_count(self, own_folder: Path) -> None:
        xml = own_folder / "robot.xml"
        hip = '<joint name="FR_hip_joint" class="abduction"/>'
        xml.write_text(
            xml.read_text().replace(
                hip, f'{hip}<geom class="collision" size="0.08" pos="0 -0.08 0" density="0"/>'
            )
        )
        robot = load_robot(own_folder)
        body = body_of(robot)
        pose = robot.default_pose.copy()
        pose[2] = -2.7
        thrown_up(body, pose)
        bodies = {body.model.body(body.model.geom_bodyid[g]).name for g in body.data.contact.geom.ravel()}
        assert bodies == {"FR_hip", "FR_calf"}
        assert not body.truth().legs_touch

    def test_a_leg_that_presses_on_the_base_touches_no_leg(self, go1: Robot) -> None:
        body = body_of(go1)
        pose = go1.default_pose.copy()
        pose[:2] = 0.7, 1.5
        thrown_up(body, pose)
        bodies = {body.model.body(body.model.geom_bodyid[g]).name for g in body.data.contact.geom.ravel()}
        assert bodies == {"trunk", "FR_thigh"}
        assert not body.truth().legs_touch

    @pytest.mark.parametrize(("share", "sunk"), [(0.39, True), (0.41, False)])
    def test_a_base_less_than_two_fifths_of_its_height_above_its_lowest_foot_has_sunk(
        self, go1: Robot, share: float, sunk: bool
    ) -> None:
        body = body_of(go1)
        body.data.qpos[2] = 7.0
        body.data.qpos[9] += 0.2  # one foot is higher than the others
        mujoco.mj_forward(body.model, body.data)
        above = 7.0 - body.truth().foot_position[:, 2].min()
        truth = GroundTruth(read_plant(go1, None), body.data, body._layout, above / share)
        assert truth.fall() == ("the base sank to the height of the feet" if sunk else None)

    def test_only_the_base_may_not_touch_the_ground(self, go1: Robot) -> None:
        """Thighs on the ground are no fall, nor is what the base touches of the robot itself."""
        body = body_of(go1)
        data, model = body.data, body.model
        data.qpos[7:] = np.tile([0.0, 1.57, -0.9], 4)
        heights = np.arange(0.4, 0.0, -0.001)
        thigh, trunk = model.body("FR_thigh").id, model.body("trunk").id
        for height in heights:
            data.qpos[2] = height
            mujoco.mj_forward(model, data)
            touching = {frozenset(model.geom_bodyid[pair].tolist()) for pair in data.contact.geom}
            reason = body.fall()
            if frozenset({0, trunk}) in touching:
                assert reason == "the base touched the ground"
                break
            assert reason != "the base touched the ground"
            assert reason is None or frozenset({0, thigh}) in touching
        else:
            pytest.fail("the trunk never touched")

    @pytest.mark.parametrize("kind", ["BADQPOS", "BADQVEL", "BADQACC", "CONTACTFULL"])
    def test_lost_numbers_are_told_from_other_warnings(self, go1: Robot, kind: str) -> None:
        body = body_of(go1)
        assert not body.diverged()
        body.data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{kind}")].number = 1
        assert body.diverged() is (kind != "CONTACTFULL")


class TestStart:
    def test_it_stands_in_its_default_pose_just_on_the_highest_ground_below(
        self, odd: Robot, own_folder: Path
    ) -> None:
        """A step under one foot lifts the robot by its height; the gate is where its file has it."""
        text = odd.xml_path.read_text()
        step = '<geom type="plane" size="0 0 1" pos="0 0 -1"/>'
        step += '<geom type="box" size="0.1 0.1 0.2" pos="0.19 0.13 -0.9"/>'
        (own_folder / "step.xml").write_text(text.replace("<worldbody>", f"<worldbody>{step}"))
        body = body_of(odd, plant=own_folder / "step.xml")
        data = body.data
        np.testing.assert_array_equal(data.qpos[joint_addresses(body.model, odd)[0]], odd.default_pose)
        assert data.qpos[:3].tolist() == [0.7, 0.0, 0.0]
        assert data.qpos[4:8].tolist() == [1.0, 0.0, 0.0, 0.0]
        assert data.qpos[3] == pytest.approx(odd.description.standing_height_m - 0.7, abs=1e-4)
        lowest = data.geom("FL_foot").xpos[2] - 0.023
        assert -1e-6 < -0.7 - lowest < 1e-6

    def test_a_plant_over_an_abyss_is_refused(self, go1: Robot, tmp_path: Path) -> None:
        text = go1.xml_path.read_text()
        deep = '<worldbody><geom type="plane" size="0 0 1" pos="0 0 -6"/>'
        (tmp_path / "deep.xml").write_text(text.replace("<worldbody>", deep))
        with pytest.raises(Exception, match="no ground within 4 m of its origin"):
            body_of(go1, plant=tmp_path / "deep.xml")

    def test_a_push_is_in_the_worlds_axes_and_of_the_base_alone(self, odd: Robot) -> None:
        body = body_of(odd)
        thrown(body)
        before = body.data.qvel.copy()
        body.push((0.1, -0.2, 0.3))
        np.testing.assert_allclose((body.data.qvel - before)[:5], [0.0, 0.1, -0.2, 0.3, 0.0], atol=1e-12)
        assert not (body.data.qvel - before)[5:].any()

    def test_time_passes_in_whole_steps_that_fit(self, go1: Robot) -> None:
        body = body_of(go1)
        times = []
        for now_us in (0, 999, 1000, 3999, 3999, 4000):
            body.advance(now_us)
            times.append(body.time_us)
        assert times == [0, 0, 1000, 3000, 3000, 4000]
        assert body.data.time == pytest.approx(0.004)

    def test_the_imu_reports_every_two_milliseconds_one_count_on(self, go1: Robot) -> None:
        wiring = wire(go1)
        wires = SimulatedWires(wiring.buses)
        body = SimulatedRobot(go1, wiring, wires)

        def heard(until_us: int) -> list[int]:
            """Counters of the gyro frames that arrived; they are on the IMU's bus alone."""
            body.advance(until_us)
            frames = wires.receive(Side.HOST, until_us)
            assert all((batch.channel == wiring.imu_channel).all() for batch in frames)
            assert all(batch.id.tolist() == [0x300, 0x301, 0x302] for batch in frames)
            return [int.from_bytes(batch.data[0, 6:].tobytes(), "big") for batch in frames]

        assert heard(1000) == [1]
        assert heard(2500) == []
        assert heard(7000) == [2, 3, 4]
        body.faults.imu_stuck = True
        assert heard(9000) == [4]
        body.faults.imu_silent = True
        assert heard(13_000) == []
        body.faults.imu_silent = body.faults.imu_stuck = False
        assert heard(15_000) == [5]

    @pytest.mark.parametrize(
        ("indices", "expected"),
        [
            ([3, 4, 5], slice(3, 6, 1)),
            ([7], slice(7, 8, 1)),
            ([0, 3, 6], slice(0, 7, 3)),
            ([3, 4, 6], None),
            ([5, 4, 3], None),
            ([2, 2], None),
        ],
    )
    def test_places_evenly_apart_are_read_without_a_copy(
        self, indices: list[int], expected: slice | None
    ) -> None:
        found = as_slice(np.array(indices))
        np.testing.assert_array_equal(np.arange(9)[found], indices)
        assert expected is None or found == expected

    def test_switched_on_motors_are_told_in_a_copy(self, go1: Robot) -> None:
        body = body_of(go1)
        on = body.motors_on
        on[:] = True
        assert not body.motors_on.any()


def test_the_meter_holds_any_number_of_steps_each_once(go1: Robot) -> None:
    meter = EnergyMeter(go1)
    rng = np.random.default_rng(4)
    assert tuple(meter.take()) == (0.0, 0.0, 0.0)
    resistance, constant, gear = np.full(12, 0.17), np.full(12, 0.105), np.tile([6.0, 6.0, 9.0], 4)
    for steps in (200, 3, 64):
        torque, before, after = rng.normal(size=(3, steps, 12)) * 5.0
        velocity = (before + after) / 2
        reused = np.zeros((3, 12))
        for row in zip(torque, before, after, strict=True):
            reused[:] = row
            meter.add(*reused)
        power = meter.take()
        shaft = torque * velocity
        assert power.mechanical == pytest.approx(shaft.sum() / steps)
        assert power.positive == pytest.approx(shaft[shaft > 0].sum() / steps)
        loss = resistance * (torque / (gear * constant)) ** 2
        assert power.electrical == pytest.approx((shaft + loss).sum() / steps)


def test_progress_counts_the_chord_since_the_last_corner() -> None:
    """At 4 samples a second a chord is of two of them: a corner within one is cut."""
    progress = Progress(4.0)
    found = []
    for place in ((0, 0), (3, 0), (3, 4), (3, 8), (3, 8), (0, 8)):
        progress.add(np.array([*place, 99.0 * place[0]]), np.zeros(3))
        found.append(progress.distance_m)
    assert found == pytest.approx([0.0, 3.0, 5.0, 9.0, 9.0, 12.0])


# -- motors ------------------------------------------------------------------------------------------

MOTOR = Motor(
    peak_torque=np.array([20.0, 30.0, 40.0]),
    stall_torque=np.array([25.0, 35.0, 45.0]),
    no_load_speed=np.array([30.0, 20.0, 10.0]),
    friction=np.array([0.3, 0.5, 1.0]),
    friction_speed=np.array([0.2, 0.3, 0.6]),
    damping=np.array([0.01, 0.02, 0.03]),
    strength=np.array([1.0, 0.9, 0.8]),
)
VALUES = np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0], [0.5, 0.6, 0.7], [1.5, 2.5, 3.5]])
POSITION, VELOCITY = np.array([0.3, -0.2, 0.5]), np.array([0.5, -1.0, 2.0])
READINGS = np.array([[0.3, -0.2, 0.5], [0.5, -1.0, 2.0], [7.0, 8.0, 9.0]])
NO_FRAMES = Frames(*np.zeros((4, 0), dtype=int))


class End:
    """A motor protocol whose frames are handed over as requests; what is replied is kept."""

    filters = ()
    time_out_error = 13
    time_out_latches = False
    timeout_s = np.full(3, np.nan)
    talkative = False

    def __init__(self) -> None:
        self.next: Requests | None = None
        self.replied: list[tuple[list[int], np.ndarray, list[int]]] = []

    def requests(self, frames: Frames) -> Requests:
        assert self.next is not None
        return self.next

    def tell(self, frames: Frames) -> None:
        return None

    def broadcast(self, *_: Any) -> None:
        return None

    def reply(
        self,
        motor: Motors,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray | None = None,
    ) -> Frames:
        index = np.arange(3)[motor]
        self.replied.append((index.tolist(), values.copy(), error.tolist()))
        data = np.zeros((len(index), 8), np.uint8)
        data[:, 0] = index + 1
        return Frames(np.zeros_like(index), index, data, np.full(len(index), 8))


class Stand:
    """Three motors on a test stand, stepped by hand."""

    def __init__(self, **sample: Any) -> None:
        self.end = End()
        self.motors = SimulatedMotors(self.end, MOTOR, 3, Sample(**sample), 0.001, timeout_s=0.02)

    def ask(
        self,
        step: int,
        motor: Motors,
        kind: list[Request] | None,
        values: np.ndarray,
        readings: np.ndarray = READINGS,
    ) -> Frames | None:
        self.end.next = Requests(motor, values.copy(), None if kind is None else np.array(kind))
        return self.motors.answer(step, NO_FRAMES, readings)

    def on(self, step: int = 0, *motors: int) -> Frames | None:
        which = np.array(motors or (0, 1, 2))
        return self.ask(step, which, [Request.ENABLE] * len(which), np.zeros((5, len(which))))

    def torque(self, step: int) -> np.ndarray:
        return self.motors.torque(step, POSITION, VELOCITY)


def torque_of(values: np.ndarray, bias: np.ndarray | float = 0.0) -> np.ndarray:
    return motor_torque(JointCommand(*values), POSITION + bias, VELOCITY, MOTOR)


class TestMotors:
    def test_each_follows_its_own_command_until_the_next(self) -> None:
        stand = Stand()
        assert not stand.torque(0).any()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        np.testing.assert_allclose(stand.torque(0), torque_of(VALUES))
        other = VALUES[:, [2, 0]] * 1.1
        stand.ask(1, np.array([2, 0]), None, other)
        expected = VALUES.copy()
        expected[:, [2, 0]] = other
        np.testing.assert_allclose(stand.torque(1), torque_of(expected))
        np.testing.assert_allclose(stand.motors.friction(VELOCITY), friction_torque(VELOCITY, MOTOR))

    def test_a_latched_error_keeps_a_motor_off_until_it_is_cleared(self) -> None:
        stand = Stand()
        stand.motors.faults.latched[1] = 8
        stand.on()
        assert stand.motors.enabled.tolist() == [True, False, True]
        assert stand.end.replied[-1][2] == [0, 8, 0]
        stand.ask(1, np.array([1]), [Request.CLEAR], np.zeros((5, 1)))
        stand.on(2)
        assert stand.motors.enabled.all()
        assert stand.end.replied[-1][2] == [0, 0, 0]

    @pytest.mark.parametrize("latches", [False, True])
    def test_so_does_a_time_out_where_a_maker_latches_it(
        self, latches: bool, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """All hear nothing for 20 ms and more."""
        monkeypatch.setattr(End, "time_out_latches", latches)
        stand = Stand()
        stand.on()
        stand.torque(25)
        stand.on(26)
        assert stand.motors.enabled.tolist() == [not latches] * 3
        stand.ask(27, slice(None), [Request.CLEAR] * 3, VALUES)
        stand.on(28)
        assert stand.motors.enabled.all()

    def test_a_delay_holds_back_commands_but_not_switching(self) -> None:
        """2.6 ms are three steps; two commands are on their way at once."""
        stand = Stand(action_delay_s=0.0026)
        stand.on()
        assert not stand.torque(0).any()
        assert stand.motors.enabled.all()
        stand.ask(1, slice(None), None, VALUES)
        stand.ask(2, slice(None), None, 0.5 * VALUES)
        assert not stand.torque(3).any()
        np.testing.assert_allclose(stand.torque(4), torque_of(VALUES))
        np.testing.assert_allclose(stand.torque(5), torque_of(0.5 * VALUES))
        kinds = [Request.COMMAND, Request.DISABLE]
        stand.ask(6, np.array([1, 0]), kinds, VALUES[:, [1, 0]])
        found = stand.torque(8)
        assert found[0] == 0.0
        np.testing.assert_allclose(found[1:], torque_of(0.5 * VALUES)[1:])
        mixed = 0.5 * VALUES
        mixed[:, 1] = VALUES[:, 1]
        np.testing.assert_allclose(stand.torque(9)[1:], torque_of(mixed)[1:])

    def test_stiffness_and_damping_are_off_by_each_motors_own_share(self) -> None:
        stand = Stand(kp=np.array([1.1, 0.9, 1.3]), kd=np.array([0.8, 1.2, 0.7]))
        stand.on()
        stand.ask(0, np.array([2, 1]), None, VALUES[:, [2, 1]])
        expected = VALUES.copy()
        expected[2], expected[3] = VALUES[2] * [1.1, 0.9, 1.3], VALUES[3] * [0.8, 1.2, 0.7]
        expected[:, 0] = 0.0
        np.testing.assert_allclose(stand.torque(0), torque_of(expected))
        assert stand.end.next is not None
        np.testing.assert_array_equal(stand.end.next.values, VALUES[:, [2, 1]])  # not written to

    def test_they_close_their_loops_on_encoders_that_err(self) -> None:
        bias = np.array([0.01, -0.02, 0.03])
        stand = Stand(encoder_bias=bias)
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        np.testing.assert_allclose(stand.torque(0), torque_of(VALUES, bias))
        assert stand.motors.encoder_bias is not bias
        stand.ask(1, np.array([1]), [Request.ZERO], VALUES[:, :1])
        np.testing.assert_allclose(stand.motors.encoder_bias, [0.01, -0.02 + 0.2, 0.03])
        np.testing.assert_allclose(bias, [0.01, -0.02, 0.03])

    def test_one_that_is_switched_on_again_goes_on_one_that_was_off_is_limp(self) -> None:
        stand = Stand()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        stand.torque(0)
        stand.ask(1, np.array([1]), [Request.DISABLE], VALUES[:, :1])
        stand.on(2)
        found = stand.torque(2)
        np.testing.assert_allclose(found[[0, 2]], torque_of(VALUES)[[0, 2]])
        assert found[1] == 0.0

    def test_one_that_hears_nothing_switches_itself_off_and_says_so_until_switched_on(self) -> None:
        """After 20 steps, looked at every fifth."""
        stand = Stand()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        for step in range(1, 26):
            stand.ask(step, np.array([0, 2]), None, VALUES[:, [0, 2]])
            found = stand.torque(step)
            assert (found[1] == 0.0) == (step >= 25), step
            assert found[[0, 2]].all()
        assert stand.motors.enabled.tolist() == [True, False, True]
        stand.motors.faults.error[:] = [2, 0, 0]
        stand.ask(26, slice(None), None, VALUES)
        assert stand.end.replied[-1][2] == [2, 13, 0]
        stand.on(27, 1)
        stand.ask(28, np.array([2, 1, 0]), None, VALUES)
        assert stand.end.replied[-1][2] == [0, 0, 2]

    def test_commands_among_other_requests_are_each_their_motors_own(self) -> None:
        stand = Stand()
        stand.on()
        kinds = [Request.ENABLE, Request.COMMAND, Request.COMMAND]
        stand.ask(0, np.array([0, 2, 1]), kinds, VALUES[:, [0, 2, 1]])
        np.testing.assert_allclose(stand.torque(0), torque_of(VALUES * [0, 1, 1]))

    def test_one_that_went_off_stays_marked_when_another_follows(self) -> None:
        stand = Stand()
        stand.on()
        for step in range(1, 46):
            heard = [0, 2] if step < 15 else [0]
            stand.ask(step, np.array(heard), None, VALUES[:, heard])
            stand.torque(step)
        assert stand.motors.enabled.tolist() == [True, False, False]
        stand.ask(46, slice(None), None, VALUES)
        assert stand.end.replied[-1][2] == [0, 13, 13]

    def test_they_answer_in_the_order_of_the_requests_with_their_own_readings(self) -> None:
        stand = Stand()
        assert stand.ask(0, np.array([], dtype=int), None, np.zeros((5, 0))) is None
        stand.ask(0, np.array([2, 0]), None, VALUES[:, [2, 0]])
        motors, values, errors = stand.end.replied[-1]
        assert (motors, errors) == ([2, 0], [0, 0])
        np.testing.assert_array_equal(values, READINGS[:, [2, 0]])

    def test_silent_and_stuck_ones_are_told_from_their_neighbours(self) -> None:
        stand = Stand()
        first = stand.on()
        assert first is not None
        stand.motors.faults.silent[1] = True
        stand.motors.faults.stuck[2] = True
        stand.motors.faults.error[:] = 3
        stand.ask(1, slice(None), None, VALUES, 2.0 * READINGS)
        motors, values, errors = stand.end.replied[-1]
        assert (motors, errors) == ([0, 2], [3, 0])
        np.testing.assert_array_equal(values, READINGS[:, [0, 2]] * [2.0, 1.0])
        np.testing.assert_allclose(stand.torque(1), torque_of(VALUES * [1, 0, 1]))
        stand.motors.faults.silent[1] = False
        stand.ask(2, slice(None), None, VALUES, 3.0 * READINGS)
        np.testing.assert_array_equal(stand.end.replied[-1][1], READINGS * [3.0, 3.0, 1.0])
        stand.motors.faults.stuck[2] = False
        stand.ask(3, slice(None), None, VALUES, 4.0 * READINGS)
        np.testing.assert_array_equal(stand.end.replied[-1][1], 4.0 * READINGS)


# -- sensors -----------------------------------------------------------------------------------------


class Past:
    """Sensors of two joints, listed in reverse, over a state that is another one at each step."""

    def __init__(self, noise: Noise | None = None, seed: int = 3, **sample: Any) -> None:
        self.data = SimpleNamespace(qpos=np.zeros(10), qvel=np.zeros(9), sensordata=np.zeros(4))
        layout = Layout(np.array([9, 8]), np.array([8, 7]), 1, 1)
        self.sensors = SimulatedSensors(self.data, layout, Sample(**sample), noise, 0.001, 2, seed)  # type: ignore[arg-type]

    def step(self, k: int) -> None:
        data = self.data
        data.qpos[8:10], data.qvel[7:9] = (1 + k, 2 + k), (10 + k, 20 + k)
        turn = Rotation.from_euler("xyz", [0.1 * k, 0.2, -0.3])
        data.qpos[4:8], data.qvel[4:7] = turn.as_quat(scalar_first=True), (k, 2 * k, 3 * k)
        data.sensordata[:] = k, 5 * k, 7 * k, -1
        self.sensors.remember(np.array([100.0 + k, 200.0 + k]))


class TestSensors:
    @pytest.mark.parametrize(("delay_s", "steps"), [(0.0, 0), (0.002, 2), (0.0026, 3)])
    def test_they_show_the_moment_that_the_delay_has_passed_since(self, delay_s: float, steps: int) -> None:
        past = Past(observation_delay_s=delay_s)
        for now in range(12):
            past.step(now)
            k = max(0, now - steps)
            joints, inertial = past.sensors.joints(np.zeros(2)), past.sensors.inertial()
            np.testing.assert_allclose(
                joints, [[2 + k, 1 + k], [20 + k, 10 + k], [100 + k, 200 + k]], atol=1e-12
            )
            np.testing.assert_allclose(inertial.gyro, [k, 2 * k, 3 * k])
            np.testing.assert_allclose(inertial.acceleration, [k, 5 * k, 7 * k])
            turn = Rotation.from_euler("xyz", [0.1 * k, 0.2, -0.3])
            np.testing.assert_allclose(inertial.quaternion, turn.as_quat(scalar_first=True), atol=1e-12)

    def test_biases_are_the_same_at_every_reading(self) -> None:
        gyro, gravity = np.array([0.1, -0.2, 0.3]), np.array([0.03, -0.05, 0.02])
        past = Past(gyro_bias=gyro, gravity_bias=gravity, encoder_bias=np.array([9.0, 9.0]))
        past.step(1)
        turn = Rotation.from_euler("xyz", [0.1, 0.2, -0.3])
        down = turn.inv().apply([0.0, 0.0, -1.0]) + gravity
        for _ in range(3):
            joints, inertial = past.sensors.joints(np.array([0.5, -0.25])), past.sensors.inertial()
            np.testing.assert_allclose(joints, [[3.5, 1.75], [21, 11], [101, 201]])
            np.testing.assert_allclose(inertial.gyro, [1.1, 1.8, 3.3])
            biased = Rotation.from_quat(inertial.quaternion, scalar_first=True)
            felt = biased.inv().apply([0.0, 0.0, -1.0])
            np.testing.assert_allclose(felt, down / np.linalg.norm(down), atol=1e-12)
            assert (biased * turn.inv()).magnitude() < 0.1  # the heading stays

    def test_noise_has_its_half_width_on_each_reading_and_is_another_each_time(self) -> None:
        widths = Noise(gyro=0.4, gravity=0.01, joint_position=0.02, joint_velocity=3.0)
        past, again, other = Past(widths), Past(widths), Past(widths, seed=4)
        for each in (past, again, other):
            each.step(0)
        joints = np.array([past.sensors.joints(np.zeros(2)) for _ in range(600)])
        np.testing.assert_array_equal(joints[0], again.sensors.joints(np.zeros(2)))
        assert (joints[0] != other.sensors.joints(np.zeros(2)))[:2].all()
        error = joints - [[2, 1], [20, 10], [100, 200]]
        assert not error[:, 2].any()
        for row, width in ((0, 0.02), (1, 3.0)):
            np.testing.assert_allclose(np.abs(error[:, row]).max(axis=0), width, rtol=0.02)
            np.testing.assert_allclose(error[:, row].mean(axis=0), 0.0, atol=0.1 * width)
        assert len(np.unique(error[:, 0])) == 1200
        inertial = [past.sensors.inertial() for _ in range(600)]
        gyro = np.array([each.gyro for each in inertial])
        np.testing.assert_allclose(np.abs(gyro).max(axis=0), 0.4, rtol=0.02)
        turns = Rotation.from_quat([each.quaternion for each in inertial], scalar_first=True)
        down = turns.inv().apply([0.0, 0.0, -1.0])
        level = Rotation.from_euler("xyz", [0.0, 0.2, -0.3]).inv().apply([0.0, 0.0, -1.0])
        across = (down - level)[:, 1]
        assert np.abs(across).max() == pytest.approx(0.01, rel=0.03)


# -- wires -------------------------------------------------------------------------------------------


class PlainWires:
    """The same rules, a frame at a time."""

    def __init__(self, wires: int, queue: int) -> None:
        self.free = [0.0] * wires
        self.queue = queue
        self.flying: tuple[deque, deque] = deque(), deque()
        self.sent, self.refused = np.zeros((2, wires), int), np.zeros((2, wires), int)
        self.busy = np.zeros(wires)

    def send(self, side: int, frames: list[tuple[int, int, int]], now: float) -> None:
        begun = list(self.free)
        waiting = [sum(w == k and due > now for due, w, _ in self.flying[side]) for k in range(len(begun))]
        for at, length, name in frames:
            waiting[at] += 1
            full = waiting[at] > self.queue if side == 0 else begun[at] > now + 20_000
            if full:
                self.refused[side, at] += 1
                continue
            self.free[at] = max(self.free[at], now) + frame_bits(length)
            self.busy[at] += frame_bits(length)
            self.sent[side, at] += 1
            self.flying[side].append((self.free[at], at, name))

    def receive(self, side: int, now: float) -> list[int]:
        """Names of what arrived."""
        arrived = [name for due, _, name in self.flying[1 - side] if due <= now]
        rest = [item for item in self.flying[1 - side] if item[0] > now]
        self.flying[1 - side].clear()
        self.flying[1 - side].extend(rest)
        return arrived


@pytest.mark.parametrize("seed", range(12))
def test_wires_carry_random_traffic_as_plain_ones_would(seed: int) -> None:
    """Unequal buses and lengths, some batches sent again, both sides, from idle to jammed."""
    rng = np.random.default_rng(seed)
    wires, plain = SimulatedWires(("a", "b", "c"), host_queue=4), PlainWires(3, 4)
    usual = rng.integers(0, 3, 5), rng.integers(0, 9, 5)
    now, name = 0.0, 0
    for _ in range(60):
        now += float(rng.choice([0, 40, 135, 500, 3000]))
        side = Side(int(rng.integers(2)))
        k = int(rng.integers(0, 6 if seed < 9 else 60))
        if rng.random() < 0.4:
            channel, length = usual
        else:
            channel, length = rng.choice([0, 0, 1, 2], k), rng.integers(0, 9, k)
        names = np.arange(name, name + len(channel))
        name += len(channel)
        batch = Frames(channel, names, np.zeros((len(channel), 8), np.uint8), length)
        before = plain.refused.sum()
        lost = wires.send(side, batch, now)
        plain.send(side, list(zip(channel.tolist(), length.tolist(), names.tolist(), strict=True)), now)
        assert lost == plain.refused.sum() - before
        now += float(rng.choice([0, 100, 135, 400]))
        for end in Side:
            arrived = [int(n) for each in wires.receive(end, now) for n in each.id]
            assert sorted(arrived) == sorted(plain.receive(end, now))
    for side in Side:
        np.testing.assert_array_equal(wires.sent(side), plain.sent[side])
        np.testing.assert_array_equal(wires.refused[side], plain.refused[side])
    np.testing.assert_allclose(wires.busy_us(), plain.busy)
    assert plain.sent.sum() > 50


# -- trials ------------------------------------------------------------------------------------------


class FakeBody:
    """Counts what it is asked for; each truth is another one."""

    def __init__(self) -> None:
        self.model = SimpleNamespace(nq=19)
        self.notes = ("a plant's note",)
        self.pushes: list[tuple[float, ...]] = []
        self.looks = 0
        self.reason: str | None = None
        self.lost = False

    def truth(self) -> Any:
        self.looks += 1
        k = float(self.looks)
        names = (
            "base_quaternion",
            "base_angular_velocity",
            "joint_position",
            "joint_velocity",
            "motor_torque",
        )
        rest = dict.fromkeys((*names, "foot_position", "foot_velocity", "foot_force", "qpos"), np.full(3, k))
        rest["foot_position"] = np.full((1, 3), k)
        values = {
            "base_position": np.array([0.25 * k, 0.0, 9.0]),
            "base_velocity": np.array([k, 2 * k, 3 * k]),
            "foot_contact": np.array([True]),
            "legs_touch": k > 1,
            **rest,
        }
        return SimpleNamespace(**values, _asdict=lambda: values)

    def take_power(self) -> Any:
        return SimpleNamespace(electrical=3.0, mechanical=2.0, positive=2.5)

    def push(self, delta: tuple[float, float, float]) -> None:
        self.pushes.append(delta)

    def fall(self) -> str | None:
        return self.reason

    def diverged(self) -> bool:
        return self.lost


class FakeLoop:
    """As much of a control loop as a trial looks at."""

    def __init__(self) -> None:
        self.state = SimpleNamespace(mode=Mode.WALKING)
        self.walking_s = 0.0
        self.estimate = np.array([7.0, 8.0, 9.0]), 0.31
        self.asked_command = np.array([0.1, 0.2, 0.3])
        self.target = np.array([5.0])
        self.finished = 0

    def finish(self, skip_lie_down: bool) -> None:
        assert skip_lie_down  # a robot that fell neither stops nor lies down first
        self.finished += 1


OUTCOME = SessionResult(
    final_state="IDLE",
    faults=(),
    walked_s=1.0,
    run_s=2.0,
    wall_s=3.0,
    compute_ms=np.zeros(1),
    timing={},
    buses=(BusStatistics("can0"),),
    notes=("a loop's note",),
)


def trial_of(go1: Robot, watch: Any = None, **episode: Any) -> tuple[_Trial, FakeBody, FakeLoop]:
    body = FakeBody()
    settings = Episode(command_source=lambda _: np.zeros(3), duration_s=1.0, **episode)
    return _Trial(go1, body, settings, watch), body, FakeLoop()  # type: ignore[arg-type]


class TestTrial:
    def test_it_looks_at_the_record_rate_while_the_robot_walks(self, go1: Robot) -> None:
        watched = []
        trial, body, loop = trial_of(
            go1, lambda loop, body: watched.append((loop, body)), record_rate_hz=40.0
        )
        assert np.isnan(trial.velocity()).all()
        loop.state.mode = Mode.STANDING
        trial.tick(loop)  # type: ignore[arg-type]
        assert body.looks == 0
        loop.state.mode = Mode.WALKING
        for tick in range(51):
            loop.walking_s = tick * 0.002
            trial.tick(loop)  # type: ignore[arg-type]
        assert watched == [(loop, body)] * 52
        trace = trial.trace(OUTCOME)
        np.testing.assert_allclose(trace.time_s, [0.0, 0.026, 0.05, 0.076, 0.1])
        assert trial.velocity().tolist() == [5.0, 10.0, 15.0]
        np.testing.assert_array_equal(trace.base_velocity[:, 0], [1, 2, 3, 4, 5])
        np.testing.assert_array_equal(trace.command, np.tile([0.1, 0.2, 0.3], (5, 1)))
        np.testing.assert_array_equal(trace.joint_target, np.full((5, 1), 5.0))
        np.testing.assert_array_equal(trace.estimated_velocity[-1], [7, 8, 9])
        assert trace.estimated_height.tolist() == [0.31] * 5
        assert (trace.electrical_power[0], trace.mechanical_power[0], trace.positive_power[0]) == (3, 2, 2.5)
        assert trace.record_rate_hz == 40.0
        np.testing.assert_allclose(trace.mean_velocity, [3.0, 6.0, 9.0])
        assert trace.distance_m == pytest.approx(1.0)
        assert trace.notes == ("a loop's note", "a plant's note")
        assert (trace.fell, trace.fall_reason, trace.final_state, trace.faults) == (False, "", "IDLE", ())
        assert loop.finished == 0

    def test_pushes_come_once_each_at_the_first_tick_of_their_time(self, go1: Robot) -> None:
        pushes = (Push(0.03, (3.0, 0.0, 0.0)), Push(0.01, (1.0, 0.0, 0.0)), Push(0.01, (2.0, 0.0, 0.0)))
        trial, body, loop = trial_of(go1, pushes=pushes)
        seen = []
        for now_s in (0.0, 0.008, 0.01, 0.012, 0.028, 0.031, 0.04):
            loop.walking_s = now_s
            trial.tick(loop)  # type: ignore[arg-type]
            seen.append([delta[0] for delta in body.pushes])
        assert seen == [[], [], [1, 2], [1, 2], [1, 2], [1, 2, 3], [1, 2, 3]]

    def test_without_a_record_it_still_measures_and_sees_falls(self, go1: Robot) -> None:
        trial, body, loop = trial_of(go1, record=False)
        for tick in range(3):
            loop.walking_s = 0.01 * tick
            trial.tick(loop)  # type: ignore[arg-type]
        body.reason = "it lies down"
        loop.walking_s = 0.03
        trial.tick(loop)  # type: ignore[arg-type]
        assert loop.finished == 1
        trace = trial.trace(OUTCOME)
        assert trace.distance_m == pytest.approx(0.75)
        assert (trace.fell, trace.fall_reason, trace.final_state) == (True, "it lies down", "FALLING")
        widths = {
            "time_s": (), "command": (3,), "base_position": (3,), "base_quaternion": (4,),
            "base_velocity": (3,), "base_angular_velocity": (3,), "joint_position": (12,),
            "joint_velocity": (12,), "motor_torque": (12,), "joint_target": (12,), "foot_position": (4, 3),
            "foot_velocity": (4, 3), "foot_contact": (4,), "foot_force": (4,), "qpos": (19,),
            "estimated_velocity": (3,), "estimated_height": (), "electrical_power": (),
            "mechanical_power": (), "positive_power": (), "legs_touch": (),
        }  # fmt: skip
        for name, width in widths.items():
            assert getattr(trace, name).shape == (0, *width), name
            assert getattr(trace, name).dtype == (bool if name in ("foot_contact", "legs_touch") else float)

    def test_lost_numbers_end_it_as_a_fault(self, go1: Robot) -> None:
        trial, body, loop = trial_of(go1)
        body.lost = True
        trial.tick(loop)  # type: ignore[arg-type]
        assert loop.finished == 1
        trace = trial.trace(replace(OUTCOME, faults=("first",)))
        assert trace.faults == ("first", "the simulation diverged")
        assert (trace.fell, trace.fall_reason, trace.final_state) == (True, "", "IDLE")

    def test_a_fall_that_the_supervisor_saw_has_its_reason(self, go1: Robot) -> None:
        trial, *_ = trial_of(go1)
        trace = trial.trace(replace(OUTCOME, final_state="FALLING", faults=("tilt of 1.2 rad", "later")))
        assert (trace.fell, trace.fall_reason) == (True, "tilt of 1.2 rad")
        stopped = trial.trace(replace(OUTCOME, final_state="ESTOP", faults=("no reply",)))
        assert (stopped.fell, stopped.fall_reason) == (False, "")


def test_a_recorder_stacks_rows_in_their_order() -> None:
    recorder = Recorder(2, 1, 9)
    recorder.add(a=1.0, b=np.array([1, 2]))
    recorder.add(a=2.0, b=np.array([3, 4]))
    arrays = recorder.arrays()
    assert arrays["a"].tolist() == [1.0, 2.0]
    assert arrays["b"].tolist() == [[1, 2], [3, 4]]
    assert Recorder(2, 1, 9).rows == {}


@pytest.mark.parametrize("asked", [True, False])
def test_what_an_episode_asks_for_reaches_plant_and_session(
    go1: Robot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, asked: bool
) -> None:
    seen: dict[str, Any] = {}

    class Body(FakeBody):
        def __init__(self, robot: Robot, wiring: Any, wires: Any, config: Any, seed: int) -> None:
            super().__init__()
            seen.update(robot=robot, wires=wires, config=config, seed=seed)

    def run_session(
        robot: Any, policy: Any, bus: Any, session: Any, each_tick: Any, base: Any
    ) -> SessionResult:
        seen.update(policy=policy, bus=bus, session=session, each_tick=each_tick, base=base)
        return OUTCOME

    monkeypatch.setattr(episode_module, "SimulatedRobot", Body)
    monkeypatch.setattr(episode_module, "run_session", run_session)

    def command(_: float) -> np.ndarray:
        return np.zeros(3)

    shown = []
    further: dict[str, Any] = {
        "seed": 5,
        "plant": tmp_path / "other.xml",
        "sample": {"friction": 0.4},
        "noise": Noise(gyro=0.1),
        "ground_truth": True,
        "realtime": True,
        "log": tmp_path / "log.mcap",
        "policy_spec": "mine.onnx",
        "config": DeployConfig(host_queue=3, motor_timeout_s=0.3),
        "display": lambda loop, velocity: shown.append((loop, velocity())),
    }
    policy = SimpleNamespace(name="hold")
    run_episode(go1, policy, Episode(command, 2.5, **(further if asked else {})))  # type: ignore[arg-type]
    session, plant = seen["session"], seen["config"]
    assert seen["robot"] is go1
    assert seen["policy"] is policy
    assert (session.command_source, session.duration_s) == (command, 2.5)
    assert session.realtime is asked
    if not asked:
        assert (plant.plant, plant.sample, plant.noise, plant.motor_timeout_s) == (None, {}, None, 0.1)
        assert (seen["seed"], session.log, seen["base"], session.display) == (0, None, None, None)
        assert session.facts == {"seed": 0, "policy_spec": "hold", "bus": "sim", "plant": None}
        return
    assert (plant.plant, plant.sample) == (further["plant"], further["sample"])
    assert (plant.noise, plant.motor_timeout_s) == (further["noise"], 0.3)
    assert (seen["seed"], session.log, session.config) == (5, further["log"], further["config"])
    assert seen["wires"]._host_queue == 3
    assert session.facts == {
        "seed": 5,
        "policy_spec": "mine.onnx",
        "bus": "sim",
        "plant": str(further["plant"]),
    }
    session.display("a loop")
    assert shown[0][0] == "a loop"
    assert np.isnan(shown[0][1]).all()
    velocity, height = seen["base"]()
    np.testing.assert_array_equal(velocity, [1.0, 2.0, 3.0])
    assert height == pytest.approx(9.0 - 1.0)


def test_a_guards_thread_and_the_loops_take_turns() -> None:
    """Both would step one simulation at once."""
    inside, at_once = [0], [0]

    def act(*_: object) -> list[Frames]:
        inside[0] += 1
        at_once.append(inside[0])
        time.sleep(0.01)
        inside[0] -= 1
        return []

    bus = SimulatedBus(SimpleNamespace(send=act, receive=act), SimpleNamespace(advance=act))  # type: ignore[arg-type]
    with ThreadPoolExecutor(3) as threads:
        for each in (bus.receive, bus.receive, partial(bus.send, None)):  # type: ignore[arg-type]
            threads.submit(each, 0)
    assert at_once == [0, 1, 1, 1, 1, 1]


def test_what_the_host_sent_and_a_full_wire_refused_is_the_hosts(go1: Robot) -> None:
    wires = SimulatedWires(wire(go1).buses, host_queue=3)
    bus = SimulatedBus(wires, SimpleNamespace(time_us=1000))  # type: ignore[arg-type]
    channel = np.array([1] * 5 + [2] * 4)
    frames = Frames(channel, np.full(9, 1), np.zeros((9, 8), np.uint8), np.full(9, 8))
    wires.send(Side.HOST, frames, 0)
    wires.refused[Side.ROBOT] = [7, 8, 9, 10]
    assert [statistics.frames_refused for statistics in bus.statistics()] == [0, 2, 1, 0]


def test_the_stand_in_robot_takes_its_options(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []

    @contextmanager
    def serving(robot: Robot, interface: str, config: PlantConfig) -> Iterator[None]:
        taken.append((robot.name, interface, config))
        yield

    monkeypatch.setattr(serve, "serving", serving)
    options = "--robot hexapod --bus virtual --plant other.xml --motor-timeout 0.7 --duration 0.0"
    monkeypatch.setattr("sys.argv", ["serve", *options.split()])
    serve.main()
    assert taken == [("hexapod", "virtual", PlantConfig(Path("other.xml"), motor_timeout_s=0.7))]
