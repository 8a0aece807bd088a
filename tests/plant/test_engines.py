"""Another engine moves the bodies as MuJoCo does, except for differences between contact models."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from footfall import Episode, Robot, UserError, load_policy, load_robot, run_episode
from footfall.plant.engines.choice import open_engine
from footfall.plant.engines.engine import Engine
from footfall.robots.model import read_plant

BLOCK = """
<mujoco><option timestep="0.001"/><worldbody>
  <geom type="plane" size="0 0 1" friction="{ground}" priority="{priority}"/>
  <body pos="0 0 0.05"><freejoint/><inertial mass="2" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
    <geom type="sphere" size="0.05" pos="0.2 0.2 0" friction="{foot}"/>
    <geom type="sphere" size="0.05" pos="-0.2 0.2 0" friction="{foot}"/>
    <geom type="sphere" size="0.05" pos="0.2 -0.2 0" friction="{foot}"/>
    <geom type="sphere" size="0.05" pos="-0.2 -0.2 0" friction="{foot}"/>
  </body>
</worldbody></mujoco>"""


MODULES = {"drake": "pydrake", "motrixsim": "motrixsim"}


@pytest.fixture(params=MODULES)
def other_engine(request: pytest.FixtureRequest) -> str:
    pytest.importorskip(MODULES[request.param])
    return str(request.param)


def opened(model: mujoco.MjModel, name: str) -> tuple[mujoco.MjData, Engine]:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data, open_engine(name, model, data, [])


def moved(
    model: mujoco.MjModel, name: str, start: Callable[[mujoco.MjData], None], steps: int
) -> mujoco.MjData:
    data, engine = opened(model, name)
    start(data)
    mujoco.mj_forward(model, data)
    for _ in range(steps):
        engine.step()
    return data


@pytest.mark.parametrize("name", ["go1", "hexapod", "g1"])
def test_a_robot_in_the_air_moves_as_in_mujoco(name: str, other_engine: str) -> None:
    """Masses, inertias, rotor inertia, joints and applied forces are alike."""
    robot = load_robot(name)
    plant = read_plant(robot)
    model = plant.model

    def start(data: mujoco.MjData) -> None:
        rng = np.random.default_rng(1)
        data.qpos[:3] = 0.0, 0.0, 5.0
        data.qpos[3:7] = np.array([1.0, 0.2, -0.3, 0.4]) / np.linalg.norm([1.0, 0.2, -0.3, 0.4])
        data.qpos[7:] = robot.default_pose
        data.qvel[:] = rng.uniform(-1.0, 1.0, model.nv)
        data.qfrc_applied[6:] = rng.uniform(-0.5, 0.5, model.nv - 6)
        data.xfrc_applied[plant.base] = 10.0, -5.0, 8.0, 1.0, -1.0, 0.5

    by_mujoco, by_other = (moved(model, engine, start, 20) for engine in ("mujoco", other_engine))
    np.testing.assert_allclose(by_other.qpos, by_mujoco.qpos, atol=1e-5)
    np.testing.assert_allclose(by_other.qvel, by_mujoco.qvel, atol=3e-4)
    mujoco.mj_forward(model, by_mujoco)
    np.testing.assert_allclose(by_other.sensordata[:3], by_mujoco.sensordata[:3], atol=0.5)


@pytest.mark.parametrize(
    ("foot", "ground", "priority", "holds"), [(0.6, 0.3, 0, 0.6), (0.3, 0.6, 0, 0.6), (0.8, 0.3, 1, 0.3)]
)
def test_a_sliding_body_slows_down_as_in_mujoco(
    foot: float, ground: float, priority: int, holds: float, other_engine: str
) -> None:
    model = mujoco.MjModel.from_xml_string(BLOCK.format(foot=foot, ground=ground, priority=priority))
    data, engine = opened(model, other_engine)
    for _ in range(200):  # it comes to rest on its contacts
        engine.step()
    data.qvel[0] = 2.0
    for _ in range(200):
        engine.step()
    assert (2.0 - data.qvel[0]) / 0.2 == pytest.approx(holds * 9.81, rel=0.03)
    assert sum(engine.normal_force(each) for each in range(len(engine.touching()))) == pytest.approx(
        2.0 * 9.81, rel=0.02
    )


def test_a_diverged_simulation_keeps_its_last_state(other_engine: str) -> None:
    model = mujoco.MjModel.from_xml_string(BLOCK.format(foot=0.6, ground=0.3, priority=0))
    data, engine = opened(model, other_engine)
    data.qfrc_applied[3] = 1e80
    for _ in range(6):
        engine.step()
    assert engine.diverged()
    assert np.isfinite(data.qpos).all()
    assert np.isfinite(data.qvel).all()


@pytest.mark.parametrize("part", ['type="slide"', 'stiffness="2"'])
def test_a_model_that_moves_differently_is_refused(part: str, other_engine: str) -> None:
    link = f'<body><joint {part}/><geom size="0.1"/></body>'
    body = f'<body pos="0 0 1"><freejoint/><geom size="0.1"/>{link}</body>'
    with pytest.raises(UserError):
        opened(
            mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>"), other_engine
        )


def test_a_foot_that_is_no_sphere_is_refused(go1: Robot) -> None:
    pytest.importorskip("pydrake")
    model = read_plant(go1).model
    foot = model.geom("FR_foot").id
    model.geom_type[foot] = mujoco.mjtGeom.mjGEOM_BOX
    with pytest.raises(UserError, match="FR_foot"):
        open_engine("drake", model, mujoco.MjData(model), [foot])


def test_a_controller_walks_over_the_bus_as_far_as_in_mujoco(go1: Robot, other_engine: str) -> None:
    traces = {
        engine: run_episode(
            go1,
            load_policy("trot", go1),
            Episode(lambda _: np.array([0.4, 0.0, 0.0]), duration_s=2.0, engine=engine),
        )
        for engine in ("mujoco", other_engine)
    }
    by_mujoco, by_other = traces["mujoco"], traces[other_engine]
    assert not by_other.fell
    assert by_other.distance_m == pytest.approx(by_mujoco.distance_m, rel=0.15)
    assert by_other.distance_m != by_mujoco.distance_m
    weight = 9.81 * read_plant(go1).model.body_mass.sum()
    assert by_other.foot_force.sum(axis=1).mean() == pytest.approx(weight, rel=0.1)
