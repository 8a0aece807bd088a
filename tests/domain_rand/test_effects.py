"""Each named distribution changes the quantity of physics or readings in its name.

Delays, pushes and initial states are tested with the loop and the
environment.
"""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from mujoco import mjx

from footfall.domain_rand.bodies import BodyMap, apply_to_model, body_map, randomised_fields
from footfall.domain_rand.noise import Noise, biased, noisy
from footfall.domain_rand.quantity import scales_joints
from footfall.domain_rand.randomisation import QUANTITIES, load_randomisation
from footfall.domain_rand.sample import Sample, draw, randomised_command, randomised_motor, sensor_bias
from footfall.plant.ground import replaced_by
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.model import plant_model, read_plant, training_model
from footfall.terrain.declaration import load_ground

Build = Callable[[Sample], mujoco.MjModel]


@pytest.fixture
def build(go1: Robot) -> Build:
    """Makes the plant of a sample."""

    def make(sample: Sample) -> mujoco.MjModel:
        model = plant_model(go1)
        apply_to_model(model, sample, body_map(model, go1))
        return model

    return make


class TestBody:
    @pytest.mark.parametrize("lying", ['pos="0 0 0"', 'pos=".1 0 0" euler="0 0 30"'])
    def test_a_centre_of_mass_moves_alone_wherever_it_was(self, lying: str) -> None:
        """MuJoCo's compiler marks a body whose inertia, geoms and sites coincide, as in this model."""
        model = mujoco.MjModel.from_xml_string(
            f"""<mujoco><worldbody><body name="base"><freejoint/>
            <inertial {lying} mass="1" diaginertia=".3 .2 .15"/>
            <geom type="box" size=".1 .2 .3" {lying}/><site {lying}/>
            <body><joint/><geom size=".1"/></body></body></worldbody></mujoco>"""
        )
        before, after, offset = mujoco.MjData(model), mujoco.MjData(model), np.array([0.05, 0.0, 0.02])
        mujoco.mj_kinematics(model, before)
        where = BodyMap(base=model.body("base").id, contact_geoms=(), dofs=())
        apply_to_model(model, Sample(com_offset_m=offset), where)
        mujoco.mj_kinematics(model, after)
        np.testing.assert_allclose(after.xipos[where.base], before.xipos[where.base] + offset, atol=1e-12)
        for field in ("ximat", "geom_xpos", "geom_xmat", "site_xpos", "site_xmat"):
            np.testing.assert_allclose(getattr(after, field), getattr(before, field), atol=1e-12)

    def test_friction_is_set_on_all_geoms_of_the_ground(self, go1: Robot) -> None:
        model = read_plant(go1, change=replaced_by(load_ground("blocks"))).model
        changed = randomised_fields(model, Sample(friction=np.array(0.3)), body_map(model, go1))
        ground = model.geom_bodyid == 0
        assert ground.sum() > 100
        assert (changed["geom_friction"][ground, 0] == 0.3).all()

    def test_derived_constants_follow_the_masses(self, build: Build) -> None:
        nominal, heavy = build(Sample()), build(Sample(link_mass=np.full(13, 2.0)))
        np.testing.assert_allclose(heavy.body_subtreemass, 2 * nominal.body_subtreemass)
        assert np.all(heavy.body_invweight0[1:, 0] < nominal.body_invweight0[1:, 0])

    def test_mujoco_and_mjx_models_change_in_the_same_way(self, go1: Robot) -> None:
        model = training_model(go1)
        where: BodyMap = body_map(model, go1)
        rng = np.random.default_rng(0)
        sample = draw(load_randomisation(), lambda k: rng.random(k).astype(np.float32), 12, 13)
        in_numpy = randomised_fields(model, sample, where)
        in_jax = randomised_fields(mjx.put_model(model), sample, where)
        assert set(in_numpy) == set(in_jax) == {
            "body_mass", "body_inertia", "body_ipos", "dof_armature", "geom_friction",
        }  # fmt: skip
        for name, value in in_numpy.items():
            np.testing.assert_allclose(value, in_jax[name], rtol=1e-6, atol=1e-8, err_msg=name)


LEVEL = {
    "gyro": np.zeros(3),
    "gravity": np.array([0.0, 0.0, -1.0]),
    "joint_position": np.zeros(12),
    "joint_velocity": np.zeros(12),
}


class TestEveryField:
    """Each effect on values that all differ, computed with plain NumPy."""

    def test_a_joint_is_changed_at_its_own_degree_of_freedom(self) -> None:
        """The joints have another order than the model's degrees of freedom."""
        where = BodyMap(base=1, contact_geoms=(), dofs=(4, 2, 7))
        effect = scales_joints("dof_armature")
        changed = effect.change(np.arange(1.0, 9.0), np.array([10.0, 100.0, 1000.0]), where)
        np.testing.assert_allclose(changed, [1, 2, 300, 4, 50, 6, 7, 8000])

    def test_effects_on_motors_and_commands_equal_plain_numpy(self, go1: Robot) -> None:
        rng = np.random.default_rng(2)
        names = ("joint_friction", "joint_damping", "motor_strength", "kp", "kd")
        sample = {name: rng.uniform(0.5, 1.5, 12) for name in names} | {"battery": np.array(0.8)}
        motor = go1.motor._replace(damping=rng.random(12), friction_speed=rng.random(12))
        changed = randomised_motor(motor, sample)
        np.testing.assert_allclose(changed.friction, motor.friction * sample["joint_friction"])
        np.testing.assert_allclose(changed.damping, motor.damping + sample["joint_damping"])
        np.testing.assert_allclose(changed.strength, motor.strength * sample["motor_strength"])
        np.testing.assert_allclose(changed.stall_torque, motor.stall_torque * 0.8)
        np.testing.assert_allclose(changed.no_load_speed, motor.no_load_speed * 0.8)
        np.testing.assert_array_equal(changed.peak_torque, motor.peak_torque)
        np.testing.assert_array_equal(changed.friction_speed, motor.friction_speed)
        command = JointCommand(*rng.random((5, 12)))
        obeyed = randomised_command(command, sample)
        np.testing.assert_allclose(obeyed.kp, command.kp * sample["kp"])
        np.testing.assert_allclose(obeyed.kd, command.kd * sample["kd"])
        for untouched in ("position", "velocity", "torque"):
            np.testing.assert_array_equal(getattr(obeyed, untouched), getattr(command, untouched))

    def test_readings(self) -> None:
        rng = np.random.default_rng(3)
        readings = {name: rng.normal(size=value.shape) for name, value in LEVEL.items()}
        readings["gravity"] /= np.linalg.norm(readings["gravity"])
        sizes = {"encoder_bias": 12, "gyro_bias": 3, "gravity_bias": 3}
        sample: Sample = {name: rng.normal(size=size) for name, size in sizes.items()}
        read = biased(readings, sample)
        positions = readings["joint_position"] + sample["encoder_bias"]
        np.testing.assert_allclose(read["joint_position"], positions)
        np.testing.assert_allclose(read["gyro"], readings["gyro"] + sample["gyro_bias"])
        tilted = readings["gravity"] + sample["gravity_bias"]
        np.testing.assert_allclose(read["gravity"], tilted / np.linalg.norm(tilted))
        np.testing.assert_array_equal(read["joint_velocity"], readings["joint_velocity"])
        u, noise = rng.random(30), Noise(gyro=0.1, gravity=0.2, joint_position=0.3, joint_velocity=0.4)
        read, signed = noisy(readings, noise, u), 2 * u - 1
        np.testing.assert_allclose(read["gyro"], readings["gyro"] + 0.1 * signed[:3])
        tilted = readings["gravity"] + 0.2 * signed[3:6]
        np.testing.assert_allclose(read["gravity"], tilted / np.linalg.norm(tilted))
        np.testing.assert_allclose(read["joint_position"], readings["joint_position"] + 0.3 * signed[6:18])
        np.testing.assert_allclose(read["joint_velocity"], readings["joint_velocity"] + 0.4 * signed[18:])

    def test_two_biases_of_one_reading_add_up(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(QUANTITIES, "second", QUANTITIES["gyro_bias"])
        one, two = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 4.0])
        np.testing.assert_allclose(sensor_bias(Sample(gyro_bias=one, second=two), "gyro"), one + two)
        assert sensor_bias(Sample(encoder_bias=one), "gyro") is None


class TestBodyMap:
    XML = """<mujoco><worldbody>{floor}<geom name="wall" type="box" size="1 1 1" pos="9 0 0"/>
        <body name="vane"><joint name="turn" axis="0 0 1"/><geom size=".1" mass="1"/></body>
        <body name="trunk"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""

    def robot(self, go1: Robot, monkeypatch: pytest.MonkeyPatch, feet: list[list[int]]) -> Robot:
        """A robot whose feet are these geoms and whose joints are at two degrees of freedom."""
        monkeypatch.setattr(
            "footfall.domain_rand.bodies.find_feet",
            lambda *_: tuple(np.array(geoms, dtype=int) for geoms in feet),
        )
        addresses = np.array([7, 8]), np.array([6, 0])
        monkeypatch.setattr("footfall.domain_rand.bodies.joint_addresses", lambda *_: addresses)
        return go1

    def test_friction_is_of_the_feet_and_floors_that_are_found(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        floor = '<geom name="dust" size=".1"/><geom name="floor" type="plane" size="1 1 1"/>'
        model = mujoco.MjModel.from_xml_string(self.XML.format(floor=floor))
        # A foot without geoms, and a foot that is the first geom.
        robot = self.robot(go1, monkeypatch, [[4], [], [0]])
        where = body_map(model, robot)
        assert where.contact_geoms == (0, 1, 2, 4)
        assert where.dofs == (6, 0)
        assert where.base == model.body("trunk").id == 2

    def test_without_feet_friction_is_of_all_geoms_that_touch(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        shown = '<geom name="shown" size=".1" contype="0" conaffinity="0"/>'
        touched = '<geom size=".1" contype="0"/><geom size=".1" conaffinity="0"/>'
        model = mujoco.MjModel.from_xml_string(self.XML.format(floor=shown + touched))
        where = body_map(model, self.robot(go1, monkeypatch, [[], []]))
        assert where.contact_geoms == (1, 2, 3, 4, 5)
