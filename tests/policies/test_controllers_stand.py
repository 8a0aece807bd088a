"""Standing, levelled by the IMU."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tilted_robot import ROBOT, observed

from footfall.policies.controllers.stance import level_feet, nominal_feet, tilt_correction
from footfall.policies.controllers.stand import Stand, StandConfig

CONFIG = StandConfig(
    rate_hz=100.0, kp=33.0, kd=1.5, tilt_gain=0.8, tilt_rate_gain_s=0.05, max_tilt_rad=0.3, settle_s=2.0
)


def test_a_robot_moves_from_its_initial_pose_to_a_level_default_pose() -> None:
    policy = Stand(ROBOT, CONFIG)
    begun = observed(Rotation.identity(), time_s=0.0)
    policy.reset(begun)
    start = begun.sensed.joint_position.copy()
    begun.sensed.joint_position[:] = 99.0
    np.testing.assert_allclose(
        policy.act(begun._replace(time_s=0.5)).position, 0.75 * start + 0.25 * ROBOT.default_pose, atol=1e-9
    )
    for time_s in (2.0, 7.0):
        settled = policy.act(observed(Rotation.identity(), time_s=time_s))
        np.testing.assert_allclose(settled.position, ROBOT.default_pose, atol=1e-9)
    assert settled.kp.tolist() == [33.0] * 12
    assert settled.kd.tolist() == [1.5] * 12
    assert not np.any([settled.velocity, settled.torque])
    assert policy.rate_hz == 100.0
    again = observed(Rotation.identity(), time_s=0.0)
    policy.reset(again)
    np.testing.assert_allclose(policy.act(again).position, again.sensed.joint_position)
    stance = policy.stance()
    assert stance is not None
    assert stance.tolist() == [1.0] * 4


def test_feet_stand_outward_forward_and_below_as_configured() -> None:
    """A leg in the middle plane does not move outward; the feet's own positions stay unchanged."""
    foot_positions = np.array([[0.2, -0.1, -0.3], [-0.2, 0.15, -0.25], [0.0, 1e-9, -0.2]])
    legs = SimpleNamespace(default_foot=foot_positions.copy(), foot_radius=np.array([0.02, 0.03, 0.01]))
    feet = nominal_feet(legs, height_m=0.3, outward_m=0.04, shift_m=0.05)  # type: ignore[arg-type]
    expected = [[0.25, -0.14, -0.28], [-0.15, 0.19, -0.27], [0.05, 0.0, -0.29]]
    np.testing.assert_allclose(feet, expected, atol=1e-8)
    np.testing.assert_array_equal(legs.default_foot, foot_positions)


@pytest.mark.parametrize(("roll", "pitch"), [(0.05, 0.0), (0.0, 0.08), (-0.04, 0.06)])
@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_the_measured_tilt_is_roll_and_pitch_at_any_heading(roll: float, pitch: float, yaw: float) -> None:
    seen = observed(Rotation.from_euler("ZYX", [yaw, pitch, roll]), gyro=(0.3, -0.5, 9.0))
    np.testing.assert_allclose(tilt_correction(seen, 2.0, 0.0, 9.0), [2 * roll, 2 * pitch], atol=3e-3)
    both = tilt_correction(seen, 2.0, 0.1, 9.0) - tilt_correction(seen, 2.0, 0.0, 9.0)
    np.testing.assert_allclose(both, [0.03, -0.05])
    np.testing.assert_allclose(tilt_correction(seen, 0.0, 1.0, 0.2), [0.2, -0.2])


def test_feet_of_a_rotated_plane_move_along_z_as_its_points_do() -> None:
    roll, pitch = 2e-4, -3e-4
    feet = np.random.default_rng(12).uniform(-0.3, 0.3, (4, 3))
    flat = feet * [1.0, 1.0, 0.0]
    turned = Rotation.from_euler("xyz", [roll, pitch, 0.0]).apply(flat)
    moved = level_feet(feet, np.array([roll, pitch]))
    np.testing.assert_allclose(moved - feet, turned * [0.0, 0.0, 1.0], atol=1e-6)
    assert np.abs(moved - feet).max() > 1e-5
