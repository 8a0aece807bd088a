"""Settings of the step controller."""

from dataclasses import dataclass

from footfall.common.config import require_between, require_not_negative, require_positive
from footfall.policies.controllers.command import CommandShaping
from footfall.policies.controllers.step.footsteps import StepLimits, StepWeights
from footfall.policies.controllers.whole_body.control import WholeBodyConfig
from footfall.policies.controllers.whole_body.feedback import Feedback
from footfall.policies.policy import RATES_HZ


@dataclass(frozen=True)
class Gait:
    """Steady gait, and limits and costs of deviations from it."""

    step_s: float  # from touch-down to touch-down
    double_support_s: float  # duration of the double support at the start of a step
    apart_m: float  # lateral distance between the middles of the feet
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

    lift_m: float  # largest height above the ground
    depth_m: float  # depth below the ground at which a swing ends
    place: Feedback  # feedback on the foot's position
    attitude: Feedback

    def __post_init__(self) -> None:
        require_positive(self, "lift_m")
        require_not_negative(self, "depth_m")


@dataclass(frozen=True)
class Pressure:
    """Steering of the capture point by the centre of pressure."""

    gain: float  # per distance of the capture point from its reference
    half_length_m: float  # largest forward distance from the middle of a single foot
    half_width_m: float  # ... sideways
    max_lead_m: float  # ... and from the middle of both feet

    def __post_init__(self) -> None:
        require_positive(self, "half_length_m", "half_width_m", "max_lead_m")
        require_not_negative(self, "gain")


@dataclass(frozen=True)
class Start:
    """Conditions and timing of the first step."""

    capture_m: float  # distance of the capture point from the middle of the feet that triggers a step
    # Lateral distance of the capture point to the stance foot at which the other foot lifts off. After a step
    # the robot stops walking only if the distance of the feet along the heading is smaller.
    near_m: float
    max_s: float  # longest duration of the shift before lift-off
    urgent_m: float  # distance of the capture point ahead or behind that ends the shift at once

    def __post_init__(self) -> None:
        require_positive(self, "capture_m", "near_m", "max_s", "urgent_m")


@dataclass(frozen=True)
class StepConfig:
    """Gait and gains of `Step`."""

    rate_hz: float
    command: CommandShaping
    gait: Gait
    swing: SwingConfig
    pressure: Pressure
    start: Start
    lower_m: float  # lowering of the centre of mass below the default pose, so that no knee is stretched
    height: Feedback
    attitude: Feedback
    posture: Feedback
    momentum_damping: float  # 1/s
    max_force: float  # of a foot, shared equally by its contact points, over the robot's weight
    settle_s: float  # time until the height is reached
    whole_body: WholeBodyConfig

    def __post_init__(self) -> None:
        require_between(self, *RATES_HZ, "rate_hz")
        require_positive(self, "max_force", "settle_s")
        require_not_negative(self, "lower_m", "momentum_damping")
