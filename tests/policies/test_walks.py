"""Hand-written controllers on simulated robots over the bus: walks, flights, jumps and changes on the way."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from footfall import Episode, JointCommand, Robot, Trace, load_policy, load_robot, run_episode
from footfall.common.rotations import heading, heading_matrix, tilt, yaw_of
from footfall.deploy.command_source import Request, Status, Stop
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.plan import CommandSchedule
from footfall.evaluate.scenarios import load_scenarios
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import mission_of
from footfall.operate.missions.source import MissionSource
from footfall.plant.episode import Watch
from footfall.plant.robot import SimulatedRobot
from footfall.policies.controllers.jump.config import JumpConfig
from footfall.policies.controllers.jump.motion import LeapPlan
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.live_settings import DECLARED, Applied, Steerable
from footfall.policies.policy import PlansFootholds, Policy, PolicyInput
from footfall.robots.mjcf import load_spec

GO1, G1, HEXAPOD = (load_robot(name) for name in ("go1", "g1", "hexapod"))
NOISE = load_scenarios(GO1).noise


def brief(robot: Robot, **changes: Any) -> DeployConfig:
    """Settings of a loop that spends little time before and after the walk."""
    own = deploy_config(robot)
    return replace(own, stand_s=0.2, in_place_s=0.3, safety=replace(own.safety, damping_s=0.01), **changes)


HALF = brief(HEXAPOD, joint_rate_hz=250.0)  # simulated faster


def run(
    robot: Robot,
    policy: Policy | str,
    source: Any,
    duration_s: float,
    watch: Watch | None = None,
    **more: Any,
) -> Trace:
    """A run, steered by a command source or a constant command, that ends without a fall or a fault."""
    policy = load_policy(policy, robot) if isinstance(policy, str) else policy
    source = CommandSchedule((0.0,), (source,)) if isinstance(source, tuple) else source
    episode = Episode(source, duration_s, **{"config": brief(robot), **more})
    trace = run_episode(robot, policy, episode, watch)
    assert (trace.fell, trace.faults) == (False, ()), trace.fall_reason
    return trace


def test_a_robot_walks_and_turns_though_commands_act_30_ms_late() -> None:
    schedule = CommandSchedule((0.0, 0.8), ((0.5, 0.2, 0.0), (0.8, 0.0, 0.6)))
    trace = run(GO1, "mpc", schedule, 1.7, sample={"action_delay_s": np.array(0.03)})
    assert trace.base_velocity[-25:, 0].mean() == pytest.approx(0.8, abs=0.1)


def test_a_robot_walks_on_slippery_ground() -> None:
    """If the planned forces needed a friction of 0.4, the feet would slide apart."""
    schedule = CommandSchedule((0.0, 1.5), ((0.8, -0.3, -0.5), (-0.8, 0.3, 0.5)))
    run(GO1, "mpc", schedule, 2.4, sample={"friction": np.array(0.2)})


def test_a_biped_with_a_load_on_one_side_walks() -> None:
    load = {"com_offset_m": np.array([0.05, 0.05, 0.0])}
    delays = {"action_delay_s": np.array(0.012), "observation_delay_s": np.array(0.006)}
    run(G1, "step", (0.3, 0.0, 0.0), 2.9, sample=load | delays)


@pytest.mark.parametrize(("robot", "name", "duration_s"), [(GO1, "trot", 1.1), (G1, "step", 1.9)])
def test_feet_land_where_they_are_planned_to(robot: Robot, name: str, duration_s: float) -> None:
    policy = load_policy(name, robot)
    assert isinstance(policy, PlansFootholds)
    planned = np.full((len(robot.description.feet), 3), np.nan)  # world frame
    missed: list[np.ndarray] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if not loop.walking or loop.walking_s < 0.7:
            return
        truth, before = body.truth(), planned.copy()
        turn = heading_matrix(yaw_of(truth.base_quaternion.tolist()))
        planned[:] = truth.base_position + policy.footholds() @ turn.T
        landed = np.isnan(planned[:, 0]) & ~np.isnan(before[:, 0])
        missed.extend((truth.foot_position - before)[landed])

    run(robot, policy, (0.3, 0.0, 0.2), duration_s, watch)
    assert len(missed) >= 2
    assert np.abs(missed).max(axis=0) == pytest.approx(np.zeros(3), abs=0.035)  # the foot's thickness


UNIFORM, BODIES = np.random.default_rng(2).random, load_spec(GO1.xml_path).compile().nbody - 1
SAMPLE = draw(randomisation_of(GO1), UNIFORM, 12, BODIES)
RANDOMISED = {"sample": SAMPLE, "noise": NOISE, "record_rate_hz": 250.0, "config": brief(GO1)}


def test_in_a_pronk_no_foot_touches_for_a_part_of_each_cycle() -> None:
    trace = run(GO1, "pronk", (0.6, 0.0, 0.4), 1.7, **RANDOMISED)
    walking = trace.time_s > 1.0
    assert (~trace.foot_contact[walking].any(axis=1)).mean() > 0.35
    assert trace.base_velocity[walking, 0].mean() == pytest.approx(0.6, abs=0.12)
    assert (np.abs(trace.motor_torque) <= GO1.motor.peak_torque * 1.001).all()


def test_a_sideways_pronk_stays_upright_by_compensating_the_legs_momentum() -> None:
    """All legs swing to the same side while no foot is on the ground, so the base rolls to the other side."""
    config, rolls = controller_settings(GO1, "pronk", MpcConfig), []
    for compensated in (True, False):
        policy = Mpc(GO1, replace(config, legs_turn_base=compensated))
        trace = run_episode(GO1, policy, Episode(lambda _: np.array([0.0, 0.3, 0.0]), 1.4, **RANDOMISED))
        w, x, y, z = trace.base_quaternion.T
        rolls.append(np.abs(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))).max())
    assert rolls[0] < 0.8 * rolls[1]


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


def tripod(duration_s: float, plant: Path | None = None) -> tuple[Trace, Landings]:
    policy = load_policy("tripod", HEXAPOD)
    assert isinstance(policy, Walk)
    landings = Landings(policy)
    trace = run(HEXAPOD, policy, (0.12, 0.0, 0.0), duration_s, landings, config=HALF, plant=plant)
    return trace, landings


def test_a_hexapod_walks_straight_without_sinking_or_a_joint_beyond_its_limit() -> None:
    trace, landings = tripod(2.4)
    walked = trace.base_position[-1] - trace.base_position[0]
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
    plant.write_text(HEXAPOD.xml_path.read_text().replace("<worldbody>", block))
    trace, landings = tripod(1.8, plant)
    time_s, foot, touched = landings.early[0]
    assert (foot, touched) == (0, True)
    stands = (trace.time_s > time_s + 0.03) & (trace.time_s < time_s + 0.3)
    assert trace.foot_contact[stands, 0].all()
    assert trace.foot_position[stands, 0, 2].min() > 0.02 + 0.015
    assert max(map(tilt, trace.base_quaternion)) < np.deg2rad(0.8)
    assert np.ptp(trace.base_position[:, 2]) < 0.005


def test_the_fast_contender_is_twice_as_fast_as_the_default_steps() -> None:
    """The default steps allow at most 0.094 m/s, by the generator's own check."""
    trace = run(HEXAPOD, f"tripod@{HEXAPOD.folder / 'fast.yaml'}", (0.25, 0.0, 0.0), 2.4, config=HALF)
    late = trace.time_s > 1.4
    assert trace.base_velocity[late, 0].mean() > 0.19
    assert abs(trace.base_velocity[late, 1].mean()) < 0.02
    assert trace.base_position[:, 2].min() > 0.18


def test_mpc_walks_on_six_feet() -> None:
    trace = run(HEXAPOD, "mpc", (0.15, 0.0, 0.0), 2.0, config=HALF)
    assert trace.base_velocity[trace.time_s > 1.2, 0].mean() == pytest.approx(0.15, abs=0.04)
    assert trace.base_position[:, 2].min() > 0.18


def jumps(trace: Trace) -> int:
    """How often the robot rises by a tenth of a metre."""
    high = trace.base_position[:, 2] > 0.38
    return int((high[1:] & ~high[:-1]).sum())


def test_on_command_a_robot_jumps_ahead_and_stands_again() -> None:
    """The robot jumps once, although the command lasts until after the landing."""
    schedule = CommandSchedule((0.0, 1.2), ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0)))
    trace = run(GO1, "jump", schedule, 3.0, noise=NOISE, record_rate_hz=250.0)
    begin = int(np.searchsorted(trace.time_s, 0.6))  # the robot still stands
    base, feet = trace.base_position - trace.base_position[begin], trace.foot_position[:, :, 2]
    assert base[:, 2].max() >= 0.15
    assert feet.min(axis=1).max() - feet[begin].mean() >= 0.15
    assert 0.4 <= np.hypot(*base[-1, :2]) <= 0.7
    assert np.linalg.norm(trace.base_velocity[-1]) < 0.05
    assert base[-1, 2] == pytest.approx(0.0, abs=0.02)
    assert (np.abs(trace.motor_torque) <= GO1.motor.peak_torque * 1.001).all()
    assert jumps(trace) == 1


def test_the_velocity_of_a_planned_leap_is_the_derivative_of_its_position() -> None:
    config = controller_settings(GO1, "jump", JumpConfig)
    plan, stance_m, step_s = LeapPlan(config), config.plan.stance.height_m, 1e-4
    for begin, end in ((0.0, config.leap.crouch_s), (config.leap.crouch_s, plan.take_off_s)):
        aims = [plan.base(time_s, stance_m) for time_s in np.arange(begin, end - step_s, step_s)]
        position, velocity, acceleration = (np.array(each) for each in zip(*aims, strict=True))
        np.testing.assert_allclose(np.diff(position, axis=0) / step_s, velocity[:-1], atol=0.01)
        np.testing.assert_allclose(np.diff(velocity, axis=0) / step_s, acceleration[:-1], rtol=0.02, atol=0.5)
    leaving, later = (plan.base(plan.take_off_s + late_s, stance_m) for late_s in (0.0, 0.1))
    np.testing.assert_array_equal(later[:2], leaving[:2])


def test_a_mission_jumps_twice_and_returns_to_another_policy() -> None:
    policies = {name: load_policy(name, GO1) for name in ("stand", "jump")}
    mission = mission_of({"steps": [{"jump": 2}, {"wait": 0.1}]}, "mission")
    source = MissionSource(mission, "stand", abilities_of(policies, GO1))
    config, others = brief(GO1, odometry=True), {"jump": policies["jump"]}
    trace = run(GO1, policies["stand"], source, 30.0, config=config, record_rate_hz=100.0, others=others)
    assert source.progress.done
    assert jumps(trace) == 2


class Changes:
    """Walks, and requests another gait and other steps from 0.9 s on."""

    stopped: Stop | None = None

    def poll(self, status: Status) -> Request:
        request = Request(np.array([0.2, 0.0, 0.0]))
        if status.walking_s < 0.9:
            return request
        values = {name: span.lowest for name, span in status.offer.settings.items()} | {"pitch_rad": 0.1}
        return request._replace(settings=values | {"step_period_s": 9.0}, gait="walk")


@pytest.mark.parametrize("name", ["trot", "mpc"])
def test_changes_while_walking_act_and_no_joint_target_jumps(name: str) -> None:
    policy = load_policy(name, GO1)
    assert isinstance(policy, Steerable)
    assert set(policy.live_settings) <= set(DECLARED)
    seen: list[tuple[PolicyInput, np.ndarray, Applied]] = []
    act: Callable[[PolicyInput], JointCommand] = policy.act

    def watched(inputs: PolicyInput) -> JointCommand:
        decision = act(inputs)
        seen.append((inputs, decision.position.copy(), policy.applied))
        return decision

    policy.act = watched  # type: ignore[method-assign]
    trace = run(GO1, policy, Changes(), 2.6)
    inputs, targets, shown = zip(*seen, strict=True)
    first, last, height = shown[0].settings, shown[-1].settings, policy.live_settings["body_height_m"]
    assert (shown[0].gait, shown[-1].gait) == ("trot", "walk")
    assert set(last) == set(policy.live_settings)
    assert (last["pitch_rad"], last["body_height_m"]) == pytest.approx((0.1, height.lowest), abs=0.01)
    assert last["step_period_s"] > first["step_period_s"] + 0.05  # on its way
    heights = [each.settings["body_height_m"] for each in shown]
    assert np.abs(np.diff(heights)).max() < 0.005  # approached, which is what an operator sees
    assert any("step_period_s" in note for note in trace.notes)  # clipped
    rates = np.abs(np.diff(targets, axis=0)).max(axis=1) * policy.rate_hz
    late = np.array([each.time_s for each in inputs[1:]]) >= 0.9
    assert rates[late].max() <= GO1.description.target_rate_rad_s
    w, x, y, z = inputs[-1].sensed.quaternion
    assert -2.0 * (x * z - w * y) == pytest.approx(0.1, abs=0.05)  # pitch
    assert height.lowest - 0.03 < trace.base_position[-40:, 2].mean() < 0.5 * (height.lowest + height.default)
