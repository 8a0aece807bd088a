"""Spheres on a ground that is not level, in MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.plant.engines.choice import open_engine
from footfall.plant.engines.sloped_ground import Surface
from footfall.plant.ground import replace_ground
from footfall.terrain.ground import Ground, tangent_at

CELL_M = 0.05
PLACE = st.floats(-1.3, 1.3)


def ground(slope: float, bumps_m: float = 0.0) -> Ground:
    """A tile of 2 m that rises along x."""
    along = np.linspace(-1.0, 1.0, 41)
    heights = slope * np.tile(along[:, None], (1, 41))
    bumps = np.random.default_rng(0).uniform(-bumps_m, bumps_m, heights.shape)
    return Ground((heights + bumps)[None], np.array([False]), CELL_M)


def slid(radius_m: float, slope: float) -> tuple[float, float]:
    """A sphere without friction, pressed down with 120 N, moves across a slope at 0.5 m/s.

    Returns its speed after 2 s, m/s, and how far it rose, m.
    """
    spec, here = mujoco.MjSpec(), ground(slope)
    spec.option.timestep = 0.001
    replace_ground(spec, here)
    body = spec.worldbody.add_body(pos=[0.0, -0.8, radius_m * np.hypot(1.0, slope)])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 1.0, 0.0])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, 1.0])
    body.add_geom(size=[radius_m, 0.0, 0.0], mass=2.0, condim=1, priority=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[0] = 0.5
    data.xfrc_applied[1, 2] = -100.0
    engine = open_engine("mujoco", model, data, [], here)
    for _ in range(2000):
        engine.step()
    return float(data.qvel[0]), float(data.qpos[1])


@pytest.mark.parametrize("radius_m", [0.005, 0.023])
@pytest.mark.parametrize("slope", [0.0, 0.5])
def test_a_sphere_slides_over_the_cells(radius_m: float, slope: float) -> None:
    speed, rise = slid(radius_m, slope)
    assert speed == pytest.approx(0.5, abs=1e-6)
    assert -0.003 < rise < 0.0


@pytest.mark.parametrize(("friction", "holds"), [(0.6, True), (0.4, False)])
def test_friction_holds_a_sphere_on_a_slope_of_half(friction: float, holds: bool) -> None:
    spec, here = mujoco.MjSpec(), ground(0.5)
    spec.option.timestep = 0.001
    replace_ground(spec, here)
    body = spec.worldbody.add_body(pos=[0.0, 0.0, 0.02 * np.hypot(1.0, 0.5)])
    for axis in np.eye(3):
        body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.add_geom(size=[0.02, 0.0, 0.0], mass=2.0, friction=[friction, 0.0, 0.0], priority=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    engine = open_engine("mujoco", model, data, [], here)
    for _ in range(500):
        engine.step()
    assert (np.linalg.norm(data.qpos) < 0.02) == holds


@given(PLACE, PLACE)
def test_the_surface_equals_the_grounds_heights(x: float, y: float) -> None:
    here = ground(0.3, bumps_m=0.02)
    tangent = tangent_at(here, np.array([x, y]))
    normal = np.array([*-tangent.slope, 1.0]) / np.hypot(1.0, np.hypot(*tangent.slope))
    on_it = np.array([x, y, float(tangent.height)])
    *found, gap = Surface(here).nearest(*on_it)
    np.testing.assert_allclose(found, normal, atol=1e-9)
    assert gap == pytest.approx(0.0, abs=1e-9)
