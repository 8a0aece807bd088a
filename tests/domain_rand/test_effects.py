"""Each named distribution changes the quantity of physics or readings in its name.

Delays, pushes and initial states are tested with the loop and the environment.
"""

import mujoco
import numpy as np
import pytest
from mujoco import mjx

from footfall import JointCommand, Robot
from footfall.domain_rand.bodies import BodyMap, apply_to_model, body_map, randomised_fields
from footfall.domain_rand.noise import Noise, biased, noisy
from footfall.domain_rand.quantity import scales_joints
from footfall.domain_rand.randomisation import QUANTITIES, load_randomisation
from footfall.domain_rand.sample import Sample, draw, randomised_command, randomised_motor, sensor_bias
from footfall.plant.ground import replaced_by
from footfall.robots.model import plant_model, read_plant, training_model
from footfall.terrain.declaration import load_ground


@pytest.mark.parametrize("lying", ['pos="0 0 0"', 'pos=".1 0 0" euler="0 0 30"'])
def test_a_centre_of_mass_moves_alone_wherever_it_was(lying: str) -> None:
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


def test_friction_is_set_on_all_geoms_of_the_ground(go1: Robot) -> None:
    model = read_plant(go1, change=replaced_by(load_ground("blocks"))).model
    changed = randomised_fields(model, Sample(friction=np.array(0.3)), body_map(model, go1))
    ground = model.geom_bodyid == 0
    assert ground.sum() > 100
    assert (changed["geom_friction"][ground, 0] == 0.3).all()
    np.testing.assert_array_equal(changed["geom_friction"][:, 1:], model.geom_friction[:, 1:])  # only sliding


def test_a_payload_adds_to_drawn_masses(go1: Robot) -> None:
    model = plant_model(go1)
    where = body_map(model, go1)
    changed = randomised_fields(model, Sample(link_mass=np.full(13, 1.5), payload_kg=np.array(2.0)), where)
    expected = 1.5 * model.body_mass
    expected[where.base] += 2.0
    np.testing.assert_allclose(changed["body_mass"], expected)


def test_derived_constants_follow_the_masses(go1: Robot) -> None:
    nominal, heavy = plant_model(go1), plant_model(go1)
    apply_to_model(heavy, Sample(link_mass=np.full(13, 2.0)), body_map(heavy, go1))
    np.testing.assert_allclose(heavy.body_subtreemass, 2 * nominal.body_subtreemass)
    assert np.all(heavy.body_invweight0[1:, 0] < nominal.body_invweight0[1:, 0])


def test_mujoco_and_mjx_models_change_in_the_same_way(go1: Robot) -> None:
    model, rng = training_model(go1), np.random.default_rng(0)
    sample = draw(load_randomisation(), lambda k: rng.random(k).astype(np.float32), 12, 13)
    where, models = body_map(model, go1), (model, mjx.put_model(model))
    in_numpy, in_jax = (randomised_fields(each, sample, where) for each in models)
    names = {"body_mass", "body_inertia", "body_ipos", "dof_armature", "geom_friction"}
    assert set(in_numpy) == set(in_jax) == names
    for name, value in in_numpy.items():
        np.testing.assert_allclose(value, in_jax[name], rtol=1e-6, atol=1e-8, err_msg=name)


def test_a_joint_is_changed_at_its_own_degree_of_freedom() -> None:
    """The joints have another order than the model's degrees of freedom."""
    where = BodyMap(base=1, contact_geoms=(), dofs=(4, 2, 7))
    effect = scales_joints("dof_armature")
    changed = effect.change(np.arange(1.0, 9.0), np.array([10.0, 100.0, 1000.0]), where)
    np.testing.assert_allclose(changed, [1, 2, 300, 4, 50, 6, 7, 8000])


def test_effects_on_motors_and_commands_equal_plain_numpy(go1: Robot) -> None:
    """All values differ."""
    rng = np.random.default_rng(2)
    names = ("joint_friction", "joint_damping", "motor_strength", "kp", "kd")
    sample = {name: rng.uniform(0.5, 1.5, 12) for name in names} | {"battery": np.array(0.8)}
    motor = go1.motor._replace(damping=rng.random(12), friction_speed=rng.random(12))
    expected = motor._replace(
        friction=motor.friction * sample["joint_friction"],
        damping=motor.damping + sample["joint_damping"],
        strength=motor.strength * sample["motor_strength"],
        stall_torque=motor.stall_torque * 0.8,
        no_load_speed=motor.no_load_speed * 0.8,
    )
    for found, value in zip(randomised_motor(motor, sample), expected, strict=True):
        if value is None:
            assert found is None
        else:
            np.testing.assert_allclose(found, value)
    command = JointCommand(*rng.random((5, 12)))
    obeyed = command._replace(kp=command.kp * sample["kp"], kd=command.kd * sample["kd"])
    np.testing.assert_allclose(randomised_command(command, sample), obeyed)


def test_biases_and_noise_equal_plain_numpy() -> None:
    rng = np.random.default_rng(3)
    names = {"gyro": 3, "gravity": 3, "joint_position": 12, "joint_velocity": 12}
    readings = {name: rng.normal(size=size) for name, size in names.items()}
    readings["gravity"] /= np.linalg.norm(readings["gravity"])
    sizes = {"joint_position": 12, "gyro": 3, "gravity": 3}
    bias = {name: rng.normal(size=size) for name, size in sizes.items()}
    sample = Sample(encoder_bias=bias["joint_position"], gyro_bias=bias["gyro"], gravity_bias=bias["gravity"])
    u, noise = rng.random(30), Noise(gyro=0.1, gravity=0.2, joint_position=0.3, joint_velocity=0.4)
    parts = np.split(2 * u - 1, [3, 6, 18])
    errors = {name: 0.1 * (k + 1) * part for k, (name, part) in enumerate(zip(names, parts, strict=True))}
    for found, added in ((biased(readings, sample), bias), (noisy(readings, noise, u), errors)):
        for name, value in readings.items():
            expected = value + added.get(name, 0.0)
            if name == "gravity":
                expected /= np.linalg.norm(expected)
            np.testing.assert_allclose(found[name], expected)


def test_two_biases_of_one_reading_add_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(QUANTITIES, "second", QUANTITIES["gyro_bias"])
    one, two = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 4.0])
    np.testing.assert_allclose(sensor_bias(Sample(gyro_bias=one, second=two), "gyro"), one + two)
    assert sensor_bias(Sample(encoder_bias=one), "gyro") is None


DUST = '<geom name="dust" size=".1"/><geom name="floor" type="plane" size="1 1 1"/>'
TOUCHING = """<geom name="shown" size=".1" contype="0" conaffinity="0"/>
    <geom size=".1" contype="0"/><geom size=".1" conaffinity="0"/>"""


@pytest.mark.parametrize(
    ("floor", "feet", "touch"),
    [
        (DUST, [[4], [], [0]], (0, 1, 2, 4)),  # a foot without geoms, and a foot that is the first geom
        (TOUCHING, [[], []], (1, 2, 3, 4, 5)),
    ],
)
def test_friction_is_of_feet_and_floors_or_without_feet_of_all_geoms_that_touch(
    go1: Robot, monkeypatch: pytest.MonkeyPatch, floor: str, feet: list[list[int]], touch: tuple[int, ...]
) -> None:
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody>{floor}<geom name="wall" type="box" size="1 1 1" pos="9 0 0"/>
        <body name="vane"><joint name="turn" axis="0 0 1"/><geom size=".1" mass="1"/></body>
        <body name="trunk"><freejoint/><geom size=".1"/></body></worldbody></mujoco>"""
    )
    geoms, addresses = tuple(np.array(each, dtype=int) for each in feet), (np.array([7, 8]), np.array([6, 0]))
    monkeypatch.setattr("footfall.domain_rand.bodies.find_feet", lambda *_: geoms)
    monkeypatch.setattr("footfall.domain_rand.bodies.joint_addresses", lambda *_: addresses)
    where = body_map(model, go1)
    assert (where.contact_geoms, where.dofs) == (touch, (6, 0))
    assert where.base == model.body("trunk").id == 2
