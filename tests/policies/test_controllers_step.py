"""Stepping on soles: targets at single times by hand, footsteps against brute force, and walks on a plant."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from moments import policy_input, whole_body_arguments
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from footfall import PolicyInput, UserError, load_robot
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.step import Step
from footfall.policies.controllers.step import controller as controller_module
from footfall.policies.controllers.step.centre_offset import CentreOffset, centre_of_pressure
from footfall.policies.controllers.step.config import Pressure, Start, StepConfig
from footfall.policies.controllers.step.footsteps import (
    NextStep,
    StepLimits,
    StepWeights,
    capture_after,
    next_step,
    nominal_step,
)
from footfall.policies.controllers.step.footwork import Footwork, Phase
from footfall.policies.controllers.step.swing import Swing
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import Feedback, rest_dynamics

G1 = load_robot("g1")
N, LEFT, RIGHT = len(G1.joint_names), 0, 1
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
MIDDLE, STILL = np.array([1.0, -2.0, 0.3]), np.zeros(3)
BODY = Step(G1).control.body
REST = rest_dynamics(BODY, G1)


@pytest.fixture
def policy() -> Step:
    return Step(G1, CONFIG)


@pytest.fixture
def footwork(policy: Step) -> Footwork:
    return policy.footwork


def world(ahead: float, left: float) -> np.ndarray:
    """A horizontal vector (2,) rotated from the axes of the feet to the world's."""
    return Rotation.from_euler("z", HEADING).apply([ahead, left, 0.0])[:2]


def moment(
    centre: Any = (0.0, 0.0, 0.6),
    velocity: Any = STILL,
    feet: Any = ((0.0, 0.1), (0.0, -0.1)),
    headings: tuple[float, float] = (HEADING, HEADING),
) -> Dynamics:
    """Dynamics by hand: centre and feet from the middle along the feet's axes, the velocity in the world."""
    foot = np.array([[*world(*each), 0.0] for each in feet]) + MIDDLE
    return REST._replace(
        bias=np.zeros(6 + N),
        foot_jacobian=np.zeros((2, 6, 6 + N)),
        centre=np.array([*world(*centre[:2]), centre[2]]) + MIDDLE,
        centre_velocity=np.array(velocity, dtype=float),
        feet_middle=foot.mean(axis=0),
        foot=foot,
        foot_rotation=Rotation.from_euler("z", np.vstack(headings)).as_matrix(),
        angular_momentum=np.array([1.0, -2.0, 3.0]),
    )


def capture_at(ahead: float, left: float) -> np.ndarray:
    """A capture point (3,) in the world at an offset from the middle, along the feet's axes."""
    return np.array([*world(ahead, left), 0.0]) + MIDDLE


def seen(time_s: float = 9.0, command: Any = STILL, **more: Any) -> PolicyInput:
    return policy_input(G1, time_s, command, base_height=0.7, **more)


def desired_by(
    policy: Step, monkeypatch: pytest.MonkeyPatch, inputs: PolicyInput, by_hand: Dynamics
) -> tuple:
    """Arguments of whole-body control with dynamics by hand."""
    monkeypatch.setattr(controller_module, "estimated_dynamics", lambda body, given: by_hand)
    return whole_body_arguments(policy, monkeypatch, inputs)


def test_tilt_and_joints_are_brought_back(policy: Step, monkeypatch: pytest.MonkeyPatch) -> None:
    off, velocity = np.linspace(0.01, 0.2, N), np.linspace(-0.1, 0.3, N)
    joint, turn = G1.default_pose + off, Rotation.from_euler("ZYX", [HEADING, -0.03, 0.02])
    tilted = seen(joint=joint, velocity=velocity, gyro=(0.1, 0.2, -0.3), turn=turn)
    _, position, moved, desired, _ = desired_by(policy, monkeypatch, tilted, moment())
    np.testing.assert_allclose(desired.joints, -40.0 * off - 12.0 * velocity)
    np.testing.assert_allclose(desired.attitude, [-2.0 - 2.0, 3.0 - 4.0, 6.0], atol=0.1)
    np.testing.assert_array_equal([position, moved], [joint, velocity])


def test_height_is_measured_from_the_bearing_foot(policy: Step, monkeypatch: pytest.MonkeyPatch) -> None:
    """The other foot is 0.1 m higher."""
    policy.footwork.load = np.array([1.0, 0.0])
    lifted = moment((0.0, 0.0, policy.com_height_m))
    lifted.foot[RIGHT, 2] += 0.1
    *_, desired, _ = desired_by(policy, monkeypatch, seen(), lifted)
    assert desired.centre[2] == pytest.approx(0.0, abs=1e-9)


def test_commands_before_settling_are_ignored(policy: Step, monkeypatch: pytest.MonkeyPatch) -> None:
    for time_s, speed, phase in ((0.49, 0.0, Phase.STAND), (0.5, 0.3 / 500, Phase.SHIFT)):
        desired_by(policy, monkeypatch, seen(time_s, (0.3, 0.0, 0.0)), moment())
        np.testing.assert_allclose(policy.footwork.command.value, [speed, 0.0, 0.0])
        assert policy.footwork.phase is phase


def test_the_pressure_stays_within_its_limit_from_the_middle(footwork: Footwork) -> None:
    """Three times (0.09, 0.12) m would be 0.45 m, so the pressure is 0.2 m in that direction."""
    found = footwork.double_support_pressure(moment(), capture_at(0.09, 0.12), MIDDLE[:2])
    np.testing.assert_allclose(found, MIDDLE[:2] + world(0.12, 0.16))


def test_a_command_or_a_capture_point_far_from_the_middle_calls_for_a_step() -> None:
    """The weight moves onto the foot that the body leans on."""
    for capture, walks, phase, bears in (
        ((0.055, 0.04), False, Phase.STAND, LEFT),  # 6.8 cm
        ((0.06, 0.04), False, Phase.SHIFT, LEFT),  # 7.2 cm
        ((-0.06, -0.04), False, Phase.SHIFT, RIGHT),
        ((0.0, 0.001), True, Phase.SHIFT, LEFT),
        ((0.0, -0.001), True, Phase.SHIFT, RIGHT),
    ):
        footwork = Step(G1, CONFIG).footwork
        footwork.elapsed_s = 0.3
        footwork.maybe_shift(moment(), capture_at(*capture), walks)
        assert (footwork.phase, footwork.stance_foot, footwork.swing_foot) == (phase, bears, 1 - bears)
        assert footwork.elapsed_s == (0.3 if phase is Phase.STAND else 0.0)


@pytest.mark.parametrize("bears", [LEFT, RIGHT])
def test_a_foot_is_lifted_when_the_weight_is_on_the_other_or_it_is_urgent(
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
        footwork.elapsed_s, capture = elapsed_s, np.zeros(3)
        inwards = -short if bears == LEFT else short
        capture[:2] = footwork.shift_goal(moment()) + world(ahead, inwards)
        footwork.maybe_lift(moment(), capture)
        assert footwork.phase is (Phase.STEP if lifts else Phase.SHIFT)


def test_a_landing_ends_the_walk_or_begins_the_next_step() -> None:
    """The cases are capture points and feet's positions ahead, along the axes of the foot that has landed."""
    for centre, ahead, walks, stands in (
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
        footwork.land(moment((0.5 * centre[0], 0.5 * centre[1], 0.6), velocity, feet, (2.5, HEADING)), walks)
        assert (footwork.stance_foot, footwork.swing_foot, footwork.elapsed_s) == (RIGHT, LEFT, 0.0)
        found = footwork.phase, footwork.steps, footwork.load.tolist()
        assert found == ((Phase.STAND, 0, [1.0, 1.0]) if stands else (Phase.STEP, 1, [1.0, 0.0]))


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
    footwork.swing_acceleration(moment(headings=(0.0, -3.1)), MIDDLE, 0.3)
    assert footwork.swing is not None
    turned = 60 * (6.2 - 2 * math.pi) / 0.3**3 * 0.002
    assert footwork.swing._motion[2, 2] == pytest.approx(turned)


RATE = 3.9  # 1/s, of a pendulum 0.645 m high
STEP_S, BOTH_S = 0.7, 0.15
LIMITS = StepLimits((-0.3, 0.4), apart_m=(0.14, 0.35), time_s=(0.4, 0.9), min_swing_s=0.05, speed_m_s=1.5)
WEIGHTS = StepWeights(place=1.0, time=0.02, offset=300.0)


def pendulum(capture: np.ndarray, last: np.ndarray, duration_s: float) -> np.ndarray:
    """The capture point relative to the new foot, by integration.

    The pressure moves there from the last foot.
    """

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return RATE * (x + last * max(0.0, 1.0 - t / BOTH_S))

    return solve_ivp(rate, (0.0, duration_s), capture, rtol=1e-10, atol=1e-12, max_step=0.01).y[:, -1]


def test_the_capture_point_under_a_moving_pressure() -> None:
    begin, last = np.array([0.05, -0.08]), np.array([0.2, 0.18])
    for time_s in (0.04, 0.15):
        ahead = capture_after(begin, -last, last / BOTH_S, time_s, RATE)
        np.testing.assert_allclose(ahead, pendulum(begin, last, time_s), atol=1e-8)


NOMINAL = nominal_step(np.array([0.25, 0.05]), -1.0, 0.22, STEP_S, BOTH_S, RATE)
# The capture point in the steady gait after 0.2 s, with the pressure under the middle of the foot.
STEADY = (NOMINAL.foothold + NOMINAL.offset) * math.exp(-RATE * (STEP_S - 0.2))


def decide(capture: np.ndarray, elapsed_s: float = 0.2, pressure: Any = (0.01, 0.0)) -> NextStep:
    return next_step(capture, np.array(pressure), elapsed_s, 0.1, -1.0, RATE, NOMINAL, LIMITS, WEIGHTS)


def test_an_undisturbed_step_is_the_nominal_step() -> None:
    step = decide(STEADY, pressure=(0.0, 0.0))
    np.testing.assert_allclose(step.foothold, NOMINAL.foothold, atol=1e-6)
    assert step.remaining_s == pytest.approx(STEP_S - 0.2, abs=1e-6)


@pytest.mark.parametrize("push", [(0.03, 0.0), (-0.04, 0.01), (0.0, -0.02), (0.02, 0.015)])
def test_a_disturbed_step_minimises_the_cost(push: tuple[float, float]) -> None:
    capture = STEADY + np.array(push)
    step = decide(capture)
    pressure, growth = np.array([0.01, 0.0]), math.exp(RATE * (STEP_S - 0.2))
    steady = pendulum(NOMINAL.offset, NOMINAL.foothold, BOTH_S)

    def cost(x: np.ndarray) -> float:
        offset = pressure + (capture - pressure) * x[2] - x[:2]
        # The next step begins with the pressure's motion from one foot to the other.
        missed = (pendulum(offset, x[:2], BOTH_S) - steady) * math.exp(-RATE * BOTH_S)
        place = np.sum((x[:2] - NOMINAL.foothold) ** 2)
        return float(place + 0.02 * (x[2] - growth) ** 2 + 300.0 * np.sum(missed**2))

    bounds = [(-0.3, 0.4), (-0.35, -0.14), (math.exp(RATE * 0.2), math.exp(RATE * 0.7))]
    best = minimize(cost, [*NOMINAL.foothold, growth], bounds=bounds, tol=1e-14).x
    np.testing.assert_allclose(step.foothold, best[:2], atol=2e-4)
    assert step.remaining_s == pytest.approx(math.log(best[2]) / RATE, abs=1e-3)


@pytest.mark.parametrize(("push", "left"), [(-0.3, -0.35), (0.3, -0.14)])
def test_the_right_foot_lands_at_its_sideways_limits(push: float, left: float) -> None:
    assert decide(STEADY + np.array([0.0, push])).foothold[1] == pytest.approx(left)


def test_a_capture_point_of_nan_gives_the_nominal_step() -> None:
    for elapsed_s, remaining_s in ((0.2, STEP_S - 0.2), (0.8, 0.1 / 1.5)):
        step = decide(np.array([np.nan, 0.0]), elapsed_s)
        np.testing.assert_array_equal(step.foothold, NOMINAL.foothold)
        assert step.remaining_s == pytest.approx(remaining_s)


def test_rates_of_a_swing_are_derivatives_of_its_positions() -> None:
    goal, swing = np.array([0.25, 0.15, -0.2]), Swing(np.array([-0.1, 0.2]), 0.01, 0.3, 0.06, depth_m=0.005)
    flight = np.array([swing.advance(goal, 0.5 - k * 0.002, 0.002) for k in range(200)])[20:]
    slopes = (flight[2:] - flight[:-2]) / 0.004
    np.testing.assert_allclose(slopes[:, 0], flight[1:-1, 1], atol=0.02)
    np.testing.assert_allclose(slopes[:, 1], flight[1:-1, 2], atol=0.35)


def test_a_goal_that_moves_just_before_the_landing_is_not_followed() -> None:
    swing = Swing(np.array([0.25, 0.15]), 0.0, 0.0, lift_m=0.06, depth_m=0.005)
    moved = swing.advance(np.array([0.26, 0.15, 0.0]), 1e-4, 0.002)
    assert abs(moved[0, 0] - 0.25) < 0.01
    assert abs(moved[2, 0]) < 5000.0


def test_an_accelerating_body_is_not_at_rest_above_its_feet() -> None:
    """The feet push the body forward, so the pressure is 2 cm behind the centre."""
    force, (forward, leftward, _) = 0.5 * BODY.weight_n, REST.centre - REST.feet_middle
    moment = [force * leftward, -force * (forward - 0.02), 0.0]  # of each foot about its middle
    to_joints = REST.foot_jacobian[:, :, 6:].reshape(12, -1).T
    torque = REST.bias[6:] - to_joints @ np.tile([0.0, 0.0, force, *moment], 2)
    found, rate = CentreOffset(BODY.weight_n, 3.9, 500.0), 3.9**2 * 0.02 / 500.0
    for tick in range(500):
        speed = REST.centre_velocity + np.array([rate * tick, 0.0, 0.0])
        found.observe(REST._replace(centre_velocity=speed), torque)
    np.testing.assert_allclose(found.value, 0.0, atol=1e-4)
    assert centre_of_pressure(REST, np.full_like(torque, np.nan)) is None


def test_step_refuses_a_robot_of_four_feet() -> None:
    with pytest.raises(UserError, match="go1"):
        Step(load_robot("go1"), OWN)


def test_a_biped_walks_as_commanded() -> None:
    policy, command = Step(G1), np.array([0.2, 0.0, 0.3])
    result = walk(policy, DirectPlant(G1, seed=2), lambda _: command, 3.7)
    assert (result.fell, policy.control.unsolved_ticks) == (False, 0)
    assert policy.footwork.steps >= 5
    forward, _, yaw_rate = result.mean_velocity(after_s=1.5)
    assert (forward, yaw_rate) == (pytest.approx(0.2, abs=0.06), pytest.approx(0.3, abs=0.08))


def test_after_a_push_a_biped_steps_and_then_stands() -> None:
    policy, push = Step(G1), (0.8, np.array([-0.37, 0.15, 0.0]))
    result = walk(policy, DirectPlant(G1, seed=4), lambda _: STILL, 3.0, BaseEstimator(G1), push)
    assert (result.fell, policy.footwork.phase) == (False, Phase.STAND)
    assert 1 <= policy.footwork.steps <= 4
    assert np.linalg.norm(result.velocity[-1][:2]) < 0.1


def test_after_a_harder_push_a_biped_steps_before_the_weight_has_shifted() -> None:
    policy, push = Step(G1), (0.8, np.array([0.5, 0.0, 0.0]))
    stepped_s: list[float] = []

    def record(time_s: float, _: DirectPlant) -> None:
        if policy.footwork.steps:
            stepped_s.append(time_s)

    assert not walk(policy, DirectPlant(G1, seed=4), lambda _: STILL, 2.0, push=push, on_tick=record).fell
    assert stepped_s[0] < 0.8 + 0.1


def turned(heading: float) -> np.ndarray:
    """The commands (ticks, 5, n) while the body turns from a heading at 1 rad/s.

    The joints stand still, toes outwards.
    """
    policy, commands, toes_out = Step(G1), [], G1.default_pose.copy()
    for side, angle in (("left", 0.15), ("right", -0.15)):
        toes_out[G1.joint_names.index(f"{side}_hip_yaw_joint")] = angle
    for time_s in np.arange(0.0, 2.1, 1.0 / policy.rate_hz).tolist():
        turn, spin = Rotation.from_euler("z", heading + time_s), (0.0, 0.0, 1.0)
        found = {"turn": turn, "gyro": spin, "joint": toes_out}
        inputs = policy_input(G1, time_s, spin, STILL, G1.description.standing_height_m, **found)
        if time_s == 0.0:
            policy.reset(inputs)
        commands.append(np.array(policy.act(inputs)))
    assert policy.footwork.phase is Phase.STEP
    return np.array(commands)


def test_a_turn_across_a_heading_of_pi_gives_the_same_swing() -> None:
    """A turn across pi gives the same commands as a quarter of a circle earlier.

    The other heading differs by a quarter of a circle, because friction pyramids are square.
    """
    np.testing.assert_allclose(turned(np.pi - 1.5), turned(np.pi / 2 - 1.5), atol=1e-4)
