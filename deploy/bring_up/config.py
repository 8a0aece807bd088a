"""Motions of bring-up, and the limits of its criteria."""

from dataclasses import dataclass, field

from footfall.common.config import require_between


@dataclass(frozen=True)
class BringUpLimits:
    """Limits of the criteria."""

    lost_rad: float = 0.5  # tracking error that ends a step at once
    still_rad: float = 0.06  # largest motion of a joint at rest
    follows: tuple[float, float] = (0.7, 1.25)  # travel of a joint relative to that of its target
    shaking_rad_s: float = 0.5  # rms deviation of a joint's velocity from its mean over `shaking_s`
    shaking_s: float = 0.1
    torque_share: float = 0.6  # share of the peak torque for 99 % of the time
    temperature_c: float = 60.0  # largest temperature of a motor
    tilt_rad: float = 0.1  # largest tilt of the base while standing
    carries: tuple[float, float] = (0.6, 1.5)  # weight by the legs' torques, relative to the robot's
    min_leg_share: float = 0.3  # smallest load of a leg, relative to an equal share of the weight
    tilts: tuple[float, float] = (0.6, 1.4)  # tilt by the IMU relative to tilt by the joints
    uneven_tilt_rad: float = 0.35  # largest tilt of the base on uneven ground

    def __post_init__(self) -> None:
        require_between(self, 0.001, 3.2, "lost_rad", "still_rad", "tilt_rad", "uneven_tilt_rad")
        require_between(self, 0.01, 10.0, "follows", "shaking_rad_s", "shaking_s", "carries", "tilts")
        require_between(self, 0.001, 1.0, "torque_share", "min_leg_share")
        require_between(self, 30.0, 150.0, "temperature_c")


@dataclass(frozen=True)
class BringUpConfig:
    """Motions of the steps."""

    hold_s: float = 2.0
    move_rad: float = 0.15  # travel of each joint, towards the middle of its range
    move_s: float = 1.5  # duration of a motion and its return
    sway_rad: float = 0.08  # tilt of the base, sideways and forward
    slew_s: float = 3.0  # duration of the fade from standing to the policy
    walk_s: float = 8.0
    uneven_m: float = 0.02  # height of the obstacles in the last step
    limits: BringUpLimits = field(default_factory=BringUpLimits)

    def __post_init__(self) -> None:
        require_between(self, 0.5, 60.0, "hold_s", "move_s", "walk_s")
        require_between(self, 0.0, 60.0, "slew_s")
        require_between(self, 0.01, 1.0, "move_rad", "sway_rad")
        require_between(self, 0.0, 0.2, "uneven_m")
