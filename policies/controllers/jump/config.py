"""Settings of `Jump`, one dataclass per part."""

from dataclasses import dataclass

from footfall.common.config import require_not_negative, require_positive
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.whole_body.control import WholeBodyConfig
from footfall.policies.controllers.whole_body.feedback import Feedback


@dataclass(frozen=True)
class JointGains:
    """Impedance of all joints around a moving target."""

    kp: float  # N m/rad
    kd: float  # N m s/rad

    def __post_init__(self) -> None:
        require_positive(self, "kp")
        require_not_negative(self, "kd")


@dataclass(frozen=True)
class Leap:
    """Goal of a jump, and how the robot leaves the ground. Heights are the base's above the ground."""

    rise_m: float  # rise of the base at the apex, above its height in stance
    ahead_m: float  # distance from stance to stance
    crouch_m: float  # height of the base in the crouch
    crouch_s: float  # duration of the crouch
    back_m: float  # shift of the base in the crouch, backward
    take_off_m: float  # height of the base at take-off

    def __post_init__(self) -> None:
        require_positive(self, "rise_m", "crouch_m", "crouch_s", "take_off_m")
        require_not_negative(self, "ahead_m", "back_m")
        if not self.crouch_m < self.take_off_m:
            raise ValueError(f"take_off_m {self.take_off_m:g} has to be above crouch_m {self.crouch_m:g}")


@dataclass(frozen=True)
class Push:
    """Control of the planned motion while the feet stand."""

    centre: Feedback
    attitude: Feedback
    max_force_n: float  # largest upward force of a foot

    def __post_init__(self) -> None:
        require_positive(self, "max_force_n")


@dataclass(frozen=True)
class Landing:
    """Positions of the feet at touch-down, and compliance of the legs."""

    height_m: float  # height of the base at touch-down
    feet_ahead_m: float  # shift of the feet's middle at touch-down, forward, relative to the stance
    gains: JointGains
    lasts_s: float  # from the expected touch-down until the stance controller takes over

    def __post_init__(self) -> None:
        require_positive(self, "height_m", "lasts_s")


@dataclass(frozen=True)
class JumpConfig:
    """Settings of `Jump`."""

    leap: Leap
    push: Push
    tuck_m: float  # lift of the feet relative to the base in mid-flight
    air: JointGains
    landing: Landing
    settle_s: float  # time in stance between two jumps, and before the first one
    plan: MpcConfig  # controller for the stance
    whole_body: WholeBodyConfig  # controller for the push

    def __post_init__(self) -> None:
        require_positive(self, "settle_s")
        require_not_negative(self, "tuck_m")
        apex_m = self.plan.stance.height_m + self.leap.rise_m
        for name, height_m in (
            ("leap.take_off_m", self.leap.take_off_m),
            ("landing.height_m", self.landing.height_m),
        ):
            if height_m >= apex_m:
                raise ValueError(f"{name} must be below plan.stance.height_m plus leap.rise_m, {apex_m:g}")
