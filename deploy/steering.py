"""What the command source asks for: polled, checked, clipped to what the policy was trained for."""

import math
from collections.abc import Sequence

import numpy as np

from footfall.deploy.command_source import (
    CommandSource,
    Offer,
    Request,
    Status,
    Stop,
    StopSource,
    Wish,
)
from footfall.deploy.commands import CommandLimits
from footfall.policies.live_settings import DECLARED, Steerable
from footfall.policies.policy import Policy

STILL = np.zeros(3)
POLL_EVERY_US = 20_000  # while the policy does not decide


class Steering:
    """The newest request of a run's source, and the stop that any of its stop sources asked for."""

    def __init__(
        self, source: CommandSource, policy: Policy, stop_sources: Sequence[StopSource] = ()
    ) -> None:
        """Nothing has been asked for.

        Args:
            source: says what the run shall do.
            policy: that decides.
            stop_sources: further ones that can stop the robot.
        """
        self._source, self._stop_sources = source, (source, *stop_sources)
        self.notes: list[str] = []  # what was refused, clipped or changed, one line each; it only grows
        self.offer = offer_of(policy)
        self._limits = CommandLimits(self.offer.commands, self.notes)
        self._request = Request(STILL)
        self.asked_command = STILL  # of the newest request, before it was clipped
        self.command = STILL  # (3,) that the policy is given
        self._stop: Stop | None = None
        self._next_us = 0

    @property
    def lie_down(self) -> bool:
        """Whether the source wants the run to end."""
        return self._request.wish is Wish.LIE_DOWN

    @property
    def stop(self) -> Stop | None:
        """The latched stop; None if nobody asked for one. One that damps outranks one that does not."""
        if self._stop is None or not self._stop.damp:
            for source in self._stop_sources:
                stop = source.stopped
                if stop is not None and (self._stop is None or stop.damp):
                    self._stop = stop
        return self._stop

    def due(self, now_us: int) -> bool:
        """Whether to poll while the policy does not decide."""
        return now_us >= self._next_us

    def poll(self, now_us: int, status: Status, follow: bool) -> None:
        """Take the newest request; without `follow` the command is zero, whatever it asks for."""
        self._next_us = now_us + POLL_EVERY_US
        request = self._source.poll(status)
        if request is not self._request:
            self._request = request
            self._check(request)
        if not follow or request.wish is not Wish.WALK:
            self.asked_command = self.command = STILL
            return
        self.asked_command = np.asarray(request.velocity, dtype=float)
        self.command = self._limits.apply(self.asked_command)

    def _check(self, request: Request) -> None:
        """Take the request's note; refuse names that this run does not have."""
        if request.note:
            self._note(request.note)
        offer = self.offer
        if request.policy and request.policy not in offer.policies:
            self._note(f"there is no policy '{request.policy}' in this run: {', '.join(offer.policies)}")
        if request.gait and request.gait not in offer.gaits:
            known = ", ".join(offer.gaits) or "it has one only"
            self._note(f"there is no gait '{request.gait}' of the present policy: {known}")
        for name, value in request.settings.items():
            if name not in offer.settings:
                known = ", ".join(offer.settings) or "it has none"
                self._note(f"there is no setting '{name}' of the present policy: {known}")
            elif not math.isfinite(value):
                self._note(f"{name} {value:g} {DECLARED[name].unit} is refused: it is no number")

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def offer_of(policy: Policy) -> Offer:
    """What a run takes while this policy decides, which is the only one."""
    contract = policy.contract
    steerable = policy if isinstance(policy, Steerable) else None
    return Offer(
        (policy.name,),
        () if steerable is None else steerable.gaits,
        {} if steerable is None else steerable.live_settings,
        None if contract is None else contract.commands,
    )
