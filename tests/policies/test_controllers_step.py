"""Targets of `Step` at single times, calculated by hand, for feet rotated relative to the world's axes."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moments import policy_input, whole_body_arguments
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.step import Step
from footfall.policies.controllers.step import controller as controller_module
from footfall.policies.controllers.step.config import Pressure, Start, StepConfig
from footfall.policies.controllers.step.footsteps import capture_after, nominal_step
from footfall.policies.controllers.step.footwork import Footwork, Phase
from footfall.policies.controllers.whole_body.feedback import Feedback
from footfall.policies.policy import PolicyInput
from footfall.robots.description import load_robot

G1 = load_robot("g1")
N = len(G1.joint_names)
LEFT, RIGHT = 0, 1
OWN = controller_settings(G1, "step", StepConfig)
CONFIG = replace(
    OWN,
    gait=replace(OWN.gait, step_s=0.6, double_support_s=0.1, apart_m=0.2),
    swing=replace(OWN.swing, place=Feedback(400.0, 30.0), attitude=Feedback(300.0, 20.0)),
    pressure=Pressure(gain=2.0, half_length_m=0.075, half_width_m=0.025, max_lead_m=0.2),
    start=Start(capture_m=0.07, near_m=0.02, max_s=1.0, urgent_m=0.12),
    lower_m=0.06,
    height=Feedback(60.0, 15.0),
    attitude=Feedback(100.0, 20.0),
    posture=Feedback(40.0, 12.0),
    momentum_damping=2.0,
    max_force=1.2,
    settle_s=0.5,
)
HEADING = 0.7  # of the feet, in the world
TURN = Rotation.from_euler("z", HEADING)
MIDDLE = np.array([1.0, -2.0, 0.3])
STILL = np.zeros(3)


@pytest.fixture
def policy() -> Step:
    return Step(G1, CONFIG)


@pytest.fixture
def footwork(policy: Step) -> Footwork:
    return policy.footwork


def world(ahead: float, left: float, heading: float = HEADING) -> np.ndarray:
    """A horizontal vector (2,) rotated from the axes of feet with this heading to the world's."""
    return Rotation.from_euler("z", heading).apply([ahead, left, 0.0])[:2]


class Moment(SimpleNamespace):
    """Dynamics given by hand; replaces fields like a named tuple."""

    def _replace(self, **changes: Any) -> "Moment":
        return Moment(**{**vars(self), **changes})


def moment(
    centre: Any = (0.0, 0.0, 0.6),
    moving: Any = STILL,
    feet: Any = ((0.0, 0.1), (0.0, -0.1)),
    headings: tuple[float, float] = (HEADING, HEADING),
) -> Any:
    """Dynamics by hand: centre and feet from the middle along the feet's axes, the velocity in the world."""
    foot = np.array([[*world(*each), 0.0] for each in feet]) + MIDDLE
    return Moment(
        bias=np.zeros(6 + N),
        foot_jacobian=np.zeros((2, 6, 6 + N)),
        centre=TURN.apply(centre) + MIDDLE,
        centre_velocity=np.array(moving, dtype=float),
        middle=foot.mean(axis=0),
        foot=foot,
        foot_rotation=Rotation.from_rotvec([[0.0, 0.0, each] for each in headings]).as_matrix(),
        angular_momentum=np.array([1.0, -2.0, 3.0]),
    )


def capture_at(ahead: float, left: float) -> np.ndarray:
    """A capture point (3,) in the world at an offset from the middle, along the feet's axes."""
    return np.array([*world(ahead, left), 0.0]) + MIDDLE


def seen(time_s: float = 9.0, command: Any = STILL, **more: Any) -> PolicyInput:
    return policy_input(G1, time_s, command, base_height=0.7, **more)


def desired_by(policy: Step, monkeypatch: pytest.MonkeyPatch, inputs: PolicyInput, dynamics: Any) -> tuple:
    """Arguments of whole-body control with dynamics by hand."""
    monkeypatch.setattr(controller_module, "estimated_dynamics", lambda body, given: dynamics)
    return whole_body_arguments(policy, monkeypatch, inputs)


class TestDesired:
    """A robot that stands on both feet."""

    def test_tilt_and_joints_are_brought_back(self, policy: Step, monkeypatch: pytest.MonkeyPatch) -> None:
        off, velocity = np.linspace(0.01, 0.2, N), np.linspace(-0.1, 0.3, N)
        tilted = seen(
            joint=G1.default_pose + off,
            velocity=velocity,
            gyro=(0.1, 0.2, -0.3),
            turn=Rotation.from_euler("ZYX", [HEADING, -0.03, 0.02]),
        )
        _, position, moved, desired, _ = desired_by(policy, monkeypatch, tilted, moment())
        np.testing.assert_allclose(desired.joints, -40.0 * off - 12.0 * velocity)
        np.testing.assert_allclose(desired.attitude, [-2.0 - 2.0, 3.0 - 4.0, 6.0], atol=0.1)
        np.testing.assert_array_equal(position, G1.default_pose + off)
        np.testing.assert_array_equal(moved, velocity)

    def test_height_is_measured_from_the_bearing_foot(
        self, policy: Step, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The other foot is 0.1 m higher."""
        policy.footwork.load = np.array([1.0, 0.0])
        lifted = moment((0.0, 0.0, policy.com_height_m))
        lifted.foot[RIGHT, 2] += 0.1
        *_, desired, _ = desired_by(policy, monkeypatch, seen(), lifted)
        assert desired.centre[2] == pytest.approx(0.0, abs=1e-9)

    def test_commands_before_settling_are_ignored(
        self, policy: Step, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        desired_by(policy, monkeypatch, seen(0.49, (0.3, 0.0, 0.0)), moment())
        assert not policy.footwork.command.value.any()
        assert policy.footwork.phase is Phase.STAND
        desired_by(policy, monkeypatch, seen(0.5, (0.3, 0.0, 0.0)), moment())
        assert policy.footwork.command.value[0] == pytest.approx(0.3 / 500)
        assert policy.footwork.phase is Phase.SHIFT

    def test_the_pressure_stays_within_its_limit_from_the_middle(self, policy: Step) -> None:
        """Three times (0.09, 0.12) m would be 0.45 m, so the pressure is 0.2 m in that direction."""
        found = policy.footwork.double_support_pressure(moment(), capture_at(0.09, 0.12), MIDDLE[:2])
        np.testing.assert_allclose(found, MIDDLE[:2] + world(0.12, 0.16))


def test_a_command_or_a_capture_point_far_from_the_middle_calls_for_a_step() -> None:
    """The weight moves onto the foot that the body leans on."""
    for capture, walk, bears in (
        ((0.055, 0.04), False, None),  # 6.8 cm
        ((0.06, 0.04), False, LEFT),  # 7.2 cm
        ((-0.06, -0.04), False, RIGHT),
        ((0.0, 0.001), True, LEFT),
        ((0.0, -0.001), True, RIGHT),
    ):
        footwork = Step(G1, CONFIG).footwork
        footwork.elapsed_s = 0.3
        footwork.maybe_shift(moment(), capture_at(*capture), walk)
        if bears is None:
            assert footwork.phase is Phase.STAND
            continue
        assert (footwork.phase, footwork.stance_foot, footwork.swing_foot) == (Phase.SHIFT, bears, 1 - bears)
        assert footwork.elapsed_s == 0.0


@pytest.mark.parametrize("bears", [LEFT, RIGHT])
def test_a_foot_is_lifted_once_the_weight_is_near_the_other_or_it_is_urgent(
    footwork: Footwork, bears: int
) -> None:
    """The cases are distances of the capture point from the bearing foot's side, and ahead of it."""
    for short, ahead, elapsed_s, lifts in (
        (0.019, 0.0, 0.5, True),
        (0.021, 0.0, 0.5, False),
        (-0.2, 0.0, 0.5, True),  # beyond
        (0.1, 0.0, 1.01, True),  # it has waited long enough
        (0.1, 0.0, 0.99, False),
        (0.1, 0.13, 0.5, True),
        (0.1, -0.13, 0.5, True),
        (0.1, 0.11, 0.5, False),
    ):
        footwork.phase, footwork.stance_foot, footwork.swing_foot = Phase.SHIFT, bears, 1 - bears
        footwork.elapsed_s = elapsed_s
        capture = np.zeros(3)
        inwards = -short if bears == LEFT else short
        capture[:2] = footwork.shift_goal(moment()) + world(ahead, inwards)
        footwork.maybe_lift(moment(), capture)
        assert footwork.phase is (Phase.STEP if lifts else Phase.SHIFT)


def test_a_landing_ends_the_walk_or_begins_the_next_step() -> None:
    """The cases are capture points and feet's positions ahead, along the axes of the foot that has landed."""
    for centre, ahead, walk, stands in (
        ((0.0, 0.0), (0.0, 0.0), False, True),
        ((0.0, 0.0), (0.0, 0.0), True, False),
        ((0.069, 0.0), (0.0, 0.0), False, True),
        ((0.071, 0.0), (0.0, 0.0), False, False),
        ((-0.071, 0.0), (0.0, 0.0), False, False),
        ((0.0, 0.2), (0.0, 0.0), False, True),  # a sideways distance does not count
        ((0.0, 0.0), (0.009, -0.01), False, True),
        ((0.0, 0.0), (0.011, -0.01), False, False),
        ((0.0, 0.0), (-0.011, 0.01), False, False),
    ):
        footwork = Step(G1, CONFIG).footwork
        footwork.stance_foot, footwork.swing_foot, footwork.elapsed_s = LEFT, RIGHT, 0.6
        footwork.load = np.array([1.0, 0.0])
        # Half of the offset is from the velocity.
        velocity = 0.5 * footwork.fall_rate * np.array([*world(*centre), 0.0])
        feet = (ahead[0], 0.1), (ahead[1], -0.1)
        dynamics = moment((0.5 * centre[0], 0.5 * centre[1], 0.6), velocity, feet, (2.5, HEADING))
        footwork.land(dynamics, walk)
        assert (footwork.stance_foot, footwork.swing_foot) == (RIGHT, LEFT)
        assert footwork.elapsed_s == 0.0
        assert footwork.phase is (Phase.STAND if stands else Phase.STEP)
        assert footwork.steps == (0 if stands else 1)
        assert footwork.load.tolist() == ([1.0, 1.0] if stands else [1.0, 0.0])


def test_a_pressure_under_the_sole_removes_the_error_until_landing(footwork: Footwork) -> None:
    """The pressure is (1 + 2) times the distance of the capture point, but within the sole."""
    rate = footwork.fall_rate
    step = nominal_step(np.zeros(2), -1.0, 0.2, 0.6, 0.1, rate)
    end = step.foothold + step.offset
    steady = end * math.exp(-0.3 * rate)
    capture = steady + np.array([0.004, -0.003])
    now, held = footwork.steering_pressure(capture, step, 0.3)
    np.testing.assert_allclose(now, [0.012, -0.009])
    np.testing.assert_allclose(capture_after(capture, held, np.zeros(2), 0.3, rate), end, atol=1e-12)
    for sign in (1.0, -1.0):
        for found in footwork.steering_pressure(steady + sign * np.array([0.3, 0.2]), step, 0.3):
            np.testing.assert_allclose(found, sign * np.array([0.075, 0.025]))


def test_the_yaw_of_a_swinging_foot_takes_the_shorter_rotation(footwork: Footwork) -> None:
    """A foot at -3.1 rad lands at 3.1 rad by turning right by 0.083 rad."""
    footwork.stance_foot, footwork.swing_foot, footwork.yaw = LEFT, RIGHT, 3.1
    footwork.next_foothold = np.array([0.2, -0.25])
    dynamics = SimpleNamespace(
        foot=np.array([MIDDLE, MIDDLE + np.array([0.05, -0.2, 0.04])]),
        foot_rotation=Rotation.from_rotvec([[0.0, 0.0, each] for each in (0.0, -3.1)]).as_matrix(),
        foot_jacobian=np.zeros((2, 6, 6)),
        velocity=np.zeros(6),
    )
    footwork.swing_acceleration(dynamics, MIDDLE, 0.3)  # type: ignore[arg-type]
    assert footwork.swing is not None
    turned = 60 * (6.2 - 2 * math.pi) / 0.3**3 * 0.002
    assert footwork.swing._motion[2, 2] == pytest.approx(turned)
