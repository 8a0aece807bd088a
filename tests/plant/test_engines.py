"""Other engines move bodies as MuJoCo does, except for contact models; spheres on sloped ground in MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall import Episode, Robot, Trace, UserError, load_policy, load_robot, run_episode
from footfall.plant.engines.choice import open_engine
from footfall.plant.engines.engine import Engine
from footfall.plant.engines.sloped_ground import Surface
from footfall.plant.ground import replace_ground
from footfall.robots.model import read_plant
from footfall.terrain.ground import Ground, tangent_at

BLOCK = """
<mujoco><option timestep="0.001"/><worldbody>
  <geom type="plane" size="0 0 1" friction="{ground}" priority="{priority}"/>
  <body pos="0 0 0.05"><freejoint/><inertial mass="2" pos="0 0 0" diaginertia="0.01 0.01 0.01"/>
    <replicate count="4" euler="0 0 90"><geom size="0.05" pos="0.2 0.2 0" friction="{foot}"/></replicate>
  </body>
</worldbody></mujoco>"""
MODULES = {"drake": "pydrake", "motrixsim": "motrixsim"}


@pytest.fixture(params=MODULES)
def other_engine(request: pytest.FixtureRequest) -> str:
    pytest.importorskip(MODULES[request.param])
    return str(request.param)


def opened(model: mujoco.MjModel, name: str, ground: Ground | None = None) -> tuple[mujoco.MjData, Engine]:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data, open_engine(name, model, data, [], ground)


def step(engine: Engine, count: int) -> None:
    for _ in range(count):
        engine.step()


@pytest.mark.parametrize("name", ["go1", "hexapod", "g1"])
def test_a_robot_in_the_air_moves_as_in_mujoco(name: str, other_engine: str) -> None:
    """Masses, inertias, rotor inertia, joints and applied forces are alike."""
    robot = load_robot(name)
    plant = read_plant(robot)
    model = plant.model

    def moved(engine_name: str) -> mujoco.MjData:
        rng, (data, engine) = np.random.default_rng(1), opened(model, engine_name)
        data.qpos[:7] = 0.0, 0.0, 5.0, *np.array([1.0, 0.2, -0.3, 0.4]) / np.sqrt(1.29)
        data.qpos[7:] = robot.default_pose
        data.qvel[:] = rng.uniform(-1.0, 1.0, model.nv)
        data.qfrc_applied[6:] = rng.uniform(-0.5, 0.5, model.nv - 6)
        data.xfrc_applied[plant.base] = 10.0, -5.0, 8.0, 1.0, -1.0, 0.5
        mujoco.mj_forward(model, data)
        step(engine, 20)
        return data

    by_mujoco, by_other = moved("mujoco"), moved(other_engine)
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
    step(engine, 200)  # it comes to rest on its contacts
    data.qvel[0] = 2.0
    step(engine, 200)
    assert (2.0 - data.qvel[0]) / 0.2 == pytest.approx(holds * 9.81, rel=0.03)
    force_n = sum(engine.normal_force(each) for each in range(len(engine.touching())))
    assert force_n == pytest.approx(2.0 * 9.81, rel=0.02)


def test_a_diverged_simulation_keeps_its_last_state(other_engine: str) -> None:
    model = mujoco.MjModel.from_xml_string(BLOCK.format(foot=0.6, ground=0.3, priority=0))
    data, engine = opened(model, other_engine)
    data.qfrc_applied[3] = 1e80
    step(engine, 6)
    assert engine.diverged()
    assert np.isfinite([*data.qpos, *data.qvel]).all()


@pytest.mark.parametrize("part", ['type="slide"', 'stiffness="2"'])
def test_a_model_that_moves_differently_is_refused(part: str, other_engine: str) -> None:
    link = f'<body><joint {part}/><geom size="0.1"/></body>'
    body = f'<body pos="0 0 1"><freejoint/><geom size="0.1"/>{link}</body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    with pytest.raises(UserError):
        opened(model, other_engine)


def test_a_foot_that_is_no_sphere_is_refused(go1: Robot) -> None:
    pytest.importorskip("pydrake")
    model = read_plant(go1).model
    foot = model.geom("FR_foot").id
    model.geom_type[foot] = mujoco.mjtGeom.mjGEOM_BOX
    with pytest.raises(UserError, match="FR_foot"):
        open_engine("drake", model, mujoco.MjData(model), [foot])


def test_a_controller_walks_over_the_bus_as_far_as_in_mujoco(go1: Robot, other_engine: str) -> None:
    def walked(engine: str) -> Trace:
        episode = Episode(lambda _: np.array([0.4, 0.0, 0.0]), duration_s=2.0, engine=engine)
        return run_episode(go1, load_policy("trot", go1), episode)

    by_mujoco, by_other = walked("mujoco"), walked(other_engine)
    assert not by_other.fell
    assert by_other.distance_m == pytest.approx(by_mujoco.distance_m, rel=0.15)
    assert by_other.distance_m != by_mujoco.distance_m
    weight = 9.81 * read_plant(go1).model.body_mass.sum()
    assert by_other.foot_force.sum(axis=1).mean() == pytest.approx(weight, rel=0.1)


PLACE = st.floats(-1.3, 1.3)


def ground(slope: float, bumps_m: float = 0.0) -> Ground:
    """A tile of 2 m in cells of 5 cm that rises along x."""
    heights = slope * np.tile(np.linspace(-1.0, 1.0, 41)[:, None], (1, 41))
    bumps = np.random.default_rng(0).uniform(-bumps_m, bumps_m, heights.shape)
    return Ground((heights + bumps)[None], np.array([False]), 0.05)


def on_slope(slope: float, radius_m: float, y: float, axes: np.ndarray, **geom: object) -> tuple:
    """Data and engine of a sphere of 2 kg that touches a slope and may slide along some axes."""
    spec, here = mujoco.MjSpec(), ground(slope)
    spec.option.timestep = 0.001
    replace_ground(spec, here)
    body = spec.worldbody.add_body(pos=[0.0, y, radius_m * np.hypot(1.0, slope)])
    for axis in axes:
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_geom(size=[radius_m, 0.0, 0.0], mass=2.0, priority=1, **geom)
    return opened(spec.compile(), "mujoco", here)


@pytest.mark.parametrize("radius_m", [0.005, 0.023])
@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_a_sphere_slides_over_the_cells(radius_m: float, slope: float) -> None:
    """Without friction, pressed down with 120 N, it moves across the slope for 2 s."""
    data, engine = on_slope(slope, radius_m, -0.8, np.eye(3)[1:], condim=1)
    data.qvel[0] = 0.5
    data.xfrc_applied[1, 2] = -100.0
    step(engine, 2000)
    assert data.qvel[0] == pytest.approx(0.5, abs=1e-6)
    assert -0.003 < data.qpos[1] < 0.0


@pytest.mark.parametrize(("friction", "holds"), [(0.6, True), (0.4, False)])
def test_friction_holds_a_sphere_on_a_slope_of_half(friction: float, holds: bool) -> None:
    data, engine = on_slope(0.5, 0.02, 0.0, np.eye(3), friction=[friction, 0.0, 0.0])
    step(engine, 500)
    assert (np.linalg.norm(data.qpos) < 0.02) == holds


@given(PLACE, PLACE)
def test_the_surface_equals_the_grounds_heights(x: float, y: float) -> None:
    here = ground(0.3, bumps_m=0.02)
    tangent = tangent_at(here, np.array([x, y]))
    normal = np.array([*-tangent.slope, 1.0]) / np.hypot(1.0, np.hypot(*tangent.slope))
    *found, gap = Surface(here).nearest(x, y, float(tangent.height))
    np.testing.assert_allclose(found, normal, atol=1e-9)
    assert gap == pytest.approx(0.0, abs=1e-9)
