"""What every step of a mission is: a check, and a plan from a pose on."""

from typing import NamedTuple, Protocol

from footfall.deploy.command_source import Offer, Pose
from footfall.operate.abilities import Limits
from footfall.operate.missions.activities import Activity
from footfall.operate.missions.follow import Tracking
from footfall.operate.missions.path import Pace

CREEP_SHARE = 0.15  # of the speed


class Scene(NamedTuple):
    """What a step's plan depends on beside the pose."""

    limits: Limits
    tracking: Tracking
    speed_m_s: float  # where a step names none

    def pace(self, speed_m_s: float | None) -> Pace:
        """How fast a path is followed."""
        speed, limits = speed_m_s or self.speed_m_s, self.limits
        creep = max(CREEP_SHARE * speed, limits.slowest)
        return Pace(max(speed, creep), creep, limits.yaw_rad_s, self.tracking.deceleration_m_s2)


class Plan(NamedTuple):
    """A step from a pose on."""

    lasts_s: float  # about
    end: Pose  # where it leads
    activity: Activity


class Step(Protocol):
    """One line of a mission."""

    def check(self, limits: Limits, offer: Offer) -> None:
        """Raise ValueError if a policy with these limits and this offer cannot do it."""

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        """The step, begun at a pose."""
        ...
