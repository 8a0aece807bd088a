"""What the command source asks for: polled, checked, clipped to what the present policy takes."""

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.command_source import (
    CommandSource,
    Offer,
    Request,
    Scheduled,
    Status,
    Stop,
    StopSource,
    Wish,
)
from footfall.deploy.commands import CommandLimits
from footfall.deploy.orders import Order, OrderKind
from footfall.policies.live_settings import DECLARED, Span, Steerable, require_steerable
from footfall.policies.policy import Policy
from footfall.robots.commands import CommandRange

STILL = np.zeros(3)
NO_GET_UP = "this run has no policy that gets the robot up: start it with --recover"
POLL_EVERY_US = 20_000  # while the policy does not decide


class Run(Protocol):
    """A run as it is now."""

    @property
    def walking_s(self) -> float:
        """Time since walking began."""

    @property
    def battery(self) -> BatteryState:
        """What is known of the battery."""

    @property
    def status(self) -> Status:
        """All of it."""


class Steering:
    """The newest request of a run's source, and the stop that any of its stop sources asked for."""

    def __init__(
        self,
        source: CommandSource,
        policies: Sequence[Policy],
        stop_sources: Sequence[StopSource] = (),
        usual: CommandRange | None = None,
        get_up: str = "",
    ) -> None:
        """Nothing has been asked for.

        Args:
            source: says what the run shall do.
            policies: those that may decide; the first one does.
            stop_sources: further ones that can stop the robot.
            usual: the robot's ranges of commands, which a low battery reduces if the policy has none.
            get_up: name of the policy that gets the robot up after a fall; empty for none.
        """
        self._source, self._stop_sources = source, (source, *stop_sources)
        self._velocity = source.velocity if isinstance(source, Scheduled) else None
        self.notes: list[str] = []  # what was refused, clipped or changed, one line each; it only grows
        names = tuple(policy.name for policy in policies)
        self._offers = {
            policy.name: offer_of(policy)._replace(policies=names, get_up=get_up) for policy in policies
        }
        self._all_limits = {
            name: CommandLimits(offer.commands, self.notes, usual) for name, offer in self._offers.items()
        }
        self._request, self._checked = Request(STILL, autonomous=self._velocity is not None), True
        self._changes: list[Change] = []
        self._orders: list[Order] = []
        self.asked_command = STILL  # of the newest request, before it was clipped
        self.command = STILL  # (3,) within the present policy's ranges
        self._stop: Stop | None = None
        self._next_us = 0
        self.serve(names[0])

    def serve(self, policy: str) -> None:
        """This policy decides from now on, with its own gait and settings until the next `poll`."""
        self._policy = self._wanted = policy
        self.offer, self._limits = self._offers[policy], self._all_limits[policy]
        self._gait, self._settings = "", dict[str, float]()  # that were asked of it
        self._checked = False

    @property
    def autonomous(self) -> bool:
        """Whether a program steers, not a person."""
        return self._request.autonomous

    @property
    def lie_down(self) -> bool:
        """Whether the source wants the run to end."""
        return self._request.wish is Wish.LIE_DOWN

    @property
    def get_up(self) -> bool:
        """Whether the source wants a robot that fell to get up."""
        return self._request.wish is Wish.GET_UP

    @property
    def stop(self) -> Stop | None:
        """The latched stop; None if nobody asked for one. One that damps outranks one that does not."""
        if self._stop is None or not self._stop.damp:
            for source in self._stop_sources:
                stop = source.stopped
                if stop is not None and (self._stop is None or stop.damp):
                    self._stop = stop
                    kind = OrderKind.DAMP if stop.damp else OrderKind.STOP
                    self._orders.append(Order(kind, stop.by, stop.reason))
        return self._stop

    def due(self, now_us: int) -> bool:
        """Whether to poll while the policy does not decide."""
        return now_us >= self._next_us

    def poll(self, now_us: int, run: Run, follow: bool) -> None:
        """Take the newest request; without `follow` the command is zero and nothing changes.

        Args:
            now_us: the loop's time.
            run: as it is. A function of time is asked without a status: to make one would take a noticeable
                part of a tick in lockstep.
            follow: whether the robot walks.
        """
        self._next_us = now_us + POLL_EVERY_US
        if self._velocity is not None:
            self._follow(self._velocity(run.walking_s) if follow else STILL, run)
            return
        request = self._source.poll(run.status)
        if request is not self._request:
            self._note_orders(request)
            self._request, self._checked = request, False
            if request.note:
                self.note(request.note)
            if self.get_up and not self.offer.get_up:
                self.note(NO_GET_UP)
        if follow and not self._checked:
            self._checked = True
            self._check(request)
        self._follow(request.velocity if follow and request.wish is Wish.WALK else STILL, run)

    def _follow(self, velocity: np.ndarray, run: Run) -> None:
        self.asked_command = np.asarray(velocity, dtype=float)
        self.command = self._limits.apply(self.asked_command)
        allowed = run.battery.allowed
        if allowed < 1.0:
            self.note("the battery is low: speed and torque are limited")
            self.command = self._limits.reduce(self.command, allowed)

    def refresh(self, policy: Policy) -> None:
        """Ranges may have changed with the gait of the present policy."""
        before = self.offer
        self.offer = offer_of(policy)._replace(policies=before.policies, get_up=before.get_up)
        self._offers[policy.name] = self.offer

    def take_changes(self) -> list[Change]:
        """What the request changed since the last call."""
        changes, self._changes = self._changes, []
        return changes

    def take_orders(self) -> list[Order]:
        """Orders since the last call."""
        orders, self._orders = self._orders, []
        return orders

    def _note_orders(self, request: Request) -> None:
        before, owner = self._request, request.owner
        if owner != before.owner:
            self._orders.append(Order(OrderKind.STEER, owner))
        if request.wish is not before.wish:
            self._orders.append(Order(OrderKind(request.wish), owner))

    def _check(self, request: Request) -> None:
        """Find what a request changes; refuse what this run does not have."""
        wanted = request.policy or self._wanted
        if wanted not in self._offers:
            self.note(f"there is no policy '{wanted}' in this run: it has {', '.join(self._offers)}")
            wanted = self._wanted
        if wanted != self._wanted:
            self._wanted = wanted
            self._changes.append(Change(policy=wanted, by=request.owner))
        if wanted != self._policy:
            return  # gait and settings are for the policy that comes
        if request.gait and request.gait != self._gait:
            self._gait = request.gait
            if request.gait in self.offer.gaits:
                self._changes.append(Change(gait=request.gait, by=request.owner))
            else:
                has = ", ".join(self.offer.gaits) or "no choice"
                self.note(f"there is no gait '{request.gait}' of {self._policy}: it has {has}")
        if settings := self._new_settings(request.settings):
            self._changes.append(Change(settings=settings, by=request.settings_by or request.owner))

    def _new_settings(self, asked: Mapping[str, float]) -> dict[str, float]:
        """The values that differ from those before, each within its range."""
        new = {}
        for name, value in asked.items():
            if self._settings.get(name) == value:
                continue
            span = self.offer.settings.get(name)
            if span is None:
                has = ", ".join(self.offer.settings) or "none"
                self.note(f"there is no setting '{name}' of {self._policy}: it has {has}")
            elif not math.isfinite(value):
                self.note(f"{name} of {value:g} is refused: it is no number")
            else:
                new[name] = self._clipped(name, value, span)
            self._settings[name] = value
        return new

    def _clipped(self, name: str, value: float, span: Span) -> float:
        inside = min(max(float(value), span.lowest), span.highest)
        if inside != value:
            unit = DECLARED[name].unit
            self.note(
                f"{name} of {self._policy} goes from {span.lowest:g} to {span.highest:g} {unit}:"
                f" {value:g} became {inside:g}"
            )
        return inside

    def note(self, note: str) -> None:
        """Add a line to the run's notes, once."""
        if note not in self.notes:
            self.notes.append(note)


def offer_of(policy: Policy) -> Offer:
    """What a run takes while this policy decides, which is the only one.

    Raises:
        UserError: see `require_steerable`.
    """
    commands = None if policy.contract is None else policy.contract.commands
    require_steerable(policy, policy.name)
    if not isinstance(policy, Steerable):
        return Offer((policy.name,), commands=commands)
    return Offer((policy.name,), policy.gaits, policy.live_settings, commands)
