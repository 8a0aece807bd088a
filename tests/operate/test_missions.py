"""Missions: their goals, refusals and when they give up, on a robot with a lag and on the simulated robot."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused import refusal_of
from walking_run import LIMITS, WALKING, abilities

from footfall import Episode, Robot, load_policy, run_episode
from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.battery import BatteryState
from footfall.deploy.command_source import Behaviour, Pose, Request
from footfall.deploy.config import DeployConfig
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.activities import Input, Reach
from footfall.operate.missions.follow import Tracking
from footfall.operate.missions.mission import load_mission, mission_of
from footfall.operate.missions.source import DONE, MissionSource
from footfall.operate.sources import check_source, is_mission

STEP_S, LAG_S = 0.02, 0.15
START = Pose(3.0, -2.0, 2.5)  # a mission begins at the robot's position, not at the origin of the odometry


class Walker:
    """A robot whose velocity follows the command with a lag; commands that are too slow do not move it."""

    def __init__(self, steps: list[Any], hold: Callable[[float], bool] = lambda _: False, **settings: Any):
        self.source = MissionSource(mission_of({"steps": steps, **settings}, "mission"), "trot", abilities)
        self.pose, self.velocity, self.time_s, self.policy = START, np.zeros(3), 0.0, "trot"
        self.requests: list[Request] = []
        self.charge, self._hold = 1.0, hold

    def run(self) -> "Walker":
        while not self.source.progress.outcome:
            self.step()
            assert self.time_s < 300.0, self.source.progress
        return self

    def step(self) -> None:
        yaw = math.remainder(self.pose.yaw_rad, 2 * math.pi)
        pose, battery = self.pose._replace(yaw_rad=yaw), BatteryState(charge=self.charge)
        status = WALKING._replace(walking_s=self.time_s, policy=self.policy, pose=pose, battery=battery)
        request = self.source.poll(status)
        self.policy = request.policy or self.policy
        self.requests.append(request)
        low, high = np.array(list(vars(LIMITS.ranges).values())).T
        assert np.array_equal(request.velocity, np.clip(request.velocity, low, high))
        moves = np.linalg.norm(request.velocity) >= LIMITS.min_norm and not self._hold(self.time_s)
        self.velocity = self.velocity + STEP_S / LAG_S * (request.velocity * moves - self.velocity)
        (x, y, yaw), (ahead, left, turn) = self.pose, (STEP_S * self.velocity).tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        self.pose = Pose(x + cos * ahead - sin * left, y + sin * ahead + cos * left, yaw + turn)
        self.time_s += STEP_S

    def moved(self) -> tuple[float, float, float]:
        """Ahead m, left m and turned degrees since the start."""
        (x, y, yaw), (x0, y0, yaw0) = self.pose, START
        cos, sin = math.cos(yaw0), math.sin(yaw0)
        ahead, left = x - x0, y - y0
        return cos * ahead + sin * left, cos * left - sin * ahead, math.degrees(yaw - yaw0)


def test_each_step_reaches_its_goal() -> None:
    for steps, ahead, left, turned in (
        ([{"rectangle": "2x1"}], 0.0, 0.0, 360.0),
        ([{"rectangle": "1x-0.5"}], 0.0, 0.0, -360.0),
        ([{"circle": {"radius_m": 0.8, "speed_m_s": 0.4}}], 0.0, 0.0, 360.0),
        ([{"circle": -0.5}], 0.0, 0.0, -360.0),
        ([{"go_to": [1.0, 1.0]}], 1.0, 1.0, 45.0),
        ([{"go_to": {"to": [-1.0, 0.0], "heading_deg": 90.0}}], -1.0, 0.0, 90.0),
        ([{"turn": 450}, {"turn": -90}], 0.0, 0.0, 360.0),
        ([{"waypoints": [[1, 0], [1.5, 0.5], [1.5, 1.0]]}, {"go_to": [0, 0]}], 0.0, 0.0, 180 + 53.0),
        ([{"walk": {"velocity": [0.3, 0.2, 0], "distance_m": 1.0}}], 0.86, 0.57, 0.0),
        ([{"walk": {"velocity": [0, 0, 0.5], "for_s": 2.0}}, {"wait": 1.0}], 0.0, 0.0, 57.3),
    ):
        walker = Walker(steps).run()
        where = walker.moved()
        assert walker.source.progress.outcome == DONE, steps
        assert math.dist(where[:2], (ahead, left)) < 0.1, (steps, where)
        assert abs(where[2] - turned) < 8.0 or turned == 233.0, (steps, where)
        assert walker.requests[-1].behaviour is Behaviour.LIE_DOWN


def test_a_mission_gives_up_with_its_reason() -> None:
    stuck = Walker([{"wait": 1}, {"rectangle": "2x1"}], hold=lambda t: t > 4.0).run()
    assert "step 2 (rectangle)" in stuck.source.progress.outcome
    assert stuck.time_s < 15.0
    slow = Walker([{"go_to": {"to": [2, 0], "timeout_s": 1.0}}]).run()
    assert "longer than 1 s" in slow.source.progress.outcome
    carried = Walker([{"rectangle": "2x1"}])
    carried.step()
    carried.pose = carried.pose._replace(x_m=carried.pose.x_m + 1.0)
    assert "away from the path" in carried.run().source.progress.outcome
    far = Walker([{"wait": 1}, {"go_to": [499.9, 0]}])
    far.step()
    far.pose = far.pose._replace(x_m=far.pose.x_m + 1.0)
    assert "step 2 (go_to)" in far.run().source.progress.outcome
    lost = Walker([{"turn": 90}])
    lost.pose = Pose(math.nan, math.nan, math.nan)
    assert "no odometry" in lost.run().source.progress.outcome
    assert "step 0" not in lost.source.progress.outcome
    for walker in (stuck, slow, carried, far, lost):
        last = walker.requests[-1]
        assert (last.velocity.any(), last.behaviour) == (False, Behaviour.LIE_DOWN)
        assert last.note.startswith("the mission gave up")


def test_at_low_battery_the_robot_walks_home_or_lies_down() -> None:
    for then, home in (("home", True), ("lie_down", False)):
        walker = Walker([{"go_to": [3.0, 0.0]}], on_low_charge=then, low_charge=0.3)
        while walker.time_s < 4.0:
            walker.step()
        walker.charge = 0.25
        assert math.hypot(*walker.moved()[:2]) > 1.0
        walker.run()
        assert (math.hypot(*walker.moved()[:2]) < 0.1) is home
        assert any("low battery" in request.note for request in walker.requests)
    far = Walker([{"wait": 9}])
    far.step()
    far.pose, far.charge = far.pose._replace(x_m=far.pose.x_m + 850.0), 0.1
    far.step()
    progress = far.source.progress
    assert (progress.outcome, progress.steps) == ("", 3)  # two steps home, then lie down


def test_changes_of_policy_gait_and_settings_come_in_order() -> None:
    walk = [{"gait": "wave"}, {"set": {"body_height_m": 0.25}}, {"wait": 1}]
    walker = Walker([*walk, {"policy": "stand"}, {"wait": 1}]).run()
    with_gait = [request for request in walker.requests if request.policy == ""][-1]
    assert (with_gait.gait, with_gait.settings) == ("wave", {"body_height_m": 0.25})
    assert (walker.requests[-1].policy, walker.requests[-1].gait) == ("stand", "")


def test_an_impossible_step_is_refused_with_its_number(tmp_path: Path) -> None:
    path = tmp_path / "mission.yaml"
    for text, where, why in (
        ("", "mission.yaml", "list of steps"),
        ("steps: []", "mission.yaml", "list of steps"),
        ("speed: 3\nsteps: [{turn: 90}]", "mission.yaml", "speed_m_s"),
        (f"steps: [{', '.join(['{wait: 1}'] * 1001)}]", "mission.yaml", "1001 steps"),
        ("steps: [{wait: 1}, {trun: 90}]", "step 2", "mean turn?"),
        ("steps: [{turn: 90, wait: 1}]", "step 1", "one key"),
        ("steps: [{turn: fast}]", "step 1 (turn)", "not a number"),
        ("steps: [{turn: .nan}]", "step 1 (turn)", "finite"),
        ("steps: [{turn: {by_deg: 90, by: 1}}]", "step 1 (turn)", "no setting by"),
        ("steps: [{rectangle: 2 by 1}]", "step 1 (rectangle)", "2x1"),
        ("steps: [{rectangle: 2x0}]", "step 1 (rectangle)", "sides"),
        ("steps: [{circle: 1e6}]", "step 1 (circle)", "radius_m"),
        ("steps: [{circle: 999}]", "step 1 (circle)", "long"),
        ("steps: [{waypoints: [[1, 0], [1, 0]]}]", "step 1 (waypoints)", "same"),
        ("steps: [{walk: {velocity: [1, 0, 0]}}]", "step 1 (walk)", "for_s or distance_m"),
        ("steps: [{walk: {velocity: [1, 0, 1], distance_m: 1}}]", "step 1 (walk)", "turn"),
        ("steps: [{walk: {velocity: [0, 2, 0], for_s: 1}}]", "step 1 (walk)", "leftward"),
        ("steps: [{go_to: {to: [1, 0], speed_m_s: 2}}]", "step 1 (go_to)", "up to 1"),
        ("steps: [lie_down, {wait: 1}]", "step 1 (lie_down)", "last"),
        ("steps: [{lie_down: 3}]", "step 1 (lie_down)", "no value"),
        ("steps: [{gait: bound}]", "step 1 (gait)", "trot, wave"),
        ("steps: [{policy: mpc}]", "step 1 (policy)", "trot, stand"),
        ("steps: [{set: {body_height_m: 0.5}}]", "step 1 (set)", "0.2 to 0.3"),
        ("steps: [{set: {height: 0.5}}]", "step 1 (set)", "body_height_m"),
        ("steps: [{policy: stand}, {rectangle: 2x1}]", "step 2 (rectangle)", "forward"),
        ("steps: [{policy: stand}, {gait: trot}]", "step 2 (gait)", "one only"),
    ):  # fmt: skip
        path.write_text(text)
        message = refusal_of(lambda: MissionSource(load_mission(path), "trot", abilities))
        assert where in message, (text, message)
        assert why in message, (text, message)


@pytest.mark.parametrize("goal", [Pose(0.0, 0.0, 1.0), Pose(0.0, 0.0, -1.0)])
def test_a_turn_takes_the_same_time_to_either_side(goal: Pose) -> None:
    act = Reach(goal, LIMITS, Tracking()).act(Input(0.0, Pose(0.0, 0.0, 0.0), "trot"))
    assert act.remaining_s == pytest.approx(1.0 / LIMITS.yaw_rad_s)


def test_a_mission_steers_the_simulated_robot_and_ends_the_run(go1: Robot) -> None:
    policy = load_policy("go1-flat", go1)
    steps = [{"go_to": {"to": [0.3, 0.0], "heading_deg": 30.0}}]
    mission = mission_of({"speed_m_s": 0.5, "steps": steps, "tracking": {"tolerance_m": 0.03}}, "mission")
    source = MissionSource(mission, policy.name, abilities_of({"go1-flat": policy}, go1))
    episode = Episode(source, 30.0, config=DeployConfig(odometry=True, stand_s=0.2), record_rate_hz=10.0)
    trace = run_episode(go1, policy, episode)
    assert (source.progress.done, trace.final_state, trace.fell) == (True, "IDLE", False)
    assert source.progress.error_m <= 0.03
    assert trace.walked_s < 5.0
    first, last = (float(heading(trace.base_quaternion[index])) for index in (0, -1))
    moved = heading_matrix(-first) @ (trace.base_position[-1] - trace.base_position[0])
    assert np.linalg.norm(moved[:2] - (0.3, 0.0)) < 0.06
    assert math.degrees(wrap_angle(last - first)) == pytest.approx(30.0, abs=6.0)


def test_a_yaml_file_is_a_mission_unless_it_holds_a_sources_settings() -> None:
    for name in ("tour.yaml", "my/tour.YML", "gamepad", "gamepad:mine.yaml"):
        assert is_mission(name) is ("tour" in name)
        check_source(name)
    assert "gamepda" in refusal_of(check_source, "gamepda")
