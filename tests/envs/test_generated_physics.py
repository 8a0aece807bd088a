"""The generated physics moves any robot as MuJoCo C does, and names features that it cannot generate."""

import copy
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import jax
import mujoco
import numpy as np
import pytest
from physics_parity import compare, random_arguments
from some_net import with_net

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.physics.engines import make_engine
from footfall.envs.physics.generated import llvm, on_processor
from footfall.envs.physics.generated.geom_pairs import contact_refusals
from footfall.envs.physics.generated.physics import not_generated
from footfall.envs.physics.generated.tree import refusals
from footfall.envs.physics.interface import GRAVITY, GROUND
from footfall.robots.description import Robot, load_robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import training_model, training_spec
from footfall.train.config import load_preset

DOUBLE, SINGLE = 1e-12, 1e-5  # relative errors of the velocities
COUNT = 60
ROBOTS = ("go1", "hexapod", "g1")
SHIPPED = llvm.OPTIMISATION  # as for users; the other tests compile with less optimisation


def errors(
    robot: Any, model: mujoco.MjModel, dtype: Any = np.float64, count: int = COUNT, fallen: bool = False
) -> np.ndarray:
    """Relative errors for robots of the preset `gpu` that touch the ground in some of the steps."""
    randomisation = load_preset("gpu", robot).env.randomisation
    given = random_arguments(robot, model, count, randomisation, fallen=fallen)
    found = compare(robot, model, given, dtype)
    assert 0.05 < (found.contacts > 0).mean() < 0.95
    return found.errors


@pytest.mark.parametrize("name", ROBOTS)
def test_four_steps_equal_mujocos_in_double_precision(name: str) -> None:
    robot = load_robot(name)
    assert errors(robot, training_model(robot)).max() < DOUBLE


@pytest.mark.parametrize(("name", "optimisation"), [("go1", SHIPPED), ("hexapod", 0), ("g1", 0)])
def test_float32_steps_are_mujocos(name: str, optimisation: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(llvm, "OPTIMISATION", optimisation)
    robot = load_robot(name)
    assert np.quantile(errors(robot, training_model(robot), np.float32, 400)[:, 0], 0.99) < SINGLE


@pytest.mark.parametrize(
    ("name", "contacts"), [("go1", "whole_body"), ("g1", "whole_body"), ("go1", "rough_limbs")]
)
def test_robots_that_lie_or_whose_limbs_rub_move_as_mujocos(name: str, contacts: str) -> None:
    robot = load_robot(name)
    model = training_model(robot, contacts=contacts)
    assert not_generated(model) == ""
    assert np.quantile(errors(robot, model, count=20, fallen=True), 0.9) < DOUBLE


def test_robots_with_any_limbs_move_as_in_mujoco(bodies: dict[str, Robot]) -> None:
    for robot in bodies.values():
        model = training_model(robot)
        assert not_generated(model) == ""
        assert errors(robot, model, count=20).max() < DOUBLE


OPTIONS = """<option timestep="0.005" integrator="Euler" cone="pyramidal" impratio="1" solver="Newton"
  iterations="1"><flag eulerdamp="disable"/></option>"""
EVERY_FEATURE = f"""<mujoco>{OPTIONS}<compiler angle="radian"/>
<worldbody>
  <body pos="0.1 -0.2 0.01" euler="0.05 0 0.3"><geom name="slope" type="plane" size="1 1 1" pos="0 0 0.01"
    euler="0.1 -0.15 0" contype="1" conaffinity="1" friction="0.3 0 0" margin="0.003" gap="0.002"/></body>
  <body name="trunk" pos="0 0 0.5"><freejoint/>
    <geom name="belly" type="sphere" size="0.06" pos="0.05 0.02 -0.1" mass="3" contype="0" conaffinity="1"
      friction="0.7 0 0" solref="-900 -20"/>
    <geom name="keel" type="capsule" size="0.03 0.1" pos="0 0 -0.1" euler="0 1.3 0.2" mass="0.5" contype="0"
      conaffinity="1"
      condim="1" priority="1" solimp="0.8 0.9 0.01 0.5 1"/>
    <body name="rigid" pos="0.2 0 0" euler="0.2 0.3 0.1"><geom type="box" size="0.02 0.03 0.04" mass="0.4"
      contype="0" conaffinity="0"/>
      <body name="two" pos="0.02 0.1 0" euler="0 0.1 0">
        <joint name="a" axis="1 0.2 0" pos="0.01 0.02 -0.03" ref="0.2" armature="0.01"/>
        <joint name="b" axis="0 1 0" pos="0 0 0.02" armature="0.01"/>
        <geom name="left" type="capsule" size="0.02" fromto="0 0 0 0 0.02 -0.25" mass="0.5" contype="0"
          conaffinity="1" priority="2" friction="0.9 0 0" margin="0.004" gap="0.001"/>
        <body pos="0 0.02 -0.25"><joint name="spring" axis="0.3 1 0" stiffness="20" springref="0.3"
          damping="0.2" armature="0.005"/>
          <geom name="sphere" type="sphere" size="0.03" pos="0 0 -0.1" mass="0.2" contype="0" conaffinity="1"
            solmix="3" solref="0.03 0.8"/></body></body></body>
    <body pos="0.2 -0.06 0"><joint name="c" axis="1 0 0" armature="0.01"/>
      <geom name="right" type="capsule" size="0.02" fromto="0 0.02 0 0.03 0.1 -0.25" mass="0.5" contype="0"
        conaffinity="0"/>
      <geom name="knob" type="sphere" size="0.04" pos="0 0.05 -0.25" mass="0.1" contype="0" conaffinity="0"/>
    </body></body>
</worldbody>
<contact><pair geom1="left" geom2="right" condim="3" friction="0.5 0.4 0 0 0"/>
  <pair geom1="knob" geom2="sphere" condim="1" margin="0.01" gap="0.003"/>
  <pair geom1="knob" geom2="left" condim="3"/></contact></mujoco>"""


def test_every_kind_of_joint_and_contact_equals_mujocos(go1: Robot) -> None:
    """The model has hinges off the origin, a body without hinges, a spring, a slope, spheres, capsules."""
    model = mujoco.MjModel.from_xml_string(EVERY_FEATURE)
    robot: Any = SimpleNamespace(
        joint_names=("a", "b", "c"), default_pose=np.full(3, 0.1), kp=np.full(3, 8.0), kd=np.full(3, 0.3),
        description=SimpleNamespace(feet=[SimpleNamespace(geoms=("sphere",))]),
        motor=jax.tree.map(lambda value: np.broadcast_to(value, 12)[:3], go1.motor),
    )  # fmt: skip
    assert not [*refusals(model), *contact_refusals(model)]
    given = random_arguments(robot, model, 300, Randomisation())
    given["qpos"][:, 2] -= np.linspace(-0.05, 0.1, 300)
    found = compare(robot, model, given)
    assert set(found.contacts) >= {0, 1, 2, 3, 4}
    assert found.errors.max() < DOUBLE


def test_an_elliptic_friction_cone_is_mujocos_and_nearly_converged(go1: Robot) -> None:
    model = training_model(go1, 0.004, exact_friction=True)
    exact = copy.copy(model)
    exact.opt.iterations = 100
    given = random_arguments(go1, model, 2 * COUNT, load_preset("gpu", go1).env.randomisation)
    found = compare(go1, model, given, other=exact).errors
    assert np.quantile(found[:, 0], 0.5) < DOUBLE
    assert np.quantile(found, 0.9) < 1e-3


def test_each_robot_may_have_gravity_of_its_own_and_every_optional_effect_of_motors(go1: Robot) -> None:
    ranges = {
        "torque_lag_s": (0.001, 0.006), "stribeck_friction": (0.1, 0.4), "load_friction": (0.02, 0.1),
        "backlash_rad": (0.005, 0.02), "gear_compliance": (0.001, 0.004),
    }  # fmt: skip
    effects = Randomisation(**{name: Distribution(*limits) for name, limits in ranges.items()})
    model = training_model(go1)
    given = random_arguments(go1, model, COUNT, effects)
    given[GRAVITY] = np.random.default_rng(1).normal([0.0, 0.0, -9.0], 2.0, (COUNT, 3))
    given["motor.voltage_gain"] = np.tile([0.0, 0.9, 1.0], (COUNT, 4))
    given["motor.duty_resistance"] = np.full((COUNT, 12), 0.5)
    assert {"motor.stribeck", "motor.load_friction", "motor.backlash", "lag.in_mean"} <= set(given)
    assert compare(go1, model, given).errors.max() < DOUBLE


@pytest.mark.parametrize("height", [0.06, -0.04])
def test_each_foot_may_touch_the_edge_of_another_level(go1: Robot, height: float) -> None:
    """The ground has a step up or down, which in MuJoCo is a floor, and a box that ends at the edge.

    If a foot's centre is deep inside the box, MuJoCo's floor pushes it as well.
    """
    low, high, edge, side = min(height, 0.0), max(height, 0.0), 0.05, 20.0
    away, spec, flat = np.array([np.cos(0.4), np.sin(0.4)]), training_spec(go1), training_model(go1)
    floor = spec.geom("floor")
    floor.pos = [0.0, 0.0, low]
    like_floor = ("contype", "conaffinity", "condim", "friction", "solmix")
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[side] * 3, pos=[*((edge - side) * away), high - side],
        quat=[np.cos(0.2), 0.0, 0.0, np.sin(0.2)], **{name: getattr(floor, name) for name in like_floor},
    )  # fmt: skip
    given = random_arguments(go1, flat, 2 * COUNT, Randomisation())
    given["qpos"][:, 0] *= 0.2  # near the edge
    given["qpos"][:, 2] += np.random.default_rng(1).uniform(low - 0.02, high, 2 * COUNT)
    points = len(np.concatenate(foot_geoms(flat, go1.description)))
    given[GROUND] = np.tile([0.0, 0.0, 1.0, low, *away, edge, high], (2 * COUNT, points, 1))
    found = compare(go1, flat, given, other=spec.compile())
    assert (found.contacts > 0).mean() > 0.3
    assert np.quantile(found.errors.max(axis=1), 0.7) < DOUBLE


class TestRefusals:
    @pytest.mark.parametrize(
        ("old", "new", "named"),
        [
            ('name="c" axis="1 0 0" armature="0.01"', 'name="c" type="ball"', "joint 'c'"),
            ('name="c" axis="1 0 0"', 'name="c" type="slide" axis="1 0 0"', "joint 'c'"),
            ('name="c" axis="1 0 0"', 'name="c" axis="1 0 0" frictionloss="1"', "joint friction"),
            ('axis="1 0 0"', 'axis="1 0 0" range="-1 1" limited="true" margin="0.1"', "margin"),
            ('type="sphere" size="0.06"', 'type="ellipsoid" size="0.06 0.05 0.04"', "plane and ellipsoid"),
            ('size="0.06" pos', 'size="0.06" condim="6" pos', "condim 6"),
            ("0.01 0.5 1", "0.01 0.5 3", "power 3"),
            ('iterations="1"', 'iterations="100"', "iterations"),
            ('eulerdamp="disable"', 'eulerdamp="enable"', "switched off"),
            ('impratio="1"', 'impratio="2"', "impratio"),
            ('timestep="0.005"', 'timestep="0.005" density="1.2"', "fluid"),
            ('<body name="two"', '<body name="two" gravcomp="1"', "gravity compensation"),
        ],
    )
    def test_features_that_are_not_generated_are_named(self, old: str, new: str, named: str) -> None:
        assert old in EVERY_FEATURE
        model = mujoco.MjModel.from_xml_string(EVERY_FEATURE.replace(old, new))
        assert named in "; ".join([*refusals(model), *contact_refusals(model)])

    def test_another_engine_takes_over_with_a_note(self, go1: Robot, tmp_path: Path) -> None:
        model = training_model(go1)
        model.opt.impratio = 2.0
        with_a_net = with_net(go1, tmp_path / "go1")
        rows = (go1, model, "impratio"), (with_a_net, training_model(with_a_net), "actuator_net")
        for robot, given, reason in rows:
            engine = make_engine("generated", given, robot)
            assert (engine.name, reason in engine.note, "go1" in engine.note) == ("c", True, True)

    def test_a_missing_compiler_is_named(self, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
        for error in (ModuleNotFoundError("no llvmlite"), OSError("its library\ndoes not load")):
            monkeypatch.setattr(on_processor, "import_module", Mock(side_effect=error))
            assert "llvmlite" in on_processor.unavailable()
            assert "llvmlite" in not_generated(training_model(go1))
