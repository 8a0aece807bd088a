"""Selection of the policy, and handover between policies during a run.

Two policies place their feet at different times, so the handover happens while the robot stands: the current
policy stops, then both act for a moment while the weight of the next one grows, then the next one
continues. It depends only on the policies' inputs and the requested changes, so a replay repeats it.
After a fall the get-up policy takes over immediately, and so does the walking policy once the robot
stands.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between
from footfall.common.easing import smooth_rise
from footfall.common.errors import UserError
from footfall.deploy.changes import Change
from footfall.deploy.timed_policy import TimedPolicy
from footfall.policies.live_settings import Steerable
from footfall.policies.policy import Policy, PolicyInput


@dataclass(frozen=True)
class HandoverConfig:
    """Durations of a handover."""

    still_s: float = 0.8  # at zero command before the next policy starts
    wait_s: float = 5.0  # longest time until all feet are in contact, by the policy's plan
    blend_s: float = 0.3  # time in which the weight of the next policy grows from 0 to 1

    def __post_init__(self) -> None:
        require_between(self, 0.0, 60.0, "still_s", "wait_s")
        require_between(self, 0.02, 10.0, "blend_s")


class Handover:
    """Policies of a run: the current one, and the next one during a handover."""

    def __init__(
        self, policies: Sequence[Policy], config: HandoverConfig | None = None, get_up: Policy | None = None
    ) -> None:
        """The first policy starts; `get_up` acts only after a change that names it.

        Raises:
            UserError: two policies have the same name.
        """
        self._config = config or HandoverConfig()
        all_policies = [*policies, *([] if get_up is None else [get_up])]
        self._timed = {policy.name: TimedPolicy(policy) for policy in all_policies}
        if len(self._timed) < len(all_policies):
            names = ", ".join(policy.name for policy in all_policies)
            raise UserError(f"policies of a run need different names: {names}")
        self.policies = tuple(policies)
        self.begin()

    def begin(self) -> None:
        """Start walking with the first policy."""
        self.current = self._timed[self.policies[0].name]
        self.current.begin(0)
        self._next: TimedPolicy | None = None  # requested policy
        self._blends_since_us: int | None = None
        self._requested_us = self._last_moving_us = 0

    @property
    def leaving(self) -> bool:
        """Whether the current policy hands over."""
        return self._next is not None

    @property
    def acting(self) -> tuple[TimedPolicy, ...]:
        """Policies that act now: the current one, and the next one during the blend."""
        if self._next is None or self._blends_since_us is None:
            return (self.current,)
        return self.current, self._next

    @property
    def period_us(self) -> float:
        """Time between two policy steps."""
        return min(timed.period_us for timed in self.acting)

    def apply(self, change: Change, now_us: int) -> None:
        """Apply a change. Its names and values have been checked."""
        policy = self.current.policy
        if change.at_once:
            self.current, self._next, self._blends_since_us = self._timed[change.policy], None, None
            self.current.begin(now_us)
            return
        if change.policy and self._blends_since_us is None:  # a handover that has begun is finished
            requested = self._timed[change.policy]
            self._next, self._requested_us = (None if requested is self.current else requested), now_us
        if change.gait and isinstance(policy, Steerable):
            policy.take_up(change.gait)
        if change.settings and isinstance(policy, Steerable):
            policy.set_live(change.settings)

    def due(self, now_us: int) -> bool:
        """Whether a policy step is due."""
        if self._next is None:
            return self.current.due(now_us)
        return any(policy.due(now_us) for policy in self.acting)

    def step(self, now_us: int, inputs: PolicyInput) -> np.ndarray:
        """One step of the acting policies whose step is due. Returns the decision (5, n).

        Args:
            now_us: time since the start of walking.
            inputs: the command must be zero while `leaving`.
        """
        if len(self.policies) == 1:
            return self.current.act(now_us, inputs)
        if np.count_nonzero(inputs.command):
            self._last_moving_us = now_us
        if self._next is not None and self._blends_since_us is None and self._ready(now_us):
            self._blends_since_us = now_us
            self._next.begin(now_us)
        decisions = []
        for timed in self.acting:
            if timed.due(now_us):
                timed.act(now_us, inputs)
            assert timed.decision is not None
            decisions.append(timed.decision)
        if self._next is None or self._blends_since_us is None:
            return decisions[0]
        share = (now_us - self._blends_since_us) * 1e-6 / self._config.blend_s
        if share >= 1.0:
            self.current, self._next, self._blends_since_us = self._next, None, None
            return decisions[1]
        return blended(decisions[0], decisions[1], smooth_rise(share))

    def stance(self) -> np.ndarray | None:
        """Planned contact of the acting policies, (feet,): minimum for each foot; None if one has no plan."""
        plans = [timed.policy.stance() for timed in self.acting if timed.decision is not None]
        if len(plans) == 1:
            return plans[0]
        known = [plan for plan in plans if plan is not None]
        return np.minimum(*known) if len(known) == 2 else None

    def _ready(self, now_us: int) -> bool:
        """Whether the robot stands, so that the next policy can start."""
        config = self._config
        if now_us - self._last_moving_us < config.still_s * 1e6:
            return False
        plan = self.current.policy.stance()
        stands = plan is None or bool(np.min(plan) >= 1.0)
        return stands or now_us - self._requested_us >= (config.still_s + config.wait_s) * 1e6


def blended(first: np.ndarray, second: np.ndarray, share: float) -> np.ndarray:
    """Joint command between two commands, each (5, n), whose torque is the weighted mean of both torques.

    Gains and torque are means; a target is the mean weighted by the gains, too. So the torque law kp (q* - q)
    + kd (v* - v) + t is the mean of both laws at any position and velocity.
    """
    weights = np.array([1.0 - share, share])
    both = np.array([first, second])
    result = np.einsum("p,prj->rj", weights, both)
    for row, gain in ((0, 2), (1, 3)):
        has_gain = result[gain] > 0.0
        weighted_targets = np.einsum("p,pj->j", weights, both[:, gain] * both[:, row])
        np.divide(weighted_targets, result[gain], out=result[row], where=has_gain)
    return result
