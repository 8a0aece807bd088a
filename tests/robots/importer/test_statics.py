"""Statics of a machine on stiff joints."""

import mujoco
import numpy as np
import pytest

from footfall.robots.importer.machine import Leg
from footfall.robots.importer.statics import Statics, statics

PELVIS = 1


@pytest.fixture
def model() -> mujoco.MjModel:
    """A body of 10 kg, its centre 0.5 m above two ankles, on soles of four spheres without weight."""
    foot = '<geom name="{0}{1}" type="sphere" size="0.01" pos="{2} {3} -0.04" mass="1e-6"/>'
    corners = [(0.1, 0.03), (0.1, -0.03), (-0.1, 0.03), (-0.1, -0.03)]
    feet = "".join(
        f'<body pos="0 {y} -0.5"><joint name="{name}" axis="0 1 0"/>'
        + "".join(foot.format(name, i, *corner) for i, corner in enumerate(corners))
        + "</body>"
        for name, y in (("left", 0.1), ("right", -0.1))
    )
    body = f'<body pos="0 0 0.55"><freejoint/><geom type="box" size=".1 .1 .1" mass="10"/>{feet}</body>'
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")


def both_legs() -> tuple[Leg, ...]:
    return tuple(Leg(name, (name,), 1, tuple(f"{name}{i}" for i in range(4))) for name in ("left", "right"))


def test_ankles_must_be_stiffer_than_weight_times_height(model: mujoco.MjModel) -> None:
    """An inverted pendulum needs 10 kg * 9.81 m/s2 * 0.5 m = 49.05 N m/rad of both ankles together."""
    found = statics(model, ("left", "right"), both_legs(), model.qpos0)
    assert not found.stable(np.array([30.0, 18.0]))
    assert found.stable(np.array([30.0, 20.0]))


def test_points_alone_do_not_stand(model: mujoco.MjModel) -> None:
    legs = tuple(Leg(leg.name, leg.joints, 1, leg.geoms[:1]) for leg in both_legs())
    assert not statics(model, ("left", "right"), legs, model.qpos0).stable(np.array([1e4, 1e4]))


def test_torque_is_force_times_distance(model: mujoco.MjModel) -> None:
    """With the body 0.03 m ahead of the ankles, they share 10 * 9.81 * 0.03 N m."""
    model.body_ipos[PELVIS, 0] = 0.03
    mujoco.mj_setConst(model, mujoco.MjData(model))
    found = statics(model, ("left", "right"), both_legs(), model.qpos0)
    assert abs(found.torque_nm.sum()) == pytest.approx(10 * 9.81 * 0.03, rel=1e-3)


def found(centre: tuple[float, float, float], weight: float = 0.0) -> Statics:
    """Statics of 10 kg on two legs, which swing sideways about hips 0.1 m from the middle.

    The feet are 0.05 m farther out.
    """
    legs = "".join(
        f"""<body name="{name}" pos="0 {0.1 * side} 0"><joint name="{name}" axis="1 0 0"/>
          <geom name="{name}0" size="0.01" pos="0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/>
          <geom name="{name}1" size="0.01" pos="-0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/>
        </body>"""
        for name, side in (("left", 1.0), ("right", -1.0))
    )
    text = f"""<mujoco><worldbody><body pos="0 0 9"><joint name="extra" type="free"/>
      <geom size="0.1" pos="{centre[0]} {centre[1]} {centre[2]}" mass="10"/>{legs}</body>
      </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    own = tuple(Leg(name, (name,), 1, (f"{name}0", f"{name}1")) for name in ("left", "right"))
    return statics(model, ("left", "right"), own, model.qpos0)


@pytest.mark.parametrize(("aside", "left"), [(0.0, 0.5), (0.03, 0.6), (-0.06, 0.3)])
def test_each_legs_load_balances_the_weight(aside: float, left: float) -> None:
    """The left foot, at 0.15 m, carries (0.15 + y) / 0.3 of 98.1 N, 0.05 m from its hip."""
    torque = found((0.02, aside, 0.1)).torque_nm
    assert torque == pytest.approx([-0.05 * 98.1 * left, 0.05 * 98.1 * (1 - left)], abs=1e-3)


def test_the_legs_own_weight_hangs_on_their_hips() -> None:
    """The ground carries the 1 kg in each foot: the torques of the hips stay the same."""
    torque = found((0.0, 0.0, 0.1), weight=0.5).torque_nm
    assert torque == pytest.approx([-0.05 * 49.05, 0.05 * 49.05], abs=1e-3)
