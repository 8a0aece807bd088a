"""The hexapod's gaits over the simulated bus, a few steps each."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from half_rate import half_rate

from footfall.common.rotations import heading, tilt
from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.controllers.walk import Walk
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

ROBOT = load_robot("hexapod")
AHEAD = partial(Episode, config=half_rate(ROBOT))


class Landings:
    """The walk's own estimate of stance, beside the simulator's contacts. Used as an episode's watch."""

    def __init__(self, policy: Walk) -> None:
        self._cycle = policy.stepping.cycle
        self._land = self._cycle.touch_down
        self._cycle.touch_down = self._note  # type: ignore[method-assign]
        self._met: list[int] = []
        self.early: list[tuple[float, int, bool]] = []  # time, foot, and whether it touched
        self.planned: list[np.ndarray] = []  # (feet,) of each tick: thought to stand
        self.touched: list[np.ndarray] = []  # and truly on the ground

    def _note(self, feet: np.ndarray, height: np.ndarray) -> None:
        self._met = np.flatnonzero(feet).tolist()
        self._land(feet, height)

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        if not self._met and not (loop.walking and loop.now_us % 10_000 == 0):
            return
        touches = body.truth().foot_contact
        self.early += [(loop.walking_s, foot, bool(touches[foot])) for foot in self._met]
        self._met = []
        self.planned.append(~self._cycle.swings)
        self.touched.append(touches)


def test_a_hexapod_walks_straight_without_sinking_or_a_joint_beyond_its_limit() -> None:
    policy = load_policy("tripod", ROBOT)
    assert isinstance(policy, Walk)
    landings = Landings(policy)
    trace = run_episode(ROBOT, policy, AHEAD(lambda _: np.array([0.12, 0.0, 0.0]), 2.4), watch=landings)
    walked = trace.base_position[-1] - trace.base_position[0]
    assert not trace.fell
    assert trace.faults == ()
    assert walked[0] > 0.1
    assert abs(walked[1]) < 0.05 * walked[0] + 0.01  # the body sways by a centimetre within a cycle
    assert abs(float(heading(trace.base_quaternion[-1]))) < 0.05
    assert trace.base_position[:, 2].min() > 0.18
    assert np.abs(trace.joint_velocity).max() < 3.6  # targets move at 3.0 at most; the motors' PD lags behind
    assert [note.split(":")[0] for note in trace.notes] == ["tripod"]
    # No foot in the air counts as standing: it carries only its leg's inertia.
    assert all(touched for _, _, touched in landings.early)
    planned, touched = np.array(landings.planned), np.array(landings.touched)
    assert touched[planned].mean() > 0.98
    assert touched.sum(axis=1).min() >= 3


def test_a_foot_stops_on_a_block_and_the_body_stays_level(tmp_path: Path) -> None:
    """The block is 2 cm high, under the first step of the left foreleg.

    A foot that followed only the clock would lift the body by 1 cm.
    """
    block = """<worldbody>
      <geom name="floor" type="plane" size="0 0 1" contype="2147483647" conaffinity="2147483647"/>
      <geom type="box" pos="0.31 0.25 0.01" size="0.05 0.1 0.01"/>"""
    plant = tmp_path / "block.xml"
    plant.write_text(ROBOT.xml_path.read_text().replace("<worldbody>", block))
    policy = load_policy("tripod", ROBOT)
    assert isinstance(policy, Walk)
    landings = Landings(policy)
    episode = AHEAD(lambda _: np.array([0.12, 0.0, 0.0]), 1.8, plant=plant)
    trace = run_episode(ROBOT, policy, episode, watch=landings)
    time_s, foot, touched = landings.early[0]
    assert (foot, touched) == (0, True)
    stands = (trace.time_s > time_s + 0.03) & (trace.time_s < time_s + 0.3)
    assert trace.foot_contact[stands, 0].all()
    assert trace.foot_position[stands, 0, 2].min() > 0.02 + 0.015
    assert max(map(tilt, trace.base_quaternion)) < np.deg2rad(0.8)
    assert np.ptp(trace.base_position[:, 2]) < 0.005


def test_the_fast_contender_is_twice_as_fast_as_the_default_steps() -> None:
    """The default steps allow at most 0.094 m/s, by the generator's own check."""
    policy = load_policy(f"tripod@{ROBOT.folder / 'fast.yaml'}", ROBOT)
    trace = run_episode(ROBOT, policy, AHEAD(lambda _: np.array([0.25, 0.0, 0.0]), 2.4))
    assert not trace.fell
    assert trace.faults == ()
    late = trace.time_s > 1.4
    assert trace.base_velocity[late, 0].mean() > 0.19
    assert abs(trace.base_velocity[late, 1].mean()) < 0.02
    assert trace.base_position[:, 2].min() > 0.18


def test_mpc_walks_on_six_feet() -> None:
    trace = run_episode(ROBOT, load_policy("mpc", ROBOT), AHEAD(lambda _: np.array([0.15, 0.0, 0.0]), 2.0))
    assert not trace.fell
    assert trace.faults == ()
    assert trace.base_velocity[trace.time_s > 1.2, 0].mean() == pytest.approx(0.15, abs=0.04)
    assert trace.base_position[:, 2].min() > 0.18
