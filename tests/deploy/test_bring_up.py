"""Bring-up, from holding a pose to walking: the measurements of each step, and the faults that it finds."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from injected import FAULTS, Injected

from footfall.common.config import load
from footfall.deploy.bring_up import criteria
from footfall.deploy.bring_up.config import BringUpConfig, BringUpLimits
from footfall.deploy.bring_up.criteria import Case, Criterion, Window
from footfall.deploy.bring_up.motions import one_after_the_other, swaying
from footfall.deploy.bring_up.recording import Samples
from footfall.deploy.bring_up.steps import STEPS, Plan, Setting, Step, Verdict, _Judge, run_step
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.imu import ImuReader
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.session import SessionResult
from footfall.deploy.wiring import wiring_of
from footfall.plant.injection import FaultInjector, Injection
from footfall.plant.robot import PlantConfig
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot

CONFIG = BringUpConfig(hold_s=0.5, move_s=0.5, slew_s=0.3, walk_s=0.5)
LOOP = DeployConfig(joint_rate_hz=250.0, stand_s=0.3, pose_rate_rad_s=3.0, scale=0.5)
RESULT = SessionResult("IDLE", (), 1.0, 2.5, 3.0, np.zeros(1), {}, (), ("a note",), (), "")
TIME_S = np.linspace(0.0, 1.0, 101)
TRAVEL = 0.15 * np.sin(np.pi * TIME_S) ** 2
STEADY = np.ones(101)
UP = np.tile([0.0, 0.0, 1.0], (101, 1))


def only(joint: int, path: np.ndarray) -> np.ndarray:
    """One joint of twelve moves along a path (101,), the others stay."""
    return path[:, None] * (np.arange(12) == joint)


def findings(
    robot: Robot, criterion: Criterion, *joints: int, sway_axis: str = "", **changes: np.ndarray
) -> list:
    """Findings on a robot at rest with the given changes; `joints` are those that should move."""
    values = {name: np.zeros((101, 12)) for name in ("target", "position", "velocity", "torque")}
    values["temperature_c"] = np.full((101, 12), 30.0)
    up, time_s = changes.pop("up", UP), changes.pop("time_s", TIME_S)
    samples = Samples(time_s, np.stack(list((values | changes).values()), axis=1), up)
    labels = [f"joint {joint}" for joint in range(12)]
    return list(criterion(Case(robot, labels, Window(0.0, 1.0, joints, sway_axis), samples, BringUpLimits())))


def assert_found(found: list[str], *expected: str) -> None:
    """There is one finding for each expectation, and it has all words of the expectation."""
    assert len(found) == len(expected), found
    for sentence, words in zip(found, expected, strict=True):
        assert all(word in sentence for word in words.split()), sentence


class TestCriteria:
    @pytest.mark.parametrize(
        ("moved", "by", "finds"),
        [
            (2, 1.0, []),
            (2, -1.0, ["joint 2 sign"]),
            (2, 0.1, ["joint 2 10% power"]),
            (2, -0.1, ["joint 2 -10% power"]),
            (2, 1.5, ["joint 2 150% ratio"]),
            (7, 1.0, ["joint 2 joint 7 swapped"]),
        ],
    )
    def test_a_joint_follows_its_target(self, go1: Robot, moved: int, by: float, finds: list[str]) -> None:
        """A joint's travel is measured from its start."""
        pose = go1.default_pose
        position = pose + 0.01 + only(moved, by * TRAVEL)
        found = findings(go1, criteria.follow, 2, target=pose + only(2, TRAVEL), position=position)
        assert_found(found, *finds)

    def test_two_moving_joints_are_not_reported_as_swapped(self, go1: Robot) -> None:
        position = only(2, 1.5 * TRAVEL) + only(5, 0.5 * TRAVEL)
        found = findings(go1, criteria.follow, 2, target=only(2, TRAVEL), position=position)
        assert_found(found, "joint 2 150% ratio", "joint 5 0.07 rad")

    @pytest.mark.parametrize(
        ("velocity", "finds"),
        [
            (np.sin(2 * np.pi * 20 * TIME_S), ["joint 4 0.7 rad/s"]),  # root mean square of 20 Hz
            (np.sin(2 * np.pi * 0.5 * TIME_S), []),  # a slow swing
            (20.0 * TIME_S, []),  # 20 rad/s^2 are within 0.1 rad/s of their mean over 0.1 s, in its middle
        ],
    )
    def test_a_shaking_joint_is_found(self, go1: Robot, velocity: np.ndarray, finds: list[str]) -> None:
        assert_found(findings(go1, criteria.calm, velocity=only(4, velocity)), *finds)

    @pytest.mark.parametrize(
        ("torque", "finds"),
        [
            (only(3, 0.7 * 23.7 * STEADY), ["joint 3 70%"]),
            (only(3, -0.7 * 23.7 * STEADY), ["joint 3 70%"]),
            (only(3, np.where(np.arange(101) == 50, 20.0, 0.0)), []),  # one sample of a hundred
            (only(5, 15.0 * STEADY), []),  # 42 % of a calf's 35.55 N m
            (only(5, 15.0 * STEADY) + only(3, 15.0 * STEADY), ["joint 3 63%"]),  # of a hip's 23.7 N m
        ],
    )
    def test_a_motor_with_too_much_torque_is_found(
        self, go1: Robot, torque: np.ndarray, finds: list[str]
    ) -> None:
        assert_found(findings(go1, criteria.modest, torque=torque), *finds)

    @pytest.mark.parametrize(("peak_c", "finds"), [(np.nan, []), (59.0, []), (61.0, ["joint 8 61 degrees"])])
    def test_a_short_rise_of_temperature_is_found_although_other_motors_report_none(
        self, go1: Robot, peak_c: float, finds: list[str]
    ) -> None:
        temperature_c = np.full((101, 12), np.nan)
        temperature_c[:, 8] = np.where(np.arange(101) == 30, peak_c, 59.0)
        assert_found(findings(go1, criteria.cool, temperature_c=temperature_c), *finds)

    @pytest.mark.parametrize(
        ("up", "finds"),
        [
            ((0.0, 0.0), []),
            ((-np.sin(0.2), 0.0), ["pitch +0.20"]),  # front down: the vertical points to its back
            ((np.sin(0.2), 0.0), ["pitch -0.20"]),
            ((0.0, np.sin(0.2)), ["roll +0.20"]),  # right side down: to its left
            ((0.0, -np.sin(0.2)), ["roll -0.20"]),
        ],
    )
    def test_a_tilted_base_is_found(self, go1: Robot, up: tuple[float, float], finds: list[str]) -> None:
        leaning = np.tile([*up, np.cos(0.2)], (101, 1))
        assert_found(findings(go1, criteria.level, up=leaning), *finds)

    @pytest.mark.parametrize(("tilt", "passes"), [(0.3, True), (0.4, False)])
    def test_on_uneven_ground_the_tilt_has_a_limit(self, go1: Robot, tilt: float, passes: bool) -> None:
        """The base tilts for a moment, forwards and to the side at once."""
        up = UP.copy()
        up[50] = *(np.sin(tilt) * np.array([0.6, -0.8])), np.cos(tilt)
        assert (findings(go1, criteria.upright, up=up) == []) is passes

    @pytest.mark.parametrize(
        ("share", "finds"),
        [
            ([1.0, 1.0, 1.0, 1.0], []),
            ([0.5, 0.5, 0.5, 0.5], ["50%"]),
            ([2.0, 2.0, 2.0, 2.0], ["200%"]),
            ([1.3, 1.3, 1.3, 0.1], ["leg RL 3 N of 125:"]),
        ],
    )
    def test_torques_that_do_not_match_the_weight_are_found(
        self, go1: Robot, share: list[float], finds: list[str]
    ) -> None:
        """Legs carry equal shares of 12.743 kg, by -J^T f, also if feet push against each other."""
        legs, pose = go1.legs, go1.default_pose
        aside = np.array([[60.0, 0.0, 0.0], [-60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, -60.0, 0.0]])
        for force in (np.zeros((4, 3)), aside):
            force[:, 2] = 12.743 * 9.81 / 4 * np.array(share)
            torque = legs.scatter(legs.torque(legs.pose(pose).jacobian, force), np.zeros(12))
            rows = {"position": np.tile(pose, (101, 1)), "torque": np.tile(torque, (101, 1))}
            assert_found(findings(go1, criteria.carry, **rows), *finds)

    @pytest.mark.parametrize("by_rad", [0.08, -0.08])
    @pytest.mark.parametrize(("sway_axis", "begin_s"), [("roll", 0.0), ("pitch", 1.0)])
    def test_a_tilt_that_differs_from_the_joints_tilt_is_found(
        self, go1: Robot, sway_axis: str, begin_s: float, by_rad: float
    ) -> None:
        """The base tilts to the right, then to the front, or the reverse.

        A constant misalignment of the IMU has no effect.
        """
        tilt = by_rad * np.sin(np.pi * TIME_S) ** 2
        way = swaying(go1, by_rad, 1.0)
        pose, zero = go1.default_pose, np.zeros(101)
        travel = np.array([way(begin_s + min(t, 0.999)) for t in TIME_S])

        def found(by_imu: np.ndarray, by_joints: float = 1.0) -> list[str]:
            sine, cosine = np.sin(by_imu), np.cos(by_imu)
            up = np.stack([zero, sine, cosine] if sway_axis == "roll" else [-sine, zero, cosine], axis=1)
            moved = {"target": pose + travel, "position": pose + by_joints * travel, "up": up}
            return findings(go1, criteria.sway, sway_axis=sway_axis, **moved)

        assert found(tilt) == found(tilt + 0.05) == found(0.32 * tilt, 0.32) == []
        assert_found(found(tilt / 2), f"{sway_axis} 50%")
        assert_found(found(-tilt), f"{sway_axis} -100%")
        assert_found(found(0.28 * tilt, 0.28), "legs do not tilt")
        assert_found(found(zero, 0.0), "legs do not tilt")


def test_each_joint_moves_towards_the_middle_of_its_range(go1: Robot) -> None:
    """The joint covers half of its path in a quarter of the time, and the whole path in half of it."""
    lower, upper = go1.soft_limits
    way = one_after_the_other(go1, [np.arange(12)], 0.1, 2.0)
    middle = np.where(go1.default_pose < 0.5 * (lower + upper), 1.0, -1.0)
    assert {-1.0, 1.0} == set(middle)
    for time_s, travel_rad in ((0.5, 0.05), (1.0, 0.1), (1.5, 0.05)):
        np.testing.assert_allclose(way(time_s), travel_rad * middle)


AT_REST = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))


class FakeLoop:
    """The parts of a loop that are recorded and judged."""

    def __init__(self) -> None:
        self.walking, self.walking_s, self.ended = True, 0.0, []  # type: ignore[var-annotated]
        self.target, self.temperature_c, self.sensed = np.zeros(12), np.full(12, 30.0), AT_REST

    def finish(self, skip_lie_down: bool = False) -> None:
        self.ended.append(skip_lie_down)


class TestJudge:
    def judge(self, go1: Robot, *windows: Window, **step: object) -> _Judge:
        def no_plan(_: Setting) -> Plan:
            raise AssertionError("a step that is only judged needs no plan")

        setting = Setting(go1, Hold(go1), stand_still, CONFIG, LOOP)
        made = Step("x", False, "", no_plan, ())._replace(**step)
        return _Judge(setting, made, Plan(Hold(go1), list(windows)))

    def test_each_window_is_judged_once_as_it_ends_by_its_own_samples(self, go1: Robot) -> None:
        """Every other tick of 10 ms is recorded, from 10 ms on, and none before the robot walks."""
        seen: list[tuple[float, list[float]]] = []

        def note(case: Case) -> Iterator[str]:
            seen.append((case.window.end_s, case.samples.time_s.tolist()))
            yield from ()

        judge, loop = self.judge(go1, Window(0.0, 0.1), Window(0.1, 0.2), criteria=(note,)), FakeLoop()
        loop.walking = False
        for _ in range(10):
            judge.tick(loop)  # type: ignore[arg-type]
        loop.walking = True
        for tick in range(22):
            assert not judge.verdict(RESULT).passed
            loop.walking_s = 0.01 * tick
            judge.tick(loop)  # type: ignore[arg-type]
        assert judge.verdict(RESULT).passed
        assert [end_s for end_s, _ in seen] == [0.1, 0.2]
        np.testing.assert_allclose([times for _, times in seen], 0.01 * np.arange(1, 21, 2).reshape(2, 5))
        assert loop.ended == []

    def test_the_supervisors_faults_come_first_and_an_early_end_fails(self, go1: Robot) -> None:
        judge = self.judge(go1, Window(0.0, 9.0))
        assert len(judge.verdict(RESULT).findings) == 1
        judge.findings.append("it leans")
        verdict = judge.verdict(replace(RESULT, faults=("it fell",)))
        assert (verdict.step, verdict.findings, verdict.passed) == ("x", ("it fell", "it leans"), False)


def test_a_scale_lowers_gains_and_torque_but_not_damping(go1: Robot) -> None:
    """Joints rest at zero. Gains are halved; torques are at most half the peak of 23.7 and 35.55 N m."""
    driver = open_driver(wiring_of(go1))
    full, half = (JointLayer(go1, driver, ImuReader(0), 1.0, scale) for scale in (1.0, 0.5))
    command = np.zeros((5, 12))
    command[0], command[2], command[4] = 1.0, 1.0, 2.0
    for layer in (full, half):
        layer.command(command)
    # A gait's feed-forward torque is halved, too.
    np.testing.assert_allclose(half.sent[[2, 4]], 0.5 * full.sent[[2, 4]])
    command[0], command[2], command[4] = go1.soft_limits[1], 400.0, 0.0
    half.command(command)
    torque = half.sent[2] * half.sent[0]
    assert (np.abs(torque) <= 0.5 * go1.motor.peak_torque + 1e-9).all()
    half.damping(3.0)
    assert (half.sent[3] == 3.0).all()


def injected(robot: Robot, hangs: bool) -> Injected:
    return Injected(robot, Hold(robot), PlantConfig(lying=not hangs, hanging=hangs))


def verdict_of(robot: Robot, name: str, inject: Injection | None = None) -> Verdict:
    """The verdict of a single step, after which the motors must be disabled."""
    step = next(step for step in STEPS if step.name == name)
    simulated = injected(robot, step.hangs)
    if inject is not None:
        inject(simulated.injector)
    setting = Setting(robot, Hold(robot), stand_still, CONFIG, LOOP, realtime=False)
    verdict = run_step(step, setting, simulated.bus)
    assert not simulated.body.motors_on.any()
    return verdict


def no_power(injector: FaultInjector) -> None:
    injector.body.weaken(np.where(np.arange(len(injector.robot.joint_names)) == injector.joint, 0.0, 1.0))


def wrong_ratio(injector: FaultInjector) -> None:
    """The first joint's travel is reported 1.5 times as large."""
    injector.joint, first = 0, injector.robot.default_pose[0]

    def change(values: np.ndarray, _: np.ndarray) -> None:
        values[0, 0] = first + 1.5 * (values[0, 0] - first)
        values[1, 0] *= 1.5

    injector.on_values(change)


@pytest.mark.parametrize("step", ["hold", "shift", "walk"])
def test_a_sound_robot_passes(go1: Robot, step: str) -> None:
    verdict = verdict_of(go1, step)
    assert (verdict.findings, verdict.outcome.final_state) == ((), "IDLE")


@pytest.mark.parametrize(
    ("steps", "inject", "message"),
    [
        (["hold"], FAULTS["motor's torque reversed"], "pulls the other way"),
        (["hold"], FAULTS["ids of two motors swapped"], "outside its range"),
        (["hold"], no_power, "no torque"),
        (["hold"], FAULTS["motor at 90 degrees Celsius"], "90 degrees Celsius"),
        (["hold", "joints"], wrong_ratio, "ratio"),
        (["hold", "stand"], FAULTS["one encoder off by a turn of the rotor"], ""),
    ],
    ids=["sign", "swapped", "no power", "hot", "ratio", "zero"],
)
def test_the_first_step_to_notice(go1: Robot, steps: list[str], inject: Injection, message: str) -> None:
    for earlier in steps[:-1]:
        assert verdict_of(go1, earlier, inject).passed
    verdict = verdict_of(go1, steps[-1], inject)
    assert not verdict.passed
    assert message in " ".join(verdict.findings)
    if steps[-1] == "joints":
        assert verdict.outcome.walked_s < 1.5 * CONFIG.move_s  # no other joint had to move


def test_the_defaults_and_the_page_agree(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/bring_up.md").read_text(encoding="utf-8")
    path = tmp_path / "limits.yaml"
    path.write_text(page.partition("<!-- read as: bring-up -->\n```yaml")[2].partition("```")[0])
    assert load(path, BringUpConfig) == BringUpConfig()
