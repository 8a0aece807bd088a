"""Load, temperature and tracking of each joint, for the cockpit."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from footfall.pages.run_feed import RunFeed


class JointNames(NamedTuple):
    """The joints of a robot, and the peak torques of their motors."""

    names: Sequence[str]
    peak_nm: Sequence[float]


def joint_figures(feed: RunFeed, joints: JointNames) -> dict[str, Any]:
    """State of the joints and the yaw rate, for JSON; empty before the first readings."""
    states, sent = feed.newest("/joint_states"), feed.newest("/joint_commands")
    health, imu = feed.newest("/motor_health"), feed.newest("/imu/data")
    if states is None or imu is None:
        return {}
    count = len(joints.names)
    targets = [math.nan] * count if sent is None else sent.position
    temperature = [math.nan] * count if health is None else list(health.data)[:count]
    return {
        "yaw_rate": _rounded(imu.angular_velocity.z),
        "joints": {
            "names": list(joints.names),
            "load": [
                _rounded(100.0 * abs(effort) / peak)
                for effort, peak in zip(states.effort, joints.peak_nm, strict=True)
            ],
            "temperature_c": [_rounded(value) for value in temperature],
            "error_rad": [
                _rounded(target - position) for target, position in zip(targets, states.position, strict=True)
            ],
        },
    }


def _rounded(value: float) -> float | None:
    return round(float(value), 3) if math.isfinite(value) else None
