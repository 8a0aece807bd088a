"""Covariance of pose and velocity."""

import math
from dataclasses import replace

import numpy as np
import pytest

from footfall.deploy.estimation.config import OdometryConfig
from footfall.deploy.estimation.odometry import YAW, DelayUncertainty, PoseUncertainty

NO_DRIFT = OdometryConfig(orientation_noise=0.0, yaw_drift=0.0, scale_error=0.0, climb_error=0.0, slip=0.0)


class TestDrift:
    def test_yaw_drift_rotates_the_path(self) -> None:
        """Straight ahead at v, with a random walk q of the yaw: q^2 T of the yaw, v^2 q^2 T^3 / 3 across."""
        drift = PoseUncertainty(replace(NO_DRIFT, yaw_drift=0.01))
        for _ in range(8000):
            drift.advance([0.0, 0.5, 0.3], 0.001)
        found = drift.covariance(np.array([0.0, 4.0, 0.0]))
        assert found[YAW, YAW] == pytest.approx(8e-4)
        assert found[0, 0] == pytest.approx(0.25e-4 * 8**3 / 3, rel=2e-3)
        assert found[0, YAW] == found[YAW, 0] == pytest.approx(-0.5e-4 * 8**2 / 2, rel=2e-3)
        np.testing.assert_allclose([found[1, 1], found[0, 1], found[1, YAW], found[2, 2]], 0.0, atol=1e-12)

    def test_the_error_of_a_wrong_scale_is_a_share_of_the_displacement(self) -> None:
        moved = np.array([3.0, -4.0, 0.0])
        found = PoseUncertainty(replace(NO_DRIFT, scale_error=0.02)).covariance(moved)[:3, :3]
        np.testing.assert_allclose(found, 0.0004 * np.outer(moved, moved), atol=1e-15)

    def test_slips_add_up_with_the_walked_distance(self) -> None:
        """The robot walks 1.5 m ahead and 1.5 m back: three metres."""
        drift = PoseUncertainty(replace(NO_DRIFT, slip=0.02, climb_error=0.1))
        for speed in (0.5, -0.5):
            for _ in range(300):
                drift.advance([speed, 0.0, 0.0], 0.01)
        variance = np.diag(drift.covariance(np.zeros(3)))
        np.testing.assert_allclose(variance, [0.0012, 0.0012, 0.0012 + 0.09, 0.0])


class TestDelay:
    def test_velocities_that_are_constant_or_arrive_at_once_have_no_error_from_delay(self) -> None:
        """The robot walks ahead at 0.5 m/s and sways by 0.1 m/s at 2 Hz."""
        configs = (OdometryConfig(latency_s=latency_s, latency_filter_s=0.5) for latency_s in (0.01, 0.0))
        delayed, immediate = map(DelayUncertainty, configs)
        for tick in range(4000):
            velocity = [0.5, 0.1 * math.sin(math.tau * 2.0 * 0.001 * tick), 0.0]
            delayed.advance(velocity, 0.001)
            immediate.advance(velocity, 0.001)
        np.testing.assert_array_equal(delayed.covariance[0], 0.0)
        np.testing.assert_allclose(immediate.covariance, 0.0, atol=1e-30)

    def test_the_error_from_delay_is_a_filters_mean_square_lag(self) -> None:
        """A step of 1 m/s, a delay of 3 ms: after 1 ms the lag is 3/4, and its square has a weight of 0.1."""
        delay = DelayUncertainty(OdometryConfig(latency_s=0.003, latency_filter_s=0.009))
        for speed, expected in ((0.0, 0.0), (1.0, 0.1 * 0.75**2), (1.0, 0.09 * 0.75**2 + 0.1 * 0.75**4)):
            delay.advance([0.0, 0.0, speed], 0.001)
            assert delay.covariance[2, 2] == pytest.approx(expected)
