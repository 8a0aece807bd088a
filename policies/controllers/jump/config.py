"""Settings of `Jump`, one dataclass per part."""

from dataclasses import dataclass

from footfall.common.config import require_not_negative, require_positive
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.whole_body.control import WholeBodyConfig
from footfall.policies.controllers.whole_body.feedback import Feedback


@dataclass(frozen=True)
class JointGains:
    """Impedance of all joints about a moving target."""

    kp: float  # N m/rad
    kd: float  # N m s/rad

    def __post_init__(self) -> None:
        require_positive(self, "kp")
        require_not_negative(self, "kd")


@dataclass(frozen=True)
class Leap:
    """What a jump shall reach, and how it leaves the ground. Heights are the base's above the ground."""

    rise_m: float  # of the base at the top, above its height in stance
    ahead_m: float  # from stance to stance
    crouch_m: float  # height
    crouch_s: float  # how long it takes to crouch
    back_m: float  # of the base while it crouches, behind its place above the feet
    take_off_m: float  # height with which the feet leave the ground

    def __post_init__(self) -> None:
        require_positive(self, "rise_m", "crouch_m", "crouch_s", "take_off_m")
        require_not_negative(self, "ahead_m", "back_m")
        if not self.crouch_m < self.take_off_m:
            raise ValueError(f"take_off_m {self.take_off_m:g} has to be above crouch_m {self.crouch_m:g}")


@dataclass(frozen=True)
class Push:
    """How the planned motion is followed while the feet stand."""

    centre: Feedback
    attitude: Feedback
    most_force_n: float  # upward, of each foot

    def __post_init__(self) -> None:
        require_positive(self, "most_force_n")


@dataclass(frozen=True)
class Landing:
    """Where the feet are when they touch down, and how the legs take the fall."""

    height_m: float  # of the base
    feet_ahead_m: float  # of the feet's middle from the base's place above it in stance
    gains: JointGains
    lasts_s: float  # from the expected touch-down until the stance takes over

    def __post_init__(self) -> None:
        require_positive(self, "height_m", "lasts_s")


@dataclass(frozen=True)
class JumpConfig:
    """Settings of `Jump`."""

    leap: Leap
    push: Push
    tuck_m: float  # how far the feet are drawn up in the middle of the flight
    air: JointGains
    landing: Landing
    settle_s: float  # stance between two jumps, and before the first one
    plan: MpcConfig  # of the stance
    whole_body: WholeBodyConfig  # of the push

    def __post_init__(self) -> None:
        require_positive(self, "settle_s")
        require_not_negative(self, "tuck_m")
        if self.leap.take_off_m >= self.plan.stance.height_m + self.leap.rise_m:
            raise ValueError("leap.rise_m: the base would be that high before the feet leave the ground")
