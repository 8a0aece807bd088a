"""The simulated robot: initial position, time, pushes, IMU, battery, true state, falls, other plants."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from changed_robots import described
from edited import content_of, edit
from scipy.spatial.transform import Rotation

from footfall import Robot, UserError, load_robot
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.sample import Sample
from footfall.plant.battery import SimulatedBattery
from footfall.plant.engines.engine import MujocoEngine
from footfall.plant.ground_truth import GroundTruth
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.sensors import Layout
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.battery import Battery
from footfall.robots.model import joint_addresses, read_plant

# No joint is at its old position or beside its old neighbour.
ORDER = [7, 2, 11, 0, 5, 9, 4, 1, 10, 3, 8, 6]


def body_of(robot: Robot, **difference: Any) -> SimulatedRobot:
    """A simulated robot without a controller."""
    wiring = wiring_of(robot)
    return SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses), PlantConfig(held=False, **difference))


@pytest.fixture
def altered(own_folder: Path) -> Robot:
    """go1 with joints in another order and a foot of two spheres; its MJCF begins with a swinging gate."""
    gate = '<body pos="3 0 1"><joint name="gate" axis="0 0 1" ref="0.7"/><geom size="0.2"/></body>'
    # The heel is three centimetres behind the foot in the default pose.
    heel = '<geom name="FR_foot" class="foot"/><geom name="FR_heel" class="foot" pos="-0.01865 0 -0.1895"/>'
    edit(own_folder, "robot.xml", "<worldbody>", f"<worldbody>{gate}")
    edit(own_folder, "robot.xml", '<geom name="FR_foot" class="foot"/>', heel)
    with content_of(own_folder / "robot.yaml") as content:
        content["joints"] = [content["joints"][k] for k in ORDER]
        content["feet"][0]["geoms"] = ["FR_foot", "FR_heel"]
    return load_robot(own_folder)


@pytest.fixture
def thrown(altered: Robot) -> SimulatedRobot:
    """The altered robot high above the ground, tilted about all axes, with joints and gate in motion."""
    body = body_of(altered)
    data, model = body.data, body.model
    rng = np.random.default_rng(8)
    turned = Rotation.from_euler("xyz", [0.4, -0.3, 2.0]).as_quat(scalar_first=True)
    data.qpos[1:8] = [1.0, -2.0, 6.0, *turned]
    data.qpos[8:] += rng.uniform(-0.2, 0.2, model.nq - 8)
    data.qvel[:] = rng.uniform(-2.0, 2.0, model.nv)
    mujoco.mj_forward(model, data)
    return body


def test_the_robot_starts_on_the_highest_ground_below_its_feet(altered: Robot, own_folder: Path) -> None:
    """A step under one foot raises the robot by the step's height; the gate stays at its position."""
    plant = own_folder / "step.xml"
    step = '<geom type="plane" size="0 0 1" pos="0 0 -1"/>'
    step += '<geom type="box" size="0.1 0.1 0.2" pos="0.19 0.13 -0.9"/>'
    plant.write_text(altered.xml_path.read_text().replace("<worldbody>", f"<worldbody>{step}"))
    body = body_of(altered, plant=plant)
    data = body.data
    np.testing.assert_array_equal(data.qpos[joint_addresses(body.model, altered)[0]], altered.default_pose)
    assert data.qpos[[0, 1, 2, 4, 5, 6, 7]].tolist() == [0.7, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    assert data.qpos[3] == pytest.approx(altered.description.standing_height_m - 0.7, abs=1e-4)
    assert data.geom("FL_foot").xpos[2] - 0.023 == pytest.approx(-0.7, abs=1e-6)


def test_a_plant_with_ground_too_far_below_is_refused(go1: Robot, tmp_path: Path) -> None:
    deep = '<worldbody><geom type="plane" size="0 0 1" pos="0 0 -6"/>'
    (tmp_path / "deep.xml").write_text(go1.xml_path.read_text().replace("<worldbody>", deep))
    with pytest.raises(UserError, match="4 m"):
        body_of(go1, plant=tmp_path / "deep.xml")


def test_a_push_is_in_the_worlds_axes_and_acts_on_the_base_only(thrown: SimulatedRobot) -> None:
    before = thrown.data.qvel.copy()
    thrown.push((0.1, -0.2, 0.3))
    expected = [0.0, 0.1, -0.2, 0.3, *np.zeros(len(before) - 4)]
    np.testing.assert_allclose(thrown.data.qvel - before, expected, atol=1e-12)


def test_the_imu_reports_every_two_milliseconds_with_the_next_count(go1: Robot) -> None:
    wiring = wiring_of(go1)
    wires = SimulatedWires(wiring.buses)
    body = SimulatedRobot(go1, wiring, wires)

    def received_counts(until_us: int) -> list[int]:
        """Counters of arrived gyro frames. Only the IMU's bus has gyro frames."""
        body.advance(until_us)
        frames = wires.receive(Side.HOST, until_us)
        assert all((batch.channel == wiring.imu_channel).all() for batch in frames)
        assert all(batch.id.tolist() == [0x300, 0x301, 0x302] for batch in frames)
        return [int.from_bytes(batch.data[0, 6:].tobytes(), "big") for batch in frames]

    assert [received_counts(until_us) for until_us in (1000, 2500, 7000)] == [[1], [], [2, 3, 4]]
    body.faults.imu_stuck = True
    assert received_counts(9000) == [4]
    body.faults.imu_silent = True
    assert received_counts(13_000) == []
    body.faults.imu_silent = body.faults.imu_stuck = False
    assert received_counts(15_000) == [5]


def test_a_batterys_voltage_falls_with_load_and_charge_and_acts_on_the_motors(go1: Robot) -> None:
    """The energy drawn is the charge lost."""
    battery = Battery(10, 1.0, 0.2)
    shares = [1.0]
    motors = SimpleNamespace(enabled=np.ones(12, bool), supply=None, sag=shares.append)
    pack = SimulatedBattery(go1, battery, motors, 1.0, 0.001)  # type: ignore[arg-type]
    at_rest_v = pack.voltage_v
    torque, speed = np.full(12, 5.0), np.full(12, 2.0)
    given_j = 0.0
    for _ in range(5000):
        pack.add(torque, speed, speed)
        given_j += (pack.voltage_v + pack.current_a * battery.internal_resistance_ohm) * pack.current_a * 1e-3
    watts = float((torque * speed + go1.copper_loss * torque**2).sum())
    assert pack.voltage_v * pack.current_a == pytest.approx(watts)
    assert pack.voltage_v < at_rest_v - 0.2 * pack.current_a
    assert np.prod(shares) == pytest.approx(pack.voltage_v / battery.nominal_v)
    assert motors.supply == pytest.approx((pack.voltage_v, pack.current_a / 12))
    # Above half of its charge the voltage exceeds the nominal one, so a joule takes less charge.
    assert 0.85 * given_j < (1.0 - pack.charge) * 3600.0 * battery.capacity_wh < given_j


def test_a_drawn_charge_is_that_of_the_simulated_pack_and_samples_for_other_robots_are_refused(
    go1: Robot,
) -> None:
    drawn = {"battery_charge": np.array(0.3)}
    simulated = body_of(described(go1, battery=Battery(8, 230.0, 0.1)), sample=drawn)
    assert simulated.battery is not None
    assert simulated.battery.charge == pytest.approx(0.3)
    misspelt = {"frictoin": np.array(1.0)}
    others = (Sample(link_mass=np.ones(3)), r"3 bodies.* 13"), (misspelt, "frictoin.* friction")
    for sample, reason in ((drawn, "battery_charge"), *others):
        with pytest.raises(UserError, match=reason):
            body_of(go1, sample=sample)


def test_every_part_of_the_state_is_found_in_a_plant_of_more_than_the_robot(
    altered: Robot, thrown: SimulatedRobot
) -> None:
    data, truth = thrown.data, thrown.truth()
    turn = Rotation.from_quat(data.qpos[4:8], scalar_first=True)
    np.testing.assert_array_equal(truth.base_position, [1.0, -2.0, 6.0])
    np.testing.assert_array_equal(truth.base_quaternion, data.qpos[4:8])
    np.testing.assert_allclose(truth.base_velocity, turn.inv().apply(data.qvel[1:4]), atol=1e-12)
    np.testing.assert_array_equal(truth.base_angular_velocity, data.qvel[4:7])
    for k, name in enumerate(altered.joint_names):
        joint = data.joint(name)
        assert (truth.joint_position[k], truth.joint_velocity[k]) == (joint.qpos[0], joint.qvel[0])
    np.testing.assert_array_equal(truth.qpos, data.qpos)
    positions = []
    for dt in (-1e-6, 0.0, 1e-6):
        moved = mujoco.MjData(thrown.model)
        moved.qpos[:] = data.qpos
        mujoco.mj_integratePos(thrown.model, moved.qpos, data.qvel, dt)
        mujoco.mj_kinematics(thrown.model, moved)
        spheres = ([moved.geom(geom).xpos for geom in foot.geoms] for foot in altered.description.feet)
        positions.append([np.mean(each, axis=0) for each in spheres])
    np.testing.assert_allclose(truth.foot_position, positions[1], atol=1e-12)
    np.testing.assert_allclose(truth.foot_velocity, np.subtract(positions[2], positions[0]) / 2e-6, atol=1e-6)
    assert np.abs(truth.foot_velocity).min() > 0.01


def test_an_earlier_snapshot_does_not_change_when_the_simulation_goes_on(go1: Robot) -> None:
    body = body_of(go1)
    body.data.qvel[:] = 0.3
    mujoco.mj_forward(body.model, body.data)
    earlier = body.snapshot()
    kept = body.truths([earlier])
    body.data.qpos[:3] += 0.1
    body.data.qvel[:] = 0.1
    mujoco.mj_forward(body.model, body.data)
    assert (body.truth().foot_velocity != kept.foot_velocity[0]).all()
    for now, then in zip(body.truths([earlier]), kept, strict=True):
        np.testing.assert_array_equal(now, then)


def test_legs_touch_where_two_of_them_press_on_each_other(go1: Robot) -> None:
    """Legs of a standing robot do not touch. In the air, its front or its rear feet are moved together."""
    body = body_of(go1)
    data, model = body.data, body.model

    def legs_touch(pose: np.ndarray) -> bool:
        """Whether legs touch in the air, in a pose (n,) of go1's joints."""
        data.qpos[2], data.qpos[7:] = 1.0, pose
        mujoco.mj_forward(model, data)
        return body.truth().legs_touch

    mujoco.mj_forward(model, data)
    assert body.truth().foot_contact.all()
    assert not body.truth().legs_touch
    for leg in (0, 2):
        assert not legs_touch(go1.default_pose * np.tile((-1.0, 1.0, 1.0), 4))
        inwards = go1.default_pose.copy()
        inwards[[3 * leg, 3 * leg + 3]] = 0.45, -0.45
        assert legs_touch(inwards)
        assert len({model.geom_bodyid[geom] for geom in data.contact.geom.ravel()}) == 2


def test_a_base_below_0_4_of_the_standing_height_has_sunk(go1: Robot) -> None:
    body = body_of(go1)
    body.data.qpos[2] = 7.0
    body.data.qpos[9] += 0.2  # one foot is higher than the others
    mujoco.mj_forward(body.model, body.data)
    layout, engine = Layout(slice(7, 19), slice(6, 18), 0, 0), MujocoEngine(body.model, body.data)
    for share, fall in ((0.39, "the base sank to the height of the feet"), (0.41, None)):
        height_m = (7.0 - body.truth().foot_position[:, 2].min()) / share
        truth = GroundTruth(read_plant(go1, visual=False), body.data, engine, layout, height_m)
        assert truth.fall(truth.snapshot(np.zeros(12))) == fall


def test_a_tilt_past_70_degrees_is_a_fall(go1: Robot) -> None:
    """A turn about the vertical is none."""
    body = body_of(go1)
    for axis in range(3):
        for degrees in (69.0, 71.0, -71.0, 150.0):
            half = np.deg2rad(degrees) / 2
            body.data.qpos[2:7] = 2.0, np.cos(half), 0.0, 0.0, 0.0
            body.data.qpos[4 + axis] = np.sin(half)
            mujoco.mj_forward(body.model, body.data)
            assert bool(body.fall()) is (axis < 2 and abs(degrees) > 70.0), (axis, degrees)


def test_only_contact_of_the_base_with_the_ground_is_a_fall(go1: Robot) -> None:
    """Thighs on the ground are no fall, nor are contacts of the base with the robot itself."""
    body = body_of(go1)
    data, model = body.data, body.model
    data.qpos[7:] = np.tile([0.0, 1.57, -0.9], 4)
    thigh, trunk = model.body("FR_thigh").id, model.body("trunk").id
    for height in np.arange(0.4, 0.0, -0.001):
        data.qpos[2] = height
        mujoco.mj_forward(model, data)
        touching = {frozenset(model.geom_bodyid[pair].tolist()) for pair in data.contact.geom}
        reason = body.fall()
        if frozenset({0, trunk}) in touching:
            assert reason == "the base touched the ground"
            return
        assert reason != "the base touched the ground"
        assert reason is None or frozenset({0, thigh}) in touching
    pytest.fail("the trunk never touched")


def test_nan_warnings_differ_from_other_warnings(go1: Robot) -> None:
    for kind in ("BADQPOS", "BADQVEL", "BADQACC", "CONTACTFULL"):
        body = body_of(go1)
        assert not body.diverged()
        body.data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{kind}")].number = 1
        assert body.diverged() is (kind != "CONTACTFULL"), kind


def test_a_plant_without_reflected_inertia_gets_the_robots(go1: Robot, tmp_path: Path) -> None:
    plant, text = tmp_path / "light.xml", go1.xml_path.read_text()
    for armature in (' armature="0.00403"', ' armature="0.00906"'):
        assert armature in text
        text = text.replace(armature, "")
    plant.write_text(text)
    body = body_of(go1, plant=plant)
    assert "reflected inertia" in body.notes[0]
    np.testing.assert_allclose(body.model.dof_armature[6:], go1.armature)
