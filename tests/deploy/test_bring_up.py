"""Bring-up, from holding a pose to walking: the measurements of each step, and the faults that it finds."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from injected import FAULTS, Injected

from footfall.deploy.bring_up import criteria
from footfall.deploy.bring_up.config import BringUpConfig, BringUpLimits
from footfall.deploy.bring_up.criteria import Case, Criterion, Window
from footfall.deploy.bring_up.motions import one_after_the_other, swaying
from footfall.deploy.bring_up.recording import Samples
from footfall.deploy.bring_up.steps import STEPS, Plan, Setting, Step, Verdict, _Judge, run_step
from footfall.deploy.config import DeployConfig
from footfall.deploy.session import SessionResult
from footfall.plant.injection import FaultInjector, Injection
from footfall.plant.robot import PlantConfig
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot

CONFIG = BringUpConfig(hold_s=0.5, move_s=0.5, slew_s=0.3, walk_s=0.5)
LOOP = DeployConfig(joint_rate_hz=250.0, stand_s=0.3, pose_rate_rad_s=3.0, scale=0.5)
RESULT = SessionResult("IDLE", (), 1.0, 2.5, 3.0, np.zeros(1), {}, (), ("a note",), (), "")
TIME_S = np.linspace(0.0, 1.0, 101)
BUMP = np.sin(np.pi * TIME_S) ** 2
TRAVEL, STEADY = 0.15 * BUMP, np.ones(101)
SAMPLE, JOINTS = np.arange(101), np.arange(12)


def only(joint: int, path: np.ndarray) -> np.ndarray:
    """One joint of twelve moves along a path (101,), the others stay."""
    return path[:, None] * (joint == JOINTS)


TWO_MOVE = only(2, 1.5 * TRAVEL) + only(5, 0.5 * TRAVEL)


def moved(path: np.ndarray) -> dict[str, np.ndarray]:
    """Joint 2 is commanded along `TRAVEL`; the joints move along `path` (101, 12). The starts differ."""
    return {"target": only(2, TRAVEL) + 0.5, "position": path - 1.5}


def temperature_of(peak_c: float) -> dict[str, np.ndarray]:
    """One motor's temperature is at its peak for one sample; the others report none."""
    return {"temperature_c": np.where(JOINTS == 8, np.where(SAMPLE == 30, peak_c, 59.0)[:, None], np.nan)}


def tilted(x: float, y: float, when: np.ndarray = STEADY) -> dict[str, np.ndarray]:
    """Samples at `when` with a tilted base: x and y of the vertical in the base's axes."""
    return {"up": np.where(when[:, None], [x, y, np.sqrt(1.0 - x**2 - y**2)], [0.0, 0.0, 1.0])}


def check(
    robot: Robot, criterion: Criterion, expected: list[str], axis: str = "", **changes: np.ndarray
) -> None:
    """A robot at rest with these changes has the expected findings; each contains all words of its text."""
    zeros, up = np.zeros((101, 12)), changes.pop("up", np.tile([0.0, 0.0, 1.0], (101, 1)))
    values = dict.fromkeys(("target", "position", "velocity", "torque"), zeros)
    rows = values | {"temperature_c": zeros + 30.0} | changes
    samples = Samples(TIME_S, np.stack(list(rows.values()), axis=1), up)
    labels = [f"joint {joint}" for joint in range(12)]
    case = Case(robot, labels, Window(0.0, 1.0, (2,), axis), samples, BringUpLimits())
    for sentence, words in zip(criterion(case), expected, strict=True):
        assert all(word in sentence for word in words.split()), sentence


def test_a_criterion_names_the_joint_and_the_figure(go1: Robot) -> None:
    for criterion, changes, expected in (
        (criteria.follow, moved(only(2, TRAVEL)), []),
        (criteria.follow, moved(only(2, -TRAVEL)), ["joint 2 sign"]),
        (criteria.follow, moved(only(2, 0.1 * TRAVEL)), ["joint 2 10% power"]),
        (criteria.follow, moved(only(2, -0.1 * TRAVEL)), ["joint 2 -10% power"]),
        (criteria.follow, moved(only(2, 1.5 * TRAVEL)), ["joint 2 150% ratio"]),
        (criteria.follow, moved(only(7, TRAVEL)), ["joint 2 joint 7 swapped"]),
        (criteria.follow, moved(TWO_MOVE), ["joint 2 150% ratio", "joint 5 0.07 rad"]),  # not swapped
        # The root mean square of a vibration of 20 Hz.
        (criteria.calm, {"velocity": only(4, np.sin(2 * np.pi * 20 * TIME_S))}, ["joint 4 0.7 rad/s"]),
        (criteria.calm, {"velocity": only(4, np.sin(2 * np.pi * 0.5 * TIME_S))}, []),  # a slow swing
        # At 20 rad/s^2 a velocity differs by at most 0.1 rad/s from its mean over 0.1 s around it.
        (criteria.calm, {"velocity": only(4, 20.0 * TIME_S)}, []),
        (criteria.modest, {"torque": only(3, 0.7 * 23.7 * STEADY)}, ["joint 3 70%"]),
        (criteria.modest, {"torque": only(3, -0.7 * 23.7 * STEADY)}, ["joint 3 70%"]),
        (criteria.modest, {"torque": only(3, 20.0 * (SAMPLE == 50))}, []),  # one sample of a hundred
        (criteria.modest, {"torque": only(5, 15.0 * STEADY)}, []),  # 42 % of a calf's 35.55 N m
        # The same torque is 63 % of a hip's 23.7 N m.
        (criteria.modest, {"torque": only(5, 15.0 * STEADY) + only(3, 15.0 * STEADY)}, ["joint 3 63%"]),
        (criteria.cool, temperature_of(np.nan), []),
        (criteria.cool, temperature_of(59.0), []),
        (criteria.cool, temperature_of(61.0), ["joint 8 61 degrees"]),
        (criteria.level, tilted(0.0, 0.0), []),
        (criteria.level, tilted(-np.sin(0.2), 0.0), ["pitch +0.20"]),  # front down: the vertical points back
        (criteria.level, tilted(np.sin(0.2), 0.0), ["pitch -0.20"]),
        (criteria.level, tilted(0.0, np.sin(0.2)), ["roll +0.20"]),  # right side down: to its left
        (criteria.level, tilted(0.0, -np.sin(0.2)), ["roll -0.20"]),
        # For a moment, forwards and to the side at once.
        (criteria.upright, tilted(0.6 * np.sin(0.3), -0.8 * np.sin(0.3), SAMPLE == 50), []),
        (criteria.upright, tilted(0.6 * np.sin(0.4), -0.8 * np.sin(0.4), SAMPLE == 50), ["0.41 rad"]),
    ):
        check(go1, criterion, expected, **changes)


def test_torques_that_do_not_match_the_weight(go1: Robot) -> None:
    """Legs carry equal shares of 12.743 kg, by -J^T f, also if feet push against each other."""
    legs, pose = go1.legs, go1.default_pose
    aside = np.array([[60.0, 0.0], [-60.0, 0.0], [0.0, 60.0], [0.0, -60.0]])
    for share, expected in (
        ([1.0, 1.0, 1.0, 1.0], []),
        ([0.5, 0.5, 0.5, 0.5], ["50%"]),
        ([2.0, 2.0, 2.0, 2.0], ["200%"]),
        ([1.3, 1.3, 1.3, 0.1], ["leg RL 3 N of 125:"]),
    ):
        for sideways in (0.0 * aside, aside):
            force = np.column_stack([sideways, 12.743 * 9.81 / 4 * np.array(share)])
            torque = legs.scatter(legs.torque(legs.pose(pose).jacobian, force), np.zeros(12))
            rows = {"position": np.tile(pose, (101, 1)), "torque": np.tile(torque, (101, 1))}
            check(go1, criteria.carry, expected, **rows)


@pytest.mark.parametrize("by_rad", [0.08, -0.08])
@pytest.mark.parametrize(("axis", "begin_s"), [("roll", 0.0), ("pitch", 1.0)])
def test_a_tilt_that_differs_from_the_joints(go1: Robot, axis: str, begin_s: float, by_rad: float) -> None:
    """The base tilts to the right, then to the front, or the reverse. A constant error has no effect."""
    tilt, sway, pose = by_rad * BUMP, swaying(go1, by_rad, 1.0), go1.default_pose
    travel = np.array([sway(begin_s + min(t, 0.999)) for t in TIME_S])
    for by_imu, by_joints, expected in (
        (tilt, 1.0, []), (tilt + 0.05, 1.0, []), (0.32 * tilt, 0.32, []), (tilt / 2, 1.0, [f"{axis} 50%"]),
        (-tilt, 1.0, [f"{axis} -100%"]), (0.28 * tilt, 0.28, ["legs do not tilt"]),
        (0.0 * tilt, 0.0, ["legs do not tilt"]),
    ):  # fmt: skip
        zero, sine, cosine = np.zeros(101), np.sin(by_imu), np.cos(by_imu)
        up = np.stack([zero, sine, cosine] if axis == "roll" else [-sine, zero, cosine], axis=1)
        rows = {"target": pose + travel, "position": pose + by_joints * travel, "up": up}
        check(go1, criteria.sway, expected, axis, **rows)


def test_each_joint_moves_towards_the_middle_of_its_range(go1: Robot) -> None:
    """The joint covers half of its path in a quarter of the time, and the whole path in half of it."""
    lower, upper = go1.soft_limits
    travel_at = one_after_the_other(go1, [JOINTS], 0.1, 2.0)
    middle = np.where(go1.default_pose < 0.5 * (lower + upper), 1.0, -1.0)
    assert {-1.0, 1.0} == set(middle)
    for time_s, travel_rad in ((0.5, 0.05), (1.0, 0.1), (1.5, 0.05)):
        np.testing.assert_allclose(travel_at(time_s), travel_rad * middle)


def judge_of(robot: Robot, *windows: Window, criteria: tuple[Criterion, ...] = ()) -> _Judge:
    setting = Setting(robot, Hold(robot), stand_still, CONFIG, LOOP)
    return _Judge(setting, Step("x", False, "", pytest.fail, criteria), Plan(Hold(robot), list(windows)))


def test_each_window_is_judged_once_as_it_ends_by_its_own_samples(go1: Robot) -> None:
    """Every other tick of 10 ms is recorded, from 10 ms on, and none before the robot walks."""
    seen: list[tuple[float, list[float]]] = []

    def note(case: Case) -> Iterator[str]:
        seen.append((case.window.end_s, case.samples.time_s.tolist()))
        yield from ()

    judge = judge_of(go1, Window(0.0, 0.1), Window(0.1, 0.2), criteria=(note,))
    at_rest = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))
    loop = SimpleNamespace(walking=False, walking_s=0.0, sensed=at_rest, finish=pytest.fail)
    loop.target, loop.temperature_c = np.zeros(12), np.full(12, 30.0)
    for tick in range(-10, 22):
        assert not judge.verdict(RESULT).passed
        loop.walking, loop.walking_s = tick >= 0, 0.01 * max(tick, 0)
        judge.tick(loop)  # type: ignore[arg-type]
    assert judge.verdict(RESULT).passed
    assert [end_s for end_s, _ in seen] == [0.1, 0.2]
    np.testing.assert_allclose([times for _, times in seen], 0.01 * np.arange(1, 21, 2).reshape(2, 5))


def test_the_supervisors_faults_come_first_and_an_early_end_fails(go1: Robot) -> None:
    judge = judge_of(go1, Window(0.0, 9.0))
    assert len(judge.verdict(RESULT).findings) == 1
    judge.findings.append("it leans")
    verdict = judge.verdict(replace(RESULT, faults=("it fell",)))
    assert (verdict.step, verdict.findings, verdict.passed) == ("x", ("it fell", "it leans"), False)


def verdict_of(robot: Robot, name: str, inject: Injection = lambda _: None) -> Verdict:
    """The verdict of a single step, after which the motors must be disabled."""
    step = next(step for step in STEPS if step.name == name)
    simulated = Injected(robot, Hold(robot), PlantConfig(lying=not step.hangs, hanging=step.hangs))
    inject(simulated.injector)
    setting = Setting(robot, Hold(robot), stand_still, CONFIG, LOOP, realtime=False)
    verdict = run_step(step, setting, simulated.bus)
    assert not simulated.body.motors_on.any()
    return verdict


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


def test_each_fault_is_found_by_the_first_step_that_can(go1: Robot) -> None:
    for steps, inject, message in (
        (["hold"], FAULTS["motor's torque reversed"], "pulls the other way"),
        (["hold"], FAULTS["ids of two motors swapped"], "outside its range"),
        (["hold"], lambda injector: injector.body.weaken(1.0 * (injector.joint != JOINTS)), "no torque"),
        (["hold"], FAULTS["motor at 90 degrees Celsius"], "90 degrees Celsius"),
        (["hold", "joints"], wrong_ratio, "ratio"),
        (["hold", "stand"], FAULTS["one encoder off by a turn of the rotor"], ""),
    ):
        for earlier in steps[:-1]:
            assert verdict_of(go1, earlier, inject).passed, message
        verdict = verdict_of(go1, steps[-1], inject)
        assert not verdict.passed, message
        assert message in " ".join(verdict.findings)
        if steps[-1] == "joints":
            assert verdict.outcome.walked_s < 1.5 * CONFIG.move_s  # no other joint had to move
