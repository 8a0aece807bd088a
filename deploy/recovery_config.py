"""Settings for getting up after a fall: `safety.recovery` in robot.yaml and in a file for --config."""

import math
from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class RecoveryConfig:
    """Start, success and end of the tries."""

    tries: int = 3  # after one fall; afterwards the robot stays down
    same_fall_s: float = 3.0  # walking time before which a fall counts as the same fall
    try_s: float = 6.0  # longest time of a try
    unfold_s: float = 1.0  # motion of the joints to the default pose at first, which separates crossed limbs
    on_request: bool = False  # each fall waits for an operator's request; otherwise --recover is enough
    wait_s: float = 20.0  # longest time until the robot is at rest and an operator has requested it
    rest_rad_s: float = 0.3  # largest speed of base and joints of a robot at rest
    rest_s: float = 0.5  # required duration of rest
    upright_rad: float = 0.5  # largest tilt of the base, including the slope of the ground
    height_share: float = 0.7  # smallest clearance of a standing robot, as a share of its standing clearance
    pose_rad: float = 1.0  # largest distance of each joint from the default pose
    stand_rad_s: float = 1.0  # largest speed of base and joints of a standing robot
    stand_s: float = 0.4  # required duration of standing

    def __post_init__(self) -> None:
        require_between(self, 1, 100, "tries")
        require_between(self, 0.1, 60.0, "try_s")
        require_between(self, 0.1, 3600.0, "wait_s")
        require_between(self, 0.0, 60.0, "same_fall_s", "rest_s", "stand_s")
        require_between(self, 0.0, self.try_s, "unfold_s")
        require_between(self, 0.01, 100.0, "rest_rad_s", "stand_rad_s")
        require_between(self, 0.01, math.pi / 2, "upright_rad")
        require_between(self, 0.01, 2 * math.pi, "pose_rad")
        require_between(self, 0.0, 1.0, "height_share")
