"""Checks of the base against the legs: the IMU's attitude, and the height of the base."""

from dataclasses import dataclass

from footfall.common.config import require_between
from footfall.deploy.clearance import Clearance
from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.body_window import BodyWindow
from footfall.deploy.sensor_checks.check import BodyCheck, Limit
from footfall.robots.description import Robot

WINDOWS_PER_HEIGHT = 3  # bodies fall slowly, and this check takes more time than all others together


@dataclass(frozen=True)
class LegLimits:
    """Limits of differences of attitude and height between IMU and legs."""

    sunk: float = 0.55  # largest loss of clearance of the base, as a share of that when standing
    slope_rad: float = 0.35  # slope of the ground below a standing robot, by its legs and the IMU
    leg_turn_rad: float = 0.05  # largest difference between the rotations by IMU and legs while feet stand
    loaded_share: float = 0.2  # of an equal share of the weight: smallest load of a standing foot

    def __post_init__(self) -> None:
        require_between(self, 0.1, 1.0, "sunk")
        require_between(self, 0.01, 1.5, "slope_rad", "leg_turn_rad")
        require_between(self, 0.01, 1.0, "loaded_share")


class Slope(BodyCheck):
    """Angle between the plane of the standing feet and the IMU's level, rad; 0 without standing feet."""

    quantity = "the IMU's tilt against the plane of the stance feet: a wrong IMU or encoder"
    message = "the IMU: the base is tilted by {0:.2f} rad against the standing legs"
    limit = Limit("slope_rad")

    def measure(self, window: BodyWindow) -> float:
        return window.slope_rad


class LegTurn(BodyCheck):
    """Rotation of the base since the feet stand: IMU minus legs, rad; 0 without standing feet."""

    quantity = "the base's rotation by the IMU against that by the stance legs, on any slope"
    message = "the IMU: the base turned by {0:.2f} rad against the standing legs"
    limit = Limit("leg_turn_rad")

    def measure(self, window: BodyWindow) -> float:
        return window.leg_turn_rad


class Sunk(BodyCheck):
    """Lost share of the base's clearance."""

    quantity = "lost share of the base's clearance: the robot sinks without tipping over"
    message = "the base has sunk: {0:.0%} of its clearance is gone"
    limit = Limit("sunk")
    leads_to = Mode.FALLING

    def __init__(self, robot: Robot, limits: LegLimits, sample_s: float) -> None:
        self._clearance = Clearance(robot)
        self.reset()

    def reset(self) -> None:
        self._windows, self._share = 0, 0.0

    def measure(self, window: BodyWindow) -> float:
        self._windows += 1
        if not window.on_legs:
            self._share = 0.0
        elif self._windows % WINDOWS_PER_HEIGHT == 0:
            readings = window.readings
            self._share = self._clearance.sunk_share(readings.position, readings.inertials[-1].quaternion)
        return self._share
