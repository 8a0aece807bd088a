"""Settings of the step controller."""

from dataclasses import dataclass

from footfall.common.config import require_not_negative, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.step.footsteps import StepLimits, StepWeights
from footfall.policies.controllers.whole_body.control import WholeBodyConfig
from footfall.policies.controllers.whole_body.feedback import Feedback


@dataclass(frozen=True)
class Gait:
    """The steady gait, and how far the next step may differ from it."""

    step_s: float  # from touch-down to touch-down
    double_support_s: float  # of it, both feet bearing
    apart_m: float  # middle to middle of the feet, sideways
    limits: StepLimits
    weights: StepWeights

    def __post_init__(self) -> None:
        require_positive(self, "step_s", "apart_m")
        require_positive(self, "double_support_s")
        if self.double_support_s >= self.step_s:
            raise ValueError("double_support_s must be below step_s")


@dataclass(frozen=True)
class SwingConfig:
    """Motion of the swing foot."""

    lift_m: float
    depth_m: float  # depth below the ground at which a landing foot aims
    place: Feedback
    attitude: Feedback

    def __post_init__(self) -> None:
        require_positive(self, "lift_m")
        require_not_negative(self, "depth_m")


@dataclass(frozen=True)
class Pressure:
    """How the centre of pressure steers the capture point."""

    gain: float  # per distance of the capture point from its reference
    half_length_m: float  # how far it may move from the middle of a single foot, forward
    half_width_m: float  # and sideways
    most_lead_m: float  # and from the middle of both feet

    def __post_init__(self) -> None:
        require_positive(self, "half_length_m", "half_width_m", "most_lead_m")
        require_not_negative(self, "gain")


@dataclass(frozen=True)
class Start:
    """When a standing robot begins to step, and how."""

    capture_m: float  # a capture point further than this from the middle of the feet calls for a step
    near_m: float  # lateral distance to the standing foot at which the other foot is lifted
    most_s: float  # the foot is lifted after this time at the latest
    urgent_m: float  # a capture point this far ahead or behind does not wait for that

    def __post_init__(self) -> None:
        require_positive(self, "capture_m", "near_m", "most_s", "urgent_m")


@dataclass(frozen=True)
class StepConfig:
    """Gait and gains of `Step`."""

    rate_hz: float
    command: CommandShaping
    gait: Gait
    swing: SwingConfig
    pressure: Pressure
    start: Start
    lower_m: float  # of the centre of mass, against the default pose: so that no knee has to stretch
    height: Feedback
    attitude: Feedback
    posture: Feedback
    momentum_damping: float  # 1/s
    most_force: float  # of a foot, evenly shared by its points, as a share of the weight
    settle_s: float  # time to reach the height
    whole_body: WholeBodyConfig

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "most_force", "settle_s")
        require_not_negative(self, "lower_m", "momentum_damping")
