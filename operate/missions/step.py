"""Interface of a mission's steps: a check, and a plan starting from a pose."""

from typing import NamedTuple, Protocol

from footfall.deploy.command_source import Offer, Pose
from footfall.operate.abilities import Limits
from footfall.operate.missions.activities import Activity
from footfall.operate.missions.follow import Tracking
from footfall.operate.missions.path import Pace

CREEP_SHARE = 0.15  # of the speed


class Scene(NamedTuple):
    """Data for planning a step, in addition to the pose."""

    limits: Limits
    tracking: Tracking
    speed_m_s: float  # for steps that give none

    def pace(self, speed_m_s: float | None) -> Pace:
        """Speeds for following a path."""
        speed, limits = speed_m_s or self.speed_m_s, self.limits
        creep = max(CREEP_SHARE * speed, limits.min_norm)
        return Pace(max(speed, creep), creep, limits.yaw_rad_s, self.tracking.deceleration_m_s2)


class Plan(NamedTuple):
    """A planned step."""

    duration_s: float  # approximate duration
    end: Pose  # pose at the end
    activity: Activity


class Step(Protocol):
    """One line of a mission."""

    def check(self, limits: Limits, offer: Offer) -> None:
        """Raise ValueError if the step is impossible with a policy's limits and offer."""

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        """Plan the step starting from a pose."""
        ...
