"""The audit of a controller's commands to its motors."""

from typing import Any

import numpy as np
import pytest

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.audit import Audit
from footfall.robots.description import Robot


class TestAudit:
    """A controller that sends forbidden commands is caught."""

    @pytest.fixture
    def audit(self, go1: Robot) -> Audit:
        return Audit(go1, wiring_of(go1), 0.002)

    def update(self, go1: Robot, audit: Audit, position: np.ndarray, kp: Any) -> None:
        """The robot is at rest in its default pose."""
        values = np.zeros((5, 12))
        values[0], values[2] = position, kp
        audit.update(open_driver(wiring_of(go1)).command(values), go1.default_pose, np.zeros(12))

    def test_torque_beyond_a_motors_peak_is_reported_as_a_share(self, go1: Robot, audit: Audit) -> None:
        off = go1.default_pose.copy()
        off[0] += 0.5
        kp = 2.5 * go1.motor.peak_torque[0] / 0.5
        self.update(go1, audit, off, kp)  # requests 2.5 times the peak
        assert audit.torque_over == pytest.approx(1.5, abs=0.02)
        assert audit.stiff
        self.update(go1, audit, go1.default_pose, kp)
        assert audit.torque_over == pytest.approx(1.5, abs=0.02)  # the largest of all

    @pytest.mark.parametrize(("end", "by"), [(1, 0.25), (0, -0.25)])
    def test_targets_beyond_limits_are_reported(self, go1: Robot, audit: Audit, end: int, by: float) -> None:
        off = go1.default_pose.copy()
        off[2] = go1.soft_limits[end][2] + by
        self.update(go1, audit, off, 1.0)
        assert audit.outside_rad == pytest.approx(0.25, abs=1e-3)

    @pytest.mark.parametrize("jump_rad", [0.06, -0.06])
    def test_a_jumping_target_is_reported(self, go1: Robot, audit: Audit, jump_rad: float) -> None:
        self.update(go1, audit, go1.default_pose, 1.0)
        self.update(go1, audit, go1.default_pose + jump_rad, 1.0)
        self.update(go1, audit, go1.default_pose + jump_rad, 1.0)
        rate = go1.description.target_rate_rad_s
        assert audit.rate_share == pytest.approx(0.06 / 0.002 / rate, rel=0.02)

    def test_damping_has_no_target(self, go1: Robot, audit: Audit) -> None:
        self.update(go1, audit, go1.default_pose + 9.0, 0.0)
        assert not audit.stiff
        assert audit.outside_rad == 0.0
