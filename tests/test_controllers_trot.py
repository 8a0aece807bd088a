"""What the trot and the stand command in single moments."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import tilt_correction
from footfall.policies.controllers.stand import Stand, StandConfig
from footfall.policies.controllers.trot import Trot, TrotConfig
from footfall.policies.policy import Observation, Sensed
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
LEGS = ROBOT.legs
CONFIG = controller_settings(ROBOT, "trot", TrotConfig)
FORWARD = (0.4, 0.0, 0.0)


def seen(
    time_s: float = 0.0,
    command: tuple[float, float, float] = (0.0, 0.0, 0.0),
    roll: float = 0.0,
    pitch: float = 0.0,
    gyro: tuple[float, float, float] = (0.0, 0.0, 0.0),
    joint: np.ndarray = ROBOT.default_pose,
) -> Observation:
    """A small tilt about one axis, legs in the default pose unless said otherwise."""
    quaternion = np.array([np.cos((roll + pitch) / 2), np.sin(roll / 2), np.sin(pitch / 2), 0.0])
    zero = np.zeros(12)
    sensed = Sensed(np.array(gyro), np.array([0.0, 0.0, 9.81]), quaternion, joint, zero, zero)
    return Observation(time_s, sensed, np.array(command), np.zeros(3), 0.28)


class TestTilt:
    """Roll and pitch by which the feet turn with the base."""

    def test_it_is_a_share_of_the_measured_tilt(self) -> None:
        np.testing.assert_allclose(tilt_correction(seen(roll=0.1), 0.3, 0.0, 1.0), [0.03, 0.0], atol=1e-4)
        np.testing.assert_allclose(tilt_correction(seen(pitch=0.1), 0.3, 0.0, 1.0), [0.0, 0.03], atol=1e-4)

    def test_a_base_that_is_tilting_is_met_ahead(self) -> None:
        moving = seen(gyro=(0.5, -1.0, 7.0))
        np.testing.assert_allclose(tilt_correction(moving, 0.3, 0.02, 1.0), [0.01, -0.02])

    def test_it_is_bounded(self) -> None:
        wild = seen(gyro=(50.0, -50.0, 0.0))
        np.testing.assert_allclose(tilt_correction(wild, 0.3, 0.02, 0.2), [0.2, -0.2])


def feet_of(command_position: np.ndarray) -> np.ndarray:
    return LEGS.pose(command_position).foot


class TestStand:
    def test_it_begins_where_it_finds_the_legs(self) -> None:
        bent = ROBOT.default_pose + 0.05
        policy = Stand(ROBOT)
        policy.reset(seen(joint=bent))
        np.testing.assert_allclose(policy.act(seen(0.0, joint=bent)).position, bent)
        np.testing.assert_allclose(policy.act(seen(9.0, joint=bent)).position, ROBOT.default_pose, atol=1e-9)

    def test_tilted_to_the_right_it_pushes_down_on_the_right(self) -> None:
        policy = Stand(ROBOT)
        policy.reset(seen())
        feet = feet_of(policy.act(seen(9.0, roll=0.1)).position)
        right, left = feet[[0, 2], 2], feet[[1, 3], 2]
        assert np.all(right < left)


def walking(policy: Trot, command: tuple[float, float, float] = FORWARD, seconds: float = 1.0) -> np.ndarray:
    """Walk from a settled stance and return commanded feet, (ticks, legs, 3)."""
    policy.reset(seen())
    dt_s, start = 1 / policy.rate_hz, CONFIG.settle_s
    ticks = round(seconds * policy.rate_hz)
    return np.array([feet_of(policy.act(seen(start + k * dt_s, command)).position) for k in range(ticks)])


class TestTrot:
    def test_it_goes_to_its_stance_before_it_follows_a_command(self) -> None:
        """On a straight line of joint angles; then the first step begins."""
        policy, bent = Trot(ROBOT), ROBOT.default_pose + 0.01 * np.arange(12)
        policy.reset(seen(joint=bent))
        at = [policy.act(seen(share * CONFIG.settle_s, FORWARD)).position for share in (0.25, 0.999)]
        np.testing.assert_allclose(feet_of(policy._previous), policy._place, atol=1e-3)
        np.testing.assert_allclose(at[0], bent + 0.25 / 0.999 * (at[1] - bent), atol=1e-9)
        assert policy.stance().tolist() == [1.0] * 4  # type: ignore[union-attr]
        policy.act(seen(CONFIG.settle_s, FORWARD))
        assert policy.stance().tolist() != [1.0] * 4  # type: ignore[union-attr]

    def test_its_velocity_is_that_of_its_targets_under_its_gains(self) -> None:
        policy = Trot(ROBOT)
        walking(policy)
        before = policy._previous
        told = policy.act(seen(CONFIG.settle_s + 1.0, FORWARD))
        np.testing.assert_allclose(told.velocity, (told.position - before) * CONFIG.rate_hz)
        assert np.abs(told.velocity).max() > 0.1
        assert told.kp.tolist() == [CONFIG.kp] * 12
        assert told.kd.tolist() == [CONFIG.kd] * 12

    @pytest.mark.parametrize("command", [(0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (-0.1, 0.1, 0.6)])
    def test_each_standing_foot_goes_with_the_ground(self, command: tuple[float, float, float]) -> None:
        """Back under a base that moves by v + w x r, r being the foot's place under its hip."""
        policy = Trot(ROBOT)
        feet = walking(policy, command, seconds=1.4)[-200:]
        stands = np.abs(feet[:, :, 2] - feet[:, :, 2].min()) < 1e-9
        both = stands[1:] & stands[:-1]
        speed = np.diff(feet, axis=0)[:, :, :2] * CONFIG.rate_hz
        vx, vy, yaw = command
        for foot in range(4):
            x, y, _ = policy._place[foot]
            expected = [-(vx - yaw * y), -(vy + yaw * x)]
            # a stance ends inside a tick: the middle of the stance tells
            np.testing.assert_allclose(np.median(speed[both[:, foot], foot], axis=0), expected, atol=2e-3)

    def test_a_step_is_symmetric_about_the_foots_place(self) -> None:
        policy = Trot(ROBOT)
        feet = walking(policy, FORWARD, seconds=1.4)[-200:]
        middle = (feet.max(axis=0) + feet.min(axis=0)) / 2 - policy._place
        np.testing.assert_allclose(middle[:, :2], 0.0, atol=2e-3)
        ahead = feet[:, :, 0] > policy._place[:, 0] + 0.03
        falls = np.diff(feet[:, :, 2], axis=0) < -1e-4
        rises = np.diff(feet[:, :, 2], axis=0) > 1e-4
        assert (falls & ahead[1:]).any()  # it lands ahead and lifts off behind
        assert not (rises & ahead[1:]).any()

    def test_the_tilt_is_filtered(self) -> None:
        """The first of many readings moves the feet by dt / filter of the correction."""
        policy = Trot(ROBOT)
        policy.reset(seen())
        feet = feet_of(policy.act(seen(CONFIG.settle_s, roll=0.1)).position)
        share = 1.0 / CONFIG.rate_hz / CONFIG.tilt_filter_s
        assert share < 1.0
        roll = share * min(CONFIG.tilt_gain * 0.1, CONFIG.most_tilt_rad)
        np.testing.assert_allclose((feet - policy._place)[:, 2], roll * policy._place[:, 1], atol=2e-5)
        assert roll > 1e-3

    def test_legs_in_the_air_carry_nothing_and_the_others_all(self) -> None:
        policy = Trot(ROBOT, replace(CONFIG, gait=replace(CONFIG.gait, duty=0.5)))
        walking(policy, seconds=0.1)
        torque = LEGS.gather(policy.act(seen(CONFIG.settle_s + 0.1, FORWARD)).torque)
        stands = policy._clock.stance()
        assert stands.sum() == 2
        assert not torque[~stands].any()
        jacobian = LEGS.pose(ROBOT.default_pose).jacobian[stands]
        force = -np.linalg.solve(jacobian.transpose(0, 2, 1), torque[stands][:, :, None])[:, :, 0]
        np.testing.assert_allclose(force, [[0.0, 0.0, CONFIG.weight_n / 2]] * 2, atol=1e-9)

    def test_a_command_is_approached_from_rest_once_it_has_settled(self) -> None:
        policy = Trot(ROBOT)
        policy.reset(seen())
        for share in (0.2, 0.5, 0.99):
            policy.act(seen(share * CONFIG.settle_s, FORWARD))
            assert not policy._command.value.any()
        policy.act(seen(CONFIG.settle_s, FORWARD))
        first = CONFIG.command.acceleration_m_s2 / CONFIG.rate_hz
        np.testing.assert_allclose(policy._command.value, [first, 0.0, 0.0])

    @pytest.mark.parametrize("share", [0.05, 0.1, 0.4, 0.45, 0.55, 0.9])
    def test_contacts_are_planned_with_a_fifth_of_the_stance_at_each_edge(self, share: float) -> None:
        policy = Trot(ROBOT)
        walking(policy, seconds=share * CONFIG.gait.period_s)
        phases, duty = policy._clock.phases(), policy._clock.timing.duty
        through = phases / duty
        edges = np.minimum(through, 1 - through) / 0.2
        np.testing.assert_allclose(policy.stance(), np.clip(edges, 0.0, 1.0))  # type: ignore[arg-type]

    def test_feet_on_the_ground_go_back_as_fast_as_the_base_goes_forward(self) -> None:
        feet = walking(Trot(ROBOT))
        speed = np.diff(feet, axis=0)[-200:] * CONFIG.rate_hz  # one period of 0.4 s
        grounded = np.abs(feet[-200:, :, 2] - feet[:, :, 2].min()) < 1e-6
        grounded &= np.roll(grounded, 1, axis=0)
        np.testing.assert_allclose(speed[:, :, 0][grounded].mean(), -0.4, atol=0.02)

    def test_turning_left_right_feet_go_back_and_left_feet_forward(self) -> None:
        """Of feet in their place: w x r."""
        policy = Trot(ROBOT)
        walking(policy, (0.0, 0.0, 0.5))
        expected = np.cross([0.0, 0.0, 0.5], policy._place)
        np.testing.assert_allclose(policy._foot_velocity(), expected, atol=1e-9)
        assert np.all(expected[[0, 2], 0] > 0)  # the base passes forward over right feet

    def test_feet_are_lifted_to_the_swing_height(self) -> None:
        feet = walking(Trot(ROBOT))
        np.testing.assert_allclose(np.ptp(feet[-200:, :, 2], axis=0), CONFIG.swing_height_m, rtol=0.01)

    def test_steps_are_bounded(self) -> None:
        short = replace(CONFIG, most_step_m=0.02)
        feet = walking(Trot(ROBOT, short), (1.0, 0.0, 0.0))
        np.testing.assert_allclose(np.ptp(feet[-200:, :, 0], axis=0), 0.04, rtol=0.02)

    def test_legs_that_stand_press_with_the_weight(self) -> None:
        """torque = -J' f for f upwards on the foot, an even share of the weight each."""
        policy = Trot(ROBOT)
        policy.reset(seen())
        torque = LEGS.gather(policy.act(seen(CONFIG.settle_s)).torque)
        force = -np.linalg.solve(
            LEGS.pose(ROBOT.default_pose).jacobian.transpose(0, 2, 1), torque[:, :, None]
        )[:, :, 0]
        np.testing.assert_allclose(force, np.tile([0.0, 0.0, CONFIG.weight_n / 4], (4, 1)), atol=1e-9)

    def test_a_new_episode_starts_without_a_jump_in_velocity(self) -> None:
        policy = Trot(ROBOT)
        walking(policy)
        policy.reset(seen())
        assert np.abs(policy.act(seen(0.0)).velocity).max() == pytest.approx(0.0, abs=1e-9)

    def test_a_second_episode_is_the_first_to_the_bit(self) -> None:
        policy = Trot(ROBOT)
        np.testing.assert_array_equal(walking(policy), walking(policy))

    def test_a_new_episode_forgets_the_tilt_of_the_last(self) -> None:
        policy = Trot(ROBOT)
        policy.reset(seen())
        policy.act(seen(CONFIG.settle_s, roll=0.2))
        positions = []
        for each in (policy, Trot(ROBOT)):
            each.reset(seen())
            positions.append(each.act(seen(CONFIG.settle_s)).position)
        np.testing.assert_array_equal(*positions)


ABOVE_ZERO = {
    StandConfig: ("rate_hz", "kp", "settle_s"),
    TrotConfig: ("rate_hz", "height_m", "kp", "tilt_filter_s", "settle_s"),
}
NOT_BELOW = {
    StandConfig: ("kd", "tilt_gain", "tilt_rate_gain_s", "most_tilt_rad"),
    TrotConfig: (
        *("kd", "tilt_gain", "tilt_rate_gain_s", "most_tilt_rad"),
        *("swing_height_m", "weight_n", "most_step_m"),
    ),
}
BAD = [(cls, name, 0.0, "above 0") for cls, names in ABOVE_ZERO.items() for name in names]
BAD += [(cls, name, -0.1, "0 or above") for cls, names in NOT_BELOW.items() for name in names]


@pytest.mark.parametrize(("cls", "name", "value", "rule"), BAD)
def test_settings_that_cannot_work_are_refused(cls: type, name: str, value: float, rule: str) -> None:
    fine = CONFIG if cls is TrotConfig else controller_settings(ROBOT, "stand", StandConfig)
    with pytest.raises(ValueError, match=f"{name} must be {rule}"):
        replace(fine, **{name: value})
    if rule == "0 or above":
        replace(fine, **{name: 0.0})
