"""Requests of the command source: polled, checked, clipped to the current policy's ranges."""

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.command_source import (
    ZERO_COMMAND,
    Behaviour,
    CommandSource,
    Offer,
    Request,
    Scheduled,
    Status,
    Stop,
    StopSource,
)
from footfall.deploy.commands import CommandLimits
from footfall.deploy.orders import Order, OrderKind
from footfall.policies.live_settings import DECLARED, Span, Steerable, require_steerable
from footfall.policies.policy import Policy
from footfall.robots.commands import CommandRange

NO_GET_UP = "this run has no policy for getting up: start it with --recover"
POLL_EVERY_US = 20_000  # while the policy is not in control


class Run(Protocol):
    """Current state of a run."""

    @property
    def walking_s(self) -> float:
        """Time since the start of walking."""

    @property
    def battery(self) -> BatteryState:
        """State of the battery."""

    @property
    def status(self) -> Status:
        """Complete status."""


class Steering:
    """Latest request of a run's source, and a stop requested by any of its stop sources."""

    def __init__(
        self,
        source: CommandSource,
        policies: Sequence[Policy],
        stop_sources: Sequence[StopSource] = (),
        fallback: CommandRange | None = None,
        get_up: str = "",
    ) -> None:
        """Start without a request.

        Args:
            source: source of commands.
            policies: selectable policies; starts with the first one.
            stop_sources: further sources of stops.
            fallback: the robot's command ranges, which are reduced for a low battery if the policy has none.
            get_up: name of the policy for getting up after a fall; empty for none.
        """
        self._source, self._stop_sources = source, (source, *stop_sources)
        self._velocity = source.velocity if isinstance(source, Scheduled) else None
        self.notes: list[str] = []  # what was refused, clipped or changed, one line each; only ever grows
        names = tuple(policy.name for policy in policies)
        self._offers = {
            policy.name: offer_of(policy)._replace(policies=names, get_up=get_up) for policy in policies
        }
        self._all_limits = {
            name: CommandLimits(offer.commands, self.notes, fallback) for name, offer in self._offers.items()
        }
        self._request, self._checked = Request(ZERO_COMMAND, autonomous=self._velocity is not None), True
        self._changes: list[Change] = []
        self._orders: list[Order] = []
        self.requested_command = ZERO_COMMAND  # of the latest request, before clipping
        self.command = ZERO_COMMAND  # (3,) within the current policy's ranges
        self._stop: Stop | None = None
        self._next_us = 0
        self.serve(names[0])

    def serve(self, policy: str) -> None:
        """Switch to a policy, with its own gait and settings until the next `poll`."""
        self._policy = self._requested = policy
        self.offer, self._limits = self._offers[policy], self._all_limits[policy]
        self._gait, self._settings = "", dict[str, float]()  # requested values
        self._checked = False

    @property
    def autonomous(self) -> bool:
        """Whether a program gives the commands, not a person."""
        return self._request.autonomous

    @property
    def lie_down(self) -> bool:
        """Whether the source requests the end of the run."""
        return self._request.behaviour is Behaviour.LIE_DOWN

    @property
    def get_up(self) -> bool:
        """Whether the source requests that a fallen robot get up."""
        return self._request.behaviour is Behaviour.GET_UP

    @property
    def stop(self) -> Stop | None:
        """The stop, latched; None if there was none. One with damping overrides one without."""
        if self._stop is None or not self._stop.damp:
            for source in self._stop_sources:
                stop = source.stopped
                if stop is not None and (self._stop is None or stop.damp):
                    self._stop = stop
                    kind = OrderKind.DAMP if stop.damp else OrderKind.STOP
                    self._orders.append(Order(kind, stop.by, stop.reason))
        return self._stop

    def due(self, now_us: int) -> bool:
        """Whether to poll while the policy is not in control."""
        return now_us >= self._next_us

    def poll(self, now_us: int, run: Run, follow: bool) -> None:
        """Get the latest request; without `follow` the command is zero and nothing changes.

        Args:
            now_us: time of the loop.
            run: its current state. A function of time is called without a status, which would take a
                noticeable part of a tick in lockstep.
            follow: whether the robot is walking.
        """
        self._next_us = now_us + POLL_EVERY_US
        if self._velocity is not None:
            self._follow(self._velocity(run.walking_s) if follow else ZERO_COMMAND, run)
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
        self._follow(
            request.velocity if follow and request.behaviour is Behaviour.WALK else ZERO_COMMAND, run
        )

    def _follow(self, velocity: np.ndarray, run: Run) -> None:
        self.requested_command = np.asarray(velocity, dtype=float)
        self.command = self._limits.apply(self.requested_command)
        allowed = run.battery.allowed
        if allowed < 1.0:
            self.note("the battery is low: speed and torque are limited")
            self.command = self._limits.reduce(self.command, allowed)

    def refresh(self, policy: Policy) -> None:
        """Update the ranges, which may depend on the current policy's gait."""
        before = self.offer
        self.offer = offer_of(policy)._replace(policies=before.policies, get_up=before.get_up)
        self._offers[policy.name] = self.offer

    def take_changes(self) -> list[Change]:
        """Changes by requests since the last call."""
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
        if request.behaviour is not before.behaviour:
            self._orders.append(Order(OrderKind(request.behaviour), owner))

    def _check(self, request: Request) -> None:
        """Find what a request changes; refuse what is unavailable in this run."""
        requested = request.policy or self._requested
        if requested not in self._offers:
            self.note(f"there is no policy '{requested}' in this run: it has {', '.join(self._offers)}")
            requested = self._requested
        if requested != self._requested:
            self._requested = requested
            self._changes.append(Change(policy=requested, by=request.owner))
        if requested != self._policy:
            return  # gait and settings are for the next policy
        if request.gait and request.gait != self._gait:
            self._gait = request.gait
            if request.gait in self.offer.gaits:
                self._changes.append(Change(gait=request.gait, by=request.owner))
            else:
                has = ", ".join(self.offer.gaits) or "no other gait"
                self.note(f"there is no gait '{request.gait}' of {self._policy}: it has {has}")
        if settings := self._new_settings(request.settings):
            self._changes.append(Change(settings=settings, by=request.settings_by or request.owner))

    def _new_settings(self, requested: Mapping[str, float]) -> dict[str, float]:
        """Values that changed, each clipped to its range."""
        new = {}
        for name, value in requested.items():
            if self._settings.get(name) == value:
                continue
            span = self.offer.settings.get(name)
            if span is None:
                has = ", ".join(self.offer.settings) or "none"
                self.note(f"there is no setting '{name}' of {self._policy}: it has {has}")
            elif not math.isfinite(value):
                self.note(f"{name} of {value:g} is refused: it is not a number")
            else:
                new[name] = self._clipped(name, value, span)
            self._settings[name] = value
        return new

    def _clipped(self, name: str, value: float, span: Span) -> float:
        clipped = min(max(float(value), span.lowest), span.highest)
        if clipped != value:
            unit = DECLARED[name].unit
            self.note(
                f"{name} of {self._policy} goes from {span.lowest:g} to {span.highest:g} {unit}:"
                f" {value:g} became {clipped:g}"
            )
        return clipped

    def note(self, note: str) -> None:
        """Add a line to the run's notes unless it is there already."""
        if note not in self.notes:
            self.notes.append(note)


def offer_of(policy: Policy) -> Offer:
    """What this policy offers to operators, as the only one of a run.

    Raises:
        UserError: see `require_steerable`.
    """
    commands = None if policy.contract is None else policy.contract.commands
    require_steerable(policy, policy.name)
    if not isinstance(policy, Steerable):
        return Offer((policy.name,), commands=commands)
    return Offer((policy.name,), policy.gaits, policy.live_settings, commands)
