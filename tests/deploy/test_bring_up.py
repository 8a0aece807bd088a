"""Bring-up, from holding a pose to walking: what each step measures, and which step finds which fault."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from injected import FAULTS, Injected
from shell import Shell

from footfall.common.config import load
from footfall.deploy.bring_up.config import BringUpConfig, BringUpLimits
from footfall.deploy.bring_up.criteria import (
    Case,
    Window,
    calm,
    carry,
    cool,
    follow,
    level,
    modest,
    sway,
    upright,
)
from footfall.deploy.bring_up.motions import (
    SlewedIn,
    StandingTrajectoryPolicy,
    TrajectoryPolicy,
    one_after_the_other,
    swaying,
)
from footfall.deploy.bring_up.recording import Recording, Samples
from footfall.deploy.bring_up.steps import STEPS, Plan, Setting, Step, Verdict, _Judge, run_step
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.imu import ImuReader
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.session import SessionResult
from footfall.deploy.wiring import Wiring, wire
from footfall.plant.injection import FaultInjector, Injection
from footfall.plant.robot import PlantConfig
from footfall.plant.wires import SimulatedWires
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import Robot
from footfall.terrain.ground import Ground
from footfall.verbs import bring_up

CONFIG = BringUpConfig(hold_s=0.5, move_s=0.5, slew_s=0.3, walk_s=0.5)
LOOP = DeployConfig(joint_rate_hz=250.0, stand_s=0.3, pose_rate_rad_s=3.0, scale=0.5)
RESULT = SessionResult("IDLE", (), 1.0, 2.5, 3.0, np.zeros(1), {}, (), ("a note",), ())
TIME_S = np.linspace(0.0, 1.0, 101)
WAY = 0.15 * np.sin(np.pi * TIME_S) ** 2


def samples(n: int = 12, **changes: np.ndarray) -> Samples:
    """A robot at rest, except for the given changes."""
    values = {name: np.zeros((101, n)) for name in ("target", "position", "velocity", "torque")}
    values["temperature_c"] = np.full((101, n), 30.0)
    up = changes.pop("up", np.tile([0.0, 0.0, 1.0], (101, 1)))
    return Samples(TIME_S, np.stack(list((values | changes).values()), axis=1), up)


def only(joint: int, way: np.ndarray, n: int = 12) -> np.ndarray:
    """One joint moves along a path (101,), the others stay."""
    return way[:, None] * (np.arange(n) == joint)


def case_of(robot: Robot, made: Samples, *joints: int, sways: str = "") -> Case:
    places = [f"joint {joint}" for joint in range(len(robot.joint_names))]
    return Case(robot, places, Window(0.0, 1.0, joints, sways), made, BringUpLimits())


class TestCriteria:
    @pytest.mark.parametrize(
        ("moved", "by", "says"),
        [
            (2, 1.0, []),
            (2, -1.0, ["joint 2 turns in the wrong direction: its sign is wrong"]),
            (2, 0.1, ["joint 2 covers 10% of its travel: it has no power, or is blocked"]),
            (2, -0.1, ["joint 2 covers -10% of its travel: it has no power, or is blocked"]),
            (2, 1.5, ["joint 2 covers 150% of its travel: its gear ratio is wrong"]),
            (7, 1.0, ["joint 2 should move, but joint 7 does: their ids or plugs are swapped"]),
        ],
    )
    def test_a_joint_follows_its_target(self, go1: Robot, moved: int, by: float, says: list[str]) -> None:
        """Its travel is measured from its start."""
        pose = go1.default_pose
        made = samples(target=pose + only(2, WAY), position=pose + 0.01 + only(moved, by * WAY))
        assert list(follow(case_of(go1, made, 2))) == says

    def test_of_two_joints_that_move_the_one_that_shall_is_not_taken_for_the_other(self, go1: Robot) -> None:
        made = samples(target=only(2, WAY), position=only(2, 1.5 * WAY) + only(5, 0.5 * WAY))
        assert list(follow(case_of(go1, made, 2))) == [
            "joint 2 covers 150% of its travel: its gear ratio is wrong",
            "joint 5 moves by 0.07 rad, but should not",
        ]

    def test_no_joint_shakes(self, go1: Robot) -> None:
        """20 Hz of 1 rad/s is 0.71 rad/s, root mean square; a slow swing of 1 rad/s is none."""
        shaking, swing = np.sin(2 * np.pi * 20 * TIME_S), np.sin(2 * np.pi * 0.5 * TIME_S)
        says = list(calm(case_of(go1, samples(velocity=only(4, shaking)))))
        assert says == ["joint 4 shakes with 0.7 rad/s: lower its gains"]
        assert list(calm(case_of(go1, samples(velocity=only(4, swing))))) == []

    def test_no_motor_works_too_hard_or_is_hot(self, go1: Robot) -> None:
        for torque in (only(3, np.full(101, side * 0.7 * 23.7)) for side in (1.0, -1.0)):
            found = list(modest(case_of(go1, samples(torque=torque))))
            assert found == ["joint 3 needs 70% of its peak torque"]
        hot = samples(temperature_c=only(3, np.full(101, 71.0)))
        assert list(cool(case_of(go1, hot))) == ["joint 3 is at 71 degrees Celsius"]
        unknown = samples(temperature_c=np.full((101, 12), np.nan))
        assert list(cool(case_of(go1, unknown))) == []

    def test_speeding_up_is_no_shaking_and_a_short_stretch_tells_nothing(self, go1: Robot) -> None:
        """20 rad/s^2 are within 0.1 rad/s of their mean over 0.1 s, in its middle."""
        assert list(calm(case_of(go1, samples(velocity=only(4, 20.0 * TIME_S))))) == []
        made = samples(velocity=only(4, 9.0 * (-1.0) ** np.arange(101)))
        made.time_s, made.velocity = made.time_s[:20], made.velocity[:20]
        assert list(calm(case_of(go1, made))) == []
        made.time_s, made.velocity = TIME_S[:21], np.tile(made.velocity[:7], (3, 1))
        assert list(calm(case_of(go1, made))) != []

    def test_a_spike_of_torque_is_forgiven_and_each_motor_has_its_own_peak(self, go1: Robot) -> None:
        """One sample of a hundred; 15 N m are 63 % of a hip's 23.7 and 42 % of a calf's 35.55."""
        spike = np.where(np.arange(101) == 50, 20.0, 0.0)
        assert list(modest(case_of(go1, samples(torque=only(3, spike))))) == []
        steady = np.full(101, 15.0)
        assert list(modest(case_of(go1, samples(torque=only(5, steady))))) == []
        found = list(modest(case_of(go1, samples(torque=only(5, steady) + only(3, steady)))))
        assert found == ["joint 3 needs 63% of its peak torque"]

    def test_a_short_heat_is_found_although_others_report_none(self, go1: Robot) -> None:
        told = np.full((101, 12), np.nan)
        told[:, 8] = 59.0
        assert list(cool(case_of(go1, samples(temperature_c=told)))) == []
        told[30, 8] = 61.0
        assert list(cool(case_of(go1, samples(temperature_c=told)))) == ["joint 8 is at 61 degrees Celsius"]

    def test_feet_that_push_each_other_carry_no_more(self, go1: Robot) -> None:
        legs, pose = go1.legs, go1.default_pose
        force = np.array([[60.0, 0.0, 0.0], [-60.0, 0.0, 0.0], [0.0, 60.0, 0.0], [0.0, -60.0, 0.0]])
        force[:, 2] = 12.743 * 9.81 / 4
        torque = legs.scatter(legs.torque(legs.pose(pose).jacobian, force), np.zeros(12))
        made = samples(position=np.tile(pose, (101, 1)), torque=np.tile(torque, (101, 1)))
        assert list(carry(case_of(go1, made))) == []

    @pytest.mark.parametrize(("share", "passes"), [(0.28, False), (0.32, True)])
    def test_legs_must_tilt_the_base_by_0_3_of_it(self, go1: Robot, share: float, passes: bool) -> None:
        way = np.array([swaying(go1, 0.08, 1.0)(min(t, 0.999)) for t in TIME_S])
        tilt, zero = share * 0.08 * np.sin(np.pi * TIME_S) ** 2, np.zeros(101)
        up = np.stack([zero, np.sin(tilt), np.cos(tilt)], axis=1)
        pose = go1.default_pose
        made = samples(target=pose + way, position=pose + share * way, up=up)
        assert (list(sway(case_of(go1, made, sways="roll"))) == []) is passes

    @pytest.mark.parametrize(
        ("up", "says"),
        [
            ((-np.sin(0.2), 0.0), "pitch is +0.20"),  # front down: what is up points to its back
            ((np.sin(0.2), 0.0), "pitch is -0.20"),
            ((0.0, np.sin(0.2)), "roll is +0.20"),  # right side down: to its left
            ((0.0, -np.sin(0.2)), "roll is -0.20"),
        ],
    )
    def test_the_base_is_level(self, go1: Robot, up: tuple[float, float], says: str) -> None:
        leaning = np.tile([*up, np.cos(0.2)], (101, 1))
        found = list(level(case_of(go1, samples(up=leaning))))
        assert found == [f"the base's {says} rad: a joint's zero or the IMU's mounting is wrong"]
        assert list(level(case_of(go1, samples()))) == []

    @pytest.mark.parametrize(("tilt", "passes"), [(0.3, True), (0.4, False)])
    def test_on_uneven_ground_the_base_may_tilt_so_far(self, go1: Robot, tilt: float, passes: bool) -> None:
        """For a moment, forwards and to the side at once."""
        up = np.tile([0.0, 0.0, 1.0], (101, 1))
        up[50] = *(np.sin(tilt) * np.array([0.6, -0.8])), np.cos(tilt)
        assert (list(upright(case_of(go1, samples(up=up)))) == []) is passes

    def test_torques_that_hold_the_weight_carry_it(self, go1: Robot) -> None:
        """An even share of 12.743 kg on each leg, by -J^T f; then of half of it; then on three legs."""
        legs, pose = go1.legs, np.tile(go1.default_pose, (101, 1))
        force = np.tile([0.0, 0.0, 12.743 * 9.81 / 4], (4, 1))

        def told(forces: np.ndarray) -> list[str]:
            torque = legs.scatter(legs.torque(legs.pose(go1.default_pose).jacobian, forces), np.zeros(12))
            made = samples(position=pose, torque=np.tile(torque, (101, 1)))
            return list(carry(case_of(go1, made)))

        assert told(force) == []
        assert told(0.5 * force) == ["according to their torques, the legs carry 50% of the robot's weight"]
        assert told(2.0 * force) == ["according to their torques, the legs carry 200% of the robot's weight"]
        assert told(force * [[1.3], [1.3], [1.3], [0.1]]) == [
            "leg RL carries 3 N of 125: a zero, a ratio or a sign is wrong"
        ]

    @pytest.mark.parametrize("by_rad", [0.08, -0.08])
    @pytest.mark.parametrize(("sways", "begin_s"), [("roll", 0.0), ("pitch", 1.0)])
    def test_the_base_tilts_as_joints_do(self, go1: Robot, sways: str, begin_s: float, by_rad: float) -> None:
        """To the right, then to the front, or the reverse. The IMU's constant misalignment has no effect."""
        tilt = by_rad * np.sin(np.pi * TIME_S) ** 2
        way = swaying(go1, by_rad, 1.0)
        position = np.array([go1.default_pose + way(begin_s + min(t, 0.999)) for t in TIME_S])
        zero = np.zeros(101)

        def told(by_imu: np.ndarray) -> list[str]:
            sine, cosine = np.sin(by_imu), np.cos(by_imu)
            up = np.stack([zero, sine, cosine] if sways == "roll" else [-sine, zero, cosine], axis=1)
            return list(sway(case_of(go1, samples(target=position, position=position, up=up), sways=sways)))

        assert told(tilt) == told(tilt + 0.05) == []
        assert f"the base's {sways} by the IMU is 50% of that by the joints" in told(tilt / 2)[0]
        assert f"the base's {sways} by the IMU is -100% of that by the joints" in told(-tilt)[0]
        weak = samples(target=position, position=np.tile(go1.default_pose, (101, 1)))
        assert list(sway(case_of(go1, weak, sways=sways))) == [
            "the legs do not tilt the base: check gains and torques"
        ]


class TestMotions:
    def test_joints_move_in_turn_and_come_back(self, go1: Robot) -> None:
        way = one_after_the_other(go1, [np.array([0]), np.array([1, 2])], 0.1, 1.0)
        assert np.flatnonzero(way(0.5)).tolist() == [0]
        assert np.flatnonzero(way(1.5)).tolist() == [1, 2]
        assert np.abs(way(1.5)).max() == pytest.approx(0.1)
        for time_s in (0.0, 1.0, 2.0, 9.0):
            np.testing.assert_allclose(way(time_s), 0.0, atol=1e-12)

    def test_each_joint_moves_towards_the_middle_of_its_range(self, go1: Robot) -> None:
        """Half of the way after a quarter of the time, all of it after half."""
        lower, upper = go1.soft_limits
        way = one_after_the_other(go1, [np.arange(12)], 0.1, 2.0)
        middle = np.where(go1.default_pose < 0.5 * (lower + upper), 1.0, -1.0)
        assert {-1.0, 1.0} == set(middle)
        np.testing.assert_allclose(way(0.5), 0.05 * middle)
        np.testing.assert_allclose(way(1.0), 0.1 * middle)
        np.testing.assert_allclose(way(1.5), 0.05 * middle)

    @pytest.mark.parametrize("stands", [False, True])
    def test_the_pose_found_or_the_default_one_is_the_centre(self, go1: Robot, stands: bool) -> None:
        kp, kd, found = np.full(12, 10.0), np.full(12, 1.0), go1.default_pose + 0.2
        way = lambda time_s: np.full(12, 3.0 * time_s)  # noqa: E731
        policy = StandingTrajectoryPolicy(go1, way, kp, kd) if stands else TrajectoryPolicy(way, kp, kd)
        for pose in (found, found + 0.5):  # the first one is kept
            sensed = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), pose, *np.zeros((2, 12)))
            inputs = PolicyInput(0.1, sensed, np.zeros(3), np.zeros(3), 0.3)
            if pose is found:
                policy.reset(inputs)
            decided = policy.act(inputs)
            np.testing.assert_allclose(decided.position, (go1.default_pose if stands else found) + 0.3)
        assert not np.any([decided.velocity, decided.torque])
        assert (decided.kp is kp, decided.kd is kd) == (True, True)
        assert policy.stance() is None

    def test_a_policy_is_slewed_in_over_standing(self, go1: Robot) -> None:
        hold, gains = Hold(go1), (np.full(12, 10.0), np.full(12, 1.0))
        policy = SlewedIn(hold, go1, 2.0, *gains)
        sensed = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))
        kp = [policy.act(PolicyInput(t, sensed, np.zeros(3), np.zeros(3), 0.3)).kp for t in (0.0, 1.0, 3.0)]
        np.testing.assert_allclose(kp[0], 10.0)
        np.testing.assert_allclose(kp[1], (10.0 + 4 * go1.kp) / 2)
        np.testing.assert_allclose(kp[2], 4 * go1.kp)


class Heard:
    """The parts of a loop that are recorded and judged."""

    def __init__(self) -> None:
        self.walking, self.walking_s, self.ended = True, 0.0, []  # type: ignore[var-annotated]
        self.target, self.temperature_c = np.zeros(12), np.full(12, 30.0)
        self.sensed = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))

    def finish(self, skip_lie_down: bool = False) -> None:
        self.ended.append(skip_lie_down)


class TestRecording:
    def test_each_sample_is_what_the_loop_said_then(self) -> None:
        """Turned by 0.2 rad to its right; 0 to 0.3 s, of which 0.1 and 0.2 are looked at."""
        loop, recording = Heard(), Recording()
        for tick in range(4):
            loop.walking_s, loop.target, loop.temperature_c = 0.1 * tick, np.full(12, 1.0), np.full(12, 5.0)
            loop.sensed = loop.sensed._replace(
                joint_position=np.full(12, 2.0 + tick),
                joint_velocity=np.full(12, 3.0),
                joint_torque=np.full(12, 4.0),
                quaternion=np.array([np.cos(0.1), np.sin(0.1), 0.0, 0.0]),
            )
            recording.add(loop)  # type: ignore[arg-type]
        found = recording.between(0.05, 0.25)
        np.testing.assert_allclose(found.time_s, [0.1, 0.2])
        np.testing.assert_allclose(found.position[:, 7], [3.0, 4.0])
        rest = [found.target, found.velocity, found.torque, found.temperature_c]
        assert [float(values[0, 7]) for values in rest] == [1.0, 3.0, 4.0, 5.0]
        np.testing.assert_allclose([found.roll, found.pitch], [[0.2, 0.2], [0.0, 0.0]], atol=1e-12)


def no_plan(_: Setting) -> Plan:
    raise AssertionError("a step that is only judged needs no plan")


class TestJudge:
    def judged(self, go1: Robot, step: Step, *windows: Window) -> _Judge:
        setting = Setting(go1, Hold(go1), stand_still, CONFIG, LOOP)
        return _Judge(setting, step, Plan(Hold(go1), list(windows)))

    def test_each_window_is_judged_once_as_it_ends_by_its_own_samples(self, go1: Robot) -> None:
        """Every other tick of 10 ms is looked at, from 10 ms on; nothing before the robot walks."""
        seen: list[tuple[float, list[float]]] = []

        def note(case: Case) -> Iterator[str]:
            seen.append((case.window.end_s, case.samples.time_s.tolist()))
            yield from ()

        step = Step("x", False, "", no_plan, (note,))
        judge, loop = self.judged(go1, step, Window(0.0, 0.1), Window(0.1, 0.2)), Heard()
        loop.walking = False
        for _ in range(10):
            judge.tick(loop)  # type: ignore[arg-type]
        loop.walking = True
        for tick in range(21):
            loop.walking_s = 0.01 * tick
            judge.tick(loop)  # type: ignore[arg-type]
        assert not judge.verdict(RESULT).passed
        loop.walking_s = 0.21
        judge.tick(loop)  # type: ignore[arg-type]
        assert judge.verdict(RESULT).passed
        assert [end_s for end_s, _ in seen] == [0.1, 0.2]
        np.testing.assert_allclose([times for _, times in seen], 0.01 * np.arange(1, 21, 2).reshape(2, 5))
        assert loop.ended == []

    @pytest.mark.parametrize(
        ("hangs", "off_rad", "lost"), [(True, 0.51, 1), (True, 0.49, 0), (False, 0.51, 0)]
    )
    def test_a_lost_joint_ends_its_step(self, go1: Robot, hangs: bool, off_rad: float, lost: int) -> None:
        step = Step("x", hangs, "", no_plan, ())
        for side in (-1.0, 1.0):
            judge, loop = self.judged(go1, step, Window(0.0, 9.0)), Heard()
            loop.target[4] = side * off_rad
            judge.tick(loop)  # type: ignore[arg-type]
            judge.tick(loop)  # type: ignore[arg-type]
            assert loop.ended == [True] * lost
            assert len(judge.findings) == lost
            assert all(
                each.startswith("FL_thigh_joint (can1, id 2) is 0.51 rad away") for each in judge.findings
            )

    def test_what_the_supervisor_found_comes_first_and_an_early_end_is_no_pass(self, go1: Robot) -> None:
        step = Step("x", False, "", no_plan, ())
        judge = self.judged(go1, step, Window(0.0, 9.0))
        assert judge.verdict(RESULT).findings == ("it ended early",)
        judge.findings.append("it leans")
        fallen = replace(RESULT, faults=("it fell",))
        verdict = judge.verdict(fallen)
        assert (verdict.step, verdict.findings, verdict.passed) == ("x", ("it fell", "it leans"), False)


def test_a_scale_lowers_gains_and_torque_and_leaves_damping_whole(go1: Robot) -> None:
    """At rest at zero: half the gains, and half the peak torque of 23.7 and 35.55 N m at most."""
    driver = open_driver(wire(go1))
    full, half = (JointLayer(go1, driver, ImuReader(0), 1.0, scale) for scale in (1.0, 0.5))
    wanted = np.zeros((5, 12))
    wanted[0], wanted[2], wanted[4] = 1.0, 1.0, 2.0
    for layer in (full, half):
        layer.command(wanted)
    np.testing.assert_allclose(half.sent[2], 0.5 * full.sent[2])
    np.testing.assert_allclose(half.sent[4], 0.5 * full.sent[4])  # what a gait feeds forward, too
    wanted = wanted.copy()
    wanted[0], wanted[2], wanted[4] = go1.soft_limits[1], 400.0, 0.0
    half.command(wanted)
    torque = half.sent[2] * half.sent[0]
    assert (np.abs(torque) <= 0.5 * go1.motor.peak_torque + 1e-9).all()
    half.damping(3.0)
    assert (half.sent[3] == 3.0).all()


def injected(robot: Robot, hangs: bool) -> Injected:
    return Injected(robot, Hold(robot), PlantConfig(lying=not hangs, hanging=hangs))


def verdict_of(robot: Robot, name: str, inject: Injection | None = None) -> Verdict:
    """One step, and the motors are off afterwards."""
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
    """The first joint's readings are half as much again as what they are about the pose at first."""
    injector.joint, first = 0, injector.robot.default_pose[0]

    def change(values: np.ndarray, _: np.ndarray) -> None:
        values[0, 0] = first + 1.5 * (values[0, 0] - first)
        values[1, 0] *= 1.5

    injector.on_values(change)


class TestLadder:
    @pytest.mark.parametrize("step", ["hold", "shift", "walk"])
    def test_a_sound_robot_passes(self, go1: Robot, step: str) -> None:
        verdict = verdict_of(go1, step)
        assert verdict.findings == ()
        assert verdict.outcome.final_state == "IDLE"

    @pytest.mark.parametrize(
        ("step", "inject", "says"),
        [
            ("hold", FAULTS["motor pulls the other way"], "pulls the other way"),
            ("hold", FAULTS["ids of two motors swapped"], "outside its range"),
            ("hold", no_power, "no torque"),
            ("hold", FAULTS["motor at 90 degrees Celsius"], "90 degrees Celsius"),
            ("joints", wrong_ratio, "its gear ratio is wrong"),
            ("stand", FAULTS["one encoder off by a turn of the rotor"], ""),
        ],
        ids=["sign", "swapped", "no power", "hot", "ratio", "zero"],
    )
    def test_the_first_able_step_finds_it(self, go1: Robot, step: str, inject: Injection, says: str) -> None:
        before = {"joints": ["hold"], "stand": ["hold"]}.get(step, [])
        for earlier in before:
            assert verdict_of(go1, earlier, inject).passed
        verdict = verdict_of(go1, step, inject)
        assert not verdict.passed
        assert says in " ".join(verdict.findings)
        if step == "joints":
            assert verdict.outcome.walked_s < 1.5 * CONFIG.move_s  # no other joint had to move

    def test_a_robot_in_a_frame_holds_the_pose_in_which_it_is_found(self, go1: Robot) -> None:
        simulated = injected(go1, hangs=True)
        found = simulated.body.data.qpos[7:] = go1.default_pose + np.tile([0.0, 0.3, -0.3], 4)
        setting = Setting(go1, Hold(go1), stand_still, CONFIG, LOOP, realtime=False)
        assert run_step(STEPS[0], setting, simulated.bus).passed
        np.testing.assert_allclose(
            simulated.body.truth().joint_position, found, atol=0.15
        )  # it sags while it is damped


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def test_the_defaults_and_the_page_agree(tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs/bring_up.md").read_text(encoding="utf-8")
    path = tmp_path / "limits.yaml"
    path.write_text(page.partition("```yaml")[2].partition("```")[0])
    assert load(path, BringUpConfig) == BringUpConfig()


class TestCommand:
    def test_steps_are_told_one_by_one(self, shell: Shell, tmp_path: Path) -> None:
        (tmp_path / "quick.yaml").write_text("hold_s: 0.5")
        done = shell("bring-up", "stand", "--steps", "hold", "--limits", str(tmp_path / "quick.yaml"))
        assert done.status == 0
        assert done.out == "hold: the joints hold their initial pose: passed\n"

    def test_a_simulated_robots_motors_wait_for_as_long_as_the_loop_believes(
        self, shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        made: list[PlantConfig] = []

        def simulated(robot: Robot, wiring: Wiring, wires: SimulatedWires, config: PlantConfig) -> None:
            made.append(config)

        monkeypatch.setattr("footfall.plant.robot.SimulatedRobot", simulated)
        monkeypatch.setattr("footfall.plant.bus.SimulatedBus", lambda wires, robot: None)
        monkeypatch.setattr(
            "footfall.deploy.bring_up.steps.run_step", lambda step, *_: Verdict(step.name, (), RESULT)
        )
        (tmp_path / "loop.yaml").write_text("motor_timeout_s: 0.5")
        options = ("--steps", "hold,stand", "--config", str(tmp_path / "loop.yaml"))
        assert shell("bring-up", "stand", *options).status == 0
        assert made == [
            PlantConfig(motor_timeout_s=0.5, hanging=True, let_go_after_s=5.0),
            PlantConfig(motor_timeout_s=0.5, lying=True, let_go_after_s=5.0),
        ]

    def test_the_last_steps_ground_is_uneven(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        grounds: list[Ground | None] = []
        monkeypatch.setattr("footfall.plant.robot.SimulatedRobot", lambda *a: grounds.append(a[3].ground))
        monkeypatch.setattr("footfall.plant.bus.SimulatedBus", lambda wires, robot: None)
        monkeypatch.setattr(
            "footfall.deploy.bring_up.steps.run_step", lambda step, *_: Verdict(step.name, (), RESULT)
        )
        (tmp_path / "limits.yaml").write_text("uneven_m: 0.03")
        options = bring_up.BringUpOptions(steps=("walk", "uneven"), limits=tmp_path / "limits.yaml")
        assert bring_up.bring_up("trot", options=options) == 0
        level_ground, uneven = grounds
        assert level_ground is None
        assert uneven is not None
        middle = uneven.heights.shape[1] // 2
        beside = round(0.4 / uneven.cell_m)
        assert not uneven.heights[0, middle - beside : middle + beside, middle].any()
        assert 0.02 < uneven.heights.max() <= 0.03

    @pytest.fixture
    def settings(self) -> list[Setting]:
        """Arguments of each step."""
        return []

    @pytest.fixture
    def steps_run(self, settings: list[Setting], monkeypatch: pytest.MonkeyPatch) -> list[str]:
        """Steps that were run; only `stand` fails."""
        steps_run: list[str] = []

        def run_step(step: Step, setting: Setting, bus: str) -> Verdict:
            steps_run.append(step.name)
            settings.append(setting)
            findings = ("the robot is tilted", "a foot hangs") if step.name == "stand" else ()
            return Verdict(step.name, findings, RESULT)

        monkeypatch.setattr(bring_up, "_run_step", run_step)
        return steps_run

    @pytest.mark.parametrize("typed", ["walk,hold,legs", "legs,hold,walk", "hold,walk,hold,legs"])
    def test_steps_come_in_their_own_order_however_they_are_typed(
        self, shell: Shell, steps_run: list[str], typed: str
    ) -> None:
        """The robot does not walk before all other requested steps have passed."""
        assert shell("bring-up", "stand", "--steps", typed).status == 0
        assert steps_run == ["hold", "legs", "walk"]

    def test_the_first_failure_is_the_last(self, shell: Shell, steps_run: list[str], tmp_path: Path) -> None:
        done = shell("bring-up", "stand", "--scale", "0.25", "--json", str(tmp_path / "out.json"))
        assert (done.status, steps_run) == (1, ["hold", "joints", "legs", "wiring", "stand"])
        assert done.out.splitlines()[-3:] == [
            "stand: the robot stands: failed", "  the robot is tilted", "  a foot hangs",
        ]  # fmt: skip
        written = json.loads((tmp_path / "out.json").read_text())
        assert (written["robot"], written["bus"], written["scale"]) == ("go1", "sim", 0.25)
        assert [(step["step"], step["passed"]) for step in written["steps"]] == [
            ("hold", True), ("joints", True), ("legs", True), ("wiring", True), ("stand", False),
        ]  # fmt: skip
        assert written["steps"][-1] == {
            "step": "stand", "passed": False, "findings": ["the robot is tilted", "a foot hangs"],
            "final_state": "IDLE", "run_s": 2.5, "notes": ["a note"],
        }  # fmt: skip

    def test_two_feet_leave_out_what_takes_three(self, shell: Shell, steps_run: list[str]) -> None:
        done = shell("bring-up", "stand", "--robot", "g1", "--steps", "shift,walk")
        assert (done.status, steps_run) == (0, ["walk"])
        assert done.out.splitlines()[0] == "shift: skipped, since it needs 3 feet"

    def test_somebody_agrees_to_each_step_before_it_moves(
        self, shell: Shell, steps_run: list[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[str] = []
        answers = iter(["y", "Yes", ""])
        monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
        monkeypatch.setattr("builtins.input", lambda question: asked.append(question) or next(answers))
        refused = shell("bring-up", "stand", "--bus", "virtual", "--steps", "hold,legs,walk")
        assert (refused.status, refused.err) == (2, "footfall: not confirmed\n")
        assert steps_run == ["hold", "legs"]
        assert [question.partition(". ")[2] for question in asked] == [
            "Does the robot hang in a frame, with its feet in the air? [y/N] ",
            "Does the robot hang in a frame, with its feet in the air? [y/N] ",
            "Does the robot lie or stand on the ground, with nobody within its reach? [y/N] ",
        ]

    @pytest.mark.parametrize(
        ("options", "says"),
        [
            (
                ["--steps", "jump"],
                "no step 'jump': there are hold, joints, legs, wiring, stand, shift, walk, uneven",
            ),
            (["--scale", "2"], "--scale"),
            (["--bus", "virtual"], "no terminal for the confirmation: add --yes"),
        ],
    )
    def test_what_cannot_be_is_refused_in_one_line(self, shell: Shell, options: list[str], says: str) -> None:
        refused = shell("bring-up", "stand", *options)
        assert refused.status == 2
        assert says in refused.err
