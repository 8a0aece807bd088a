"""The audit of a controller's commands to its motors: forbidden commands are noticed."""

from collections.abc import Callable

import numpy as np
import pytest

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.audit import Audit
from footfall.robots.description import Robot


@pytest.fixture
def audit(go1: Robot) -> Audit:
    return Audit(go1, wiring_of(go1), 0.002)


@pytest.fixture
def update(go1: Robot, audit: Audit) -> Callable[..., None]:
    """Commands joint targets beside the default pose, rad, to a robot at rest in that pose."""

    def send(offset: object, kp: float = 1.0) -> None:
        values = np.zeros((5, 12))
        values[0], values[2] = go1.default_pose + offset, kp
        audit.update(open_driver(wiring_of(go1)).command(values), go1.default_pose, np.zeros(12))

    return send


def test_torque_beyond_a_motors_peak_is_reported_as_a_share(
    go1: Robot, audit: Audit, update: Callable[..., None]
) -> None:
    kp = 2.5 * go1.motor.peak_torque[0] / 0.5
    update(0.5 * np.eye(12)[0], kp)  # requests 2.5 times the peak
    assert audit.torque_over == pytest.approx(1.5, abs=0.02)
    assert audit.stiff
    update(0.0, kp)
    assert audit.torque_over == pytest.approx(1.5, abs=0.02)  # the largest of all


@pytest.mark.parametrize(("end", "by"), [(1, 0.25), (0, -0.25)])
def test_targets_beyond_limits_are_reported(
    go1: Robot, audit: Audit, update: Callable[..., None], end: int, by: float
) -> None:
    update((go1.soft_limits[end] - go1.default_pose + by) * np.eye(12)[2])
    assert audit.outside_rad == pytest.approx(0.25, abs=1e-3)


@pytest.mark.parametrize("jump_rad", [0.06, -0.06])
def test_a_jumping_target_is_reported(
    go1: Robot, audit: Audit, update: Callable[..., None], jump_rad: float
) -> None:
    for offset in (0.0, jump_rad, jump_rad):
        update(offset)
    assert audit.rate_share == pytest.approx(0.06 / 0.002 / go1.description.target_rate_rad_s, rel=0.02)


def test_damping_has_no_target(audit: Audit, update: Callable[..., None]) -> None:
    update(9.0, kp=0.0)
    assert (audit.stiff, audit.outside_rad) == (False, 0.0)
