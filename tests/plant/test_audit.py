"""The audit of a controller's commands to its motors: forbidden commands are noticed."""

import numpy as np
import pytest

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.audit import Audit
from footfall.robots.description import Robot


def audited(go1: Robot, *offsets: object, kp: float = 1.0) -> Audit:
    """The audit of joint targets beside the default pose, rad, for a robot at rest in that pose."""
    audit = Audit(go1, wiring_of(go1), 0.002)
    for offset in offsets:
        values = np.zeros((5, 12))
        values[0], values[2] = go1.default_pose + offset, kp
        audit.update(open_driver(wiring_of(go1)).command(values), go1.default_pose, np.zeros(12))
    return audit


def test_torque_beyond_a_motors_peak_is_reported_as_a_share(go1: Robot) -> None:
    """The first command requests 2.5 times the peak; the largest share of all commands is reported."""
    first = 0.5 * np.eye(12)[0]
    for offsets in ((first,), (first, 0.0)):
        audit = audited(go1, *offsets, kp=2.5 * go1.motor.peak_torque[0] / 0.5)
        assert audit.torque_over == pytest.approx(1.5, abs=0.02)
        assert audit.stiff


def test_targets_beyond_limits_and_jumping_targets_are_reported(go1: Robot) -> None:
    for limit, by in ((go1.soft_limits[1], 0.25), (go1.soft_limits[0], -0.25)):
        audit = audited(go1, (limit - go1.default_pose + by) * np.eye(12)[2])
        assert audit.outside_rad == pytest.approx(0.25, abs=1e-3)
    for jump_rad in (0.06, -0.06):
        share = audited(go1, 0.0, jump_rad, jump_rad).rate_share
        assert share == pytest.approx(0.06 / 0.002 / go1.description.target_rate_rad_s, rel=0.02)


def test_damping_has_no_target(go1: Robot) -> None:
    audit = audited(go1, 9.0, kp=0.0)
    assert (audit.stiff, audit.outside_rad) == (False, 0.0)
