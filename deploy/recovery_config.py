"""How a robot gets up after a fall: `safety.recovery` in robot.yaml and in a file for --config."""

import math
from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class RecoveryConfig:
    """When a try begins, when it has succeeded, and when the robot stays down."""

    tries: int = 3  # after one fall; then the robot stays down
    again_s: float = 3.0  # of walking: a fall before that counts as the same fall
    try_s: float = 6.0  # longest time of a try
    unfold_s: float = 1.0  # of it, at first: the joints go to the default pose, so that limbs come apart
    asked: bool = False  # each fall waits for an operator to ask; otherwise --recover is enough
    wait_s: float = 20.0  # longest time until the robot lies still, and an operator has asked
    rest_rad_s: float = 0.3  # a robot lies still whose base and joints are all slower
    rest_s: float = 0.5  # for so long
    upright_rad: float = 0.5  # a robot stands whose base tilts by less: as steep as ground may be
    height_share: float = 0.7  # of its standing clearance, at least
    pose_rad: float = 1.0  # of each joint from the default pose, at most
    stand_rad_s: float = 1.0  # of base and joints, at most
    stand_s: float = 0.4  # for so long

    def __post_init__(self) -> None:
        require_between(self, 1, 100, "tries")
        require_between(self, 0.1, 60.0, "try_s")
        require_between(self, 0.1, 3600.0, "wait_s")
        require_between(self, 0.0, 60.0, "again_s", "rest_s", "stand_s")
        require_between(self, 0.0, self.try_s, "unfold_s")
        require_between(self, 0.01, 100.0, "rest_rad_s", "stand_rad_s")
        require_between(self, 0.01, math.pi / 2, "upright_rad")
        require_between(self, 0.01, 2 * math.pi, "pose_rad")
        require_between(self, 0.0, 1.0, "height_share")
