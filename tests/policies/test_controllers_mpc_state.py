"""State, reference and steps of model-predictive control."""

from dataclasses import replace

import numpy as np
import pytest
from moments import UP
from scipy.spatial.transform import Rotation
from tilted_robot import ROBOT, observed

from footfall.common.rotations import heading_matrix, wrap_angle
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.base import Base, Disturbance, body_state, capture_offset_m
from footfall.policies.controllers.mpc.config import FootholdConfig, MpcConfig
from footfall.policies.controllers.mpc.footholds import contact_points, foothold
from footfall.policies.controllers.mpc.problem import BodyState
from footfall.policies.controllers.mpc.swing import swing_motion
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import nominal_feet
from footfall.robots.rigid_body import nominal_body

BODY = nominal_body(ROBOT)
LEGS = ROBOT.legs
RNG = np.random.default_rng(12)
TILTED = Rotation.from_euler("ZYX", [1.1, -0.15, 0.1])


def in_plane(vector: np.ndarray) -> complex:
    return complex(vector[0], vector[1])


@pytest.mark.parametrize("seed", range(6))
def test_footholds_follow_bledts_formula_in_three_dimensions(seed: int) -> None:
    rng = np.random.default_rng(seed)
    point, base, velocity, desired = (np.array([*rng.uniform(-0.4, 0.4, 2), 0.0]) for _ in range(4))
    yaw, rate, left_s, stance_s, height = 2.3, -1.7, 0.11, 0.23, 0.31
    config = FootholdConfig(capture_gain_s=0.07, max_step_m=10.0 if seed % 2 else 0.03)
    arm = Rotation.from_euler("z", yaw + rate * left_s).apply(point)
    spin = rate * UP
    step = stance_s / 2 * (velocity + np.cross(spin, arm)) + 0.07 * (velocity - desired)
    step += height / (2 * 9.81) * np.cross(velocity, spin)
    if np.linalg.norm(step) > config.max_step_m:
        step *= config.max_step_m / np.linalg.norm(step)
    expected = base + velocity * left_s + arm + step
    vectors = [in_plane(each) for each in (point, base)]
    found = foothold(
        *vectors, height, in_plane(velocity), in_plane(desired), yaw, rate, left_s, stance_s, config
    )
    assert found == pytest.approx(in_plane(expected))


@pytest.mark.parametrize("seed", range(4))
def test_contact_points_follow_the_plan_step_by_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    steps, legs = 9, 4
    contacts = rng.random((steps, legs)) < 0.6
    feet, targets, nominal = rng.normal(size=(3, legs, 3))
    centre, yaw = rng.normal(size=(steps, 3)), rng.normal(size=steps)
    found = contact_points(contacts, feet, targets, nominal, centre, yaw)
    for leg in range(legs):
        touchdowns = 0
        for step in range(steps):
            if step and contacts[step, leg] and not contacts[step - 1, leg]:
                touchdowns += 1
            if not contacts[step, leg]:
                continue
            if contacts[0, leg] and touchdowns == 0:
                expected = feet[leg] - centre[step]
            elif not contacts[0, leg] and touchdowns == 1:
                expected = targets[leg] - centre[step]
            else:
                expected = Rotation.from_euler("z", yaw[step]).apply(nominal[leg])
                expected[2] = -centre[step, 2]
            np.testing.assert_allclose(found[step, leg], expected, atol=1e-12)


@pytest.mark.parametrize("progress", [0.0, 0.2, 0.5, 0.9, 1.0])
def test_a_swing_moves_from_lift_off_to_landing_in_its_time(progress: float) -> None:
    start, end, swing_s = [0.1, -0.2, 0.03], [0.4, 0.1, -0.01], 0.3

    def at(share: float) -> np.ndarray:
        return np.array(swing_motion(share, start, end, swing_s, 0.08))

    position, velocity, acceleration = at(progress)
    if progress in (0.0, 1.0):
        np.testing.assert_allclose(position, start if progress == 0.0 else end, atol=1e-12)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-12)
        return
    d = 1e-5
    before, after = at(progress - d / swing_s), at(progress + d / swing_s)
    np.testing.assert_allclose(velocity, (after[0] - before[0]) / (2 * d), atol=1e-6)
    np.testing.assert_allclose(acceleration, (after[1] - before[1]) / (2 * d), atol=1e-4)
    straight = np.array(start) + (np.array(end) - start) * (position[0] - start[0]) / (end[0] - start[0])
    np.testing.assert_allclose((position - straight)[:2], 0.0, atol=1e-12)
    assert 0.0 < (position - straight)[2] <= 0.08 + 1e-12
    if progress == 0.5:
        np.testing.assert_allclose(position, [0.25, -0.05, 0.01 + 0.08])


def base_of() -> Base:
    yaw, pitch, roll = TILTED.as_euler("ZYX")
    velocity, gyro = np.array([0.4, -0.3, 0.1]), np.array([0.5, -0.7, 0.9])
    return Base(0.3 - 0.2j, 0.28, velocity, TILTED.as_matrix(), gyro, roll, pitch, yaw)


@pytest.fixture
def mpc() -> Mpc:
    return Mpc(ROBOT)


CONFIG = controller_settings(ROBOT, "mpc", MpcConfig)
STANCE = (CONFIG.stance.height_m, CONFIG.stance.outward_m, CONFIG.stance.shift_m)


class TestMpc:
    def test_the_state_is_that_of_the_centre_of_mass_in_the_heading_frame(self, mpc: Mpc) -> None:
        base = base_of()
        state = body_state(base, BODY.centre, heading_matrix(base.yaw), np.zeros(3))
        arm = TILTED.apply(BODY.centre)
        spin = TILTED.apply(base.gyro)
        heading = Rotation.from_euler("z", -base.yaw)
        np.testing.assert_allclose(state.pose[:3], [base.roll, base.pitch, 0.0])
        np.testing.assert_allclose(state.pose[3:], heading.apply(arm) + 0.28 * UP, atol=1e-12)
        np.testing.assert_allclose(state.rate[:3], heading.apply(spin), atol=1e-12)
        expected = heading.apply(base.velocity + np.cross(spin, arm))
        np.testing.assert_allclose(state.rate[3:], expected, atol=1e-12)

    def test_the_reference_is_the_commanded_motion_step_by_step(self, mpc: Mpc) -> None:
        base = base_of()
        mpc.command.value = np.array([0.6, -0.25, 0.8])
        mpc.reference.xy, mpc.reference.yaw, mpc.reference.height = 0.33 - 0.15j, base.yaw + 0.1, 0.27
        reference = mpc.reference.over_horizon(base, mpc.command.value)
        to_heading = Rotation.from_euler("z", -base.yaw)
        point = to_heading.apply([0.03, 0.05, 0.0])
        dt = CONFIG.horizon.step_s
        assert len(reference.pose) == CONFIG.horizon.steps
        for k, (pose, rate) in enumerate(zip(reference.pose, reference.rate, strict=True)):
            yaw = 0.1 + 0.8 * dt * (k + 1)
            turn = Rotation.from_euler("z", yaw)
            velocity = turn.apply([0.6, -0.25, 0.0])
            point = point + velocity * dt
            centre = point + turn.apply(BODY.centre)
            np.testing.assert_allclose(pose, [0, 0, yaw, centre[0], centre[1], 0.27 + centre[2]], atol=1e-9)
            np.testing.assert_allclose(rate, [0, 0, 0.8, *velocity], atol=1e-9)

    def test_the_path_loses_its_surplus_speed(self, mpc: Mpc) -> None:
        """The path is the integral of v = desired + (now - desired) exp(-t / 0.2 s), in mid-step."""
        steps = CONFIG.horizon.steps
        state = BodyState(np.array([0, 0, 0, 0.1, -0.2, 0.25]), np.array([0, 0, 0, 0.9, -0.5, 0.4]))
        desired = np.array([0.3, 0.2, 0.0])
        reference = BodyState(np.zeros((steps, 6)), np.tile([9.0, 9.0, 9.0, *desired], (steps, 1)))
        reference.rate[1:] += 1.0  # the current target counts
        path = mpc.reference.path(state, reference)
        fine = np.linspace(0.0, 1.0, 200_001)
        speed = desired + (state.rate[3:] - desired) * np.exp(-fine / 0.2)[:, None]
        travelled = np.cumsum(speed, axis=0) * fine[1]
        for k in range(steps):
            index = np.searchsorted(fine, CONFIG.horizon.step_s * (k + 0.5))
            expected = state.pose[3:5] + travelled[index, :2]
            np.testing.assert_allclose(path[k, :2], expected, atol=1e-4)
        assert path[:, 2].tolist() == [0.25] * steps

    def test_the_reference_follows_the_base_by_its_velocity_in_the_world(self, mpc: Mpc) -> None:
        velocity = np.array([0.7, -0.4, 0.2])
        seen = observed(TILTED, gyro=(1, 2, 3), base_velocity=velocity, base_height=0.24)
        mpc.reset(seen)
        moved = TILTED.apply(velocity)
        for k in (1, 2):
            base = mpc.follower.follow(seen, 0.004)
            assert base.xy == pytest.approx(in_plane(moved) * 0.004 * k)
        np.testing.assert_allclose(base.velocity, moved, atol=1e-12)
        assert base.height == pytest.approx(0.24 + LEGS.foot_radius.mean())
        assert (base.yaw, base.pitch, base.roll) == pytest.approx((1.1, -0.15, 0.1))
        assert base.gyro.tolist() == [1.0, 2.0, 3.0]
        np.testing.assert_allclose(base.position, [base.xy.real, base.xy.imag, base.height])

    def test_the_reference_leads_by_at_most_its_limit(self, mpc: Mpc) -> None:
        stance = CONFIG.stance
        base = base_of()
        mpc.command.value = np.array([0.5, -0.2, 0.6])
        mpc.reference.xy, mpc.reference.yaw, mpc.reference.height = base.xy, base.yaw, 0.2
        mpc.reference.advance(base, mpc.command.value, 0.01)
        forward = in_plane(Rotation.from_euler("z", base.yaw).apply([0.5, -0.2, 0.0]))
        assert mpc.reference.velocity == pytest.approx(forward)
        assert mpc.reference.xy == pytest.approx(base.xy + 0.01 * forward)
        assert mpc.reference.yaw == pytest.approx(base.yaw + 0.006)
        climbed = 0.2 + 0.01 / CONFIG.settle_s * (stance.height_m - 0.2)
        assert mpc.reference.height == pytest.approx(climbed)
        for sign in (1.0, -1.0):
            mpc.command.value = sign * np.array([0.5, -0.2, 0.6])
            mpc.reference.advance(base, mpc.command.value, 5.0)
            ahead = mpc.reference.xy - base.xy
            assert abs(ahead) == pytest.approx(stance.max_position_lead_m)
            assert ahead / abs(ahead) == pytest.approx(sign * forward / abs(forward))
            assert wrap_angle(mpc.reference.yaw - base.yaw) == pytest.approx(sign * stance.max_yaw_lead_rad)
        assert mpc.reference.height == pytest.approx(stance.height_m)

    def test_a_disturbed_robot_steps_until_it_has_been_calm(self) -> None:
        restart = CONFIG.restart

        def base(speed: float = 0.0, roll: float = 0.0, pitch: float = 0.0) -> Base:
            velocity = np.array([0.6 * speed, -0.8 * speed, 9.0])
            return base_of()._replace(velocity=velocity, roll=roll, pitch=pitch)

        assert restart.stop_speed_m_s < restart.start_speed_m_s
        disturbance = Disturbance(restart)
        between = base(0.5 * (restart.stop_speed_m_s + restart.start_speed_m_s))
        assert not disturbance.active(between, False, 0.0, 0.1)
        assert disturbance.active(base(1.01 * restart.start_speed_m_s), False, 0.0, 0.1)
        disturbance.reset()
        assert not disturbance.active(base(), False, 0.0, 0.1)
        for roll, pitch in ((-1.01, 0.0), (0.0, 1.01)):
            tilted = base(0.0, roll * restart.start_tilt_rad, pitch * restart.start_tilt_rad)
            assert disturbance.active(tilted, False, 0.0, 0.1)
            steps = 0
            while disturbance.active(base(), False, 0.0, restart.calm_s / 10.5):
                steps += 1
            assert steps == 10
        assert disturbance.active(between, True, 0.0, 0.1)

    def test_a_standing_robot_that_drifts_off_its_feet_steps_before_it_tips_over(self) -> None:
        restart = replace(CONFIG.restart, max_offset_m=0.04)
        feet, centre = np.array([[0.0, 0.14, -0.7], [0.0, -0.02, -0.7]]), np.array([0.0, 0.03, 0.0])
        slow = base_of()._replace(velocity=np.array([0.0, 0.0, 0.0]), rotation=np.eye(3))
        drifts = slow._replace(velocity=np.array([0.0, -0.05, 0.0]))
        offsets = [capture_offset_m(base, centre, feet) for base in (slow, drifts)]
        np.testing.assert_allclose(offsets, [0.03, 0.03 + 0.05 * np.sqrt(0.7 / 9.81)], atol=1e-3)
        standing = [Disturbance(restart).active(slow, False, each, 0.1) for each in offsets]
        assert standing == [False, True]
        assert not Disturbance(restart).active(slow, True, offsets[1], 0.1)

    def test_swinging_feet_move_relative_to_the_moving_base(self, mpc: Mpc) -> None:
        """The velocity of a foot is the change of its position in the base's axes."""
        base = base_of()
        spin = TILTED.apply(base.gyro)
        mpc.swing_feet.lift_off = RNG.uniform(-0.3, 0.3, (4, 3))
        mpc.swing_feet.target = RNG.uniform(-0.3, 0.3, (4, 3))
        swing_s, progress, d = mpc.clock.timing.swing_s, [0.0, 0.3, 0.0, 0.7], 1e-5

        def seen(dt: float) -> np.ndarray:
            turn = Rotation.from_rotvec(spin * dt) * TILTED
            xy = base.xy + dt * in_plane(base.velocity)
            moved = base._replace(
                xy=xy, height=base.height + dt * base.velocity[2], rotation=turn.as_matrix()
            )
            return mpc.swing_feet.motion([1, 3], [share + dt / swing_s for share in progress], moved, swing_s)

        motion, before, after = seen(0.0), seen(-d), seen(d)
        np.testing.assert_allclose(motion[:, 1], (after[:, 0] - before[:, 0]) / (2 * d), atol=1e-5)
        landing = mpc.swing_feet.target + (LEGS.foot_radius[0] - CONFIG.swing.depth_m) * UP
        lift_off = mpc.swing_feet.lift_off
        world = np.array(
            swing_motion(0.7, lift_off[3].tolist(), landing[3].tolist(), swing_s, CONFIG.swing.height_m)
        )
        np.testing.assert_allclose(TILTED.apply(motion[1, 0]) + base.position, world[0], atol=1e-12)
        np.testing.assert_allclose(TILTED.apply(motion[1, 2]), world[2], atol=1e-9)
        assert mpc.swing_feet.motion([], progress, base, swing_s).shape == (0, 3, 3)

    def test_a_leg_that_swings_aims_where_its_foothold_is_when_it_lands(self, mpc: Mpc) -> None:
        base = base_of()
        timing = mpc.clock.timing
        pose = LEGS.pose(ROBOT.default_pose)
        mpc.swing_feet.aim(2, 0.3, base, pose, mpc.wrenches, 0.25 + 0.1j, -0.6, timing)
        expected = foothold(
            in_plane(nominal_feet(LEGS, *STANCE)[2]),
            base.xy,
            base.height,
            in_plane(base.velocity),
            0.25 + 0.1j,
            base.yaw,
            -0.6,
            0.7 * timing.swing_s,
            timing.stance_s,
            CONFIG.foothold,
        )
        assert in_plane(mpc.swing_feet.target[2]) == pytest.approx(expected)
        assert not mpc.swing_feet.target[[0, 1, 3]].any()
