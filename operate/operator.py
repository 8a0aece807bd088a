"""A person with keys or buttons, which are translated to requests in the inbox."""

from collections.abc import Callable, Sequence

from footfall.deploy.command_source import Behaviour
from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox

BODY_HEIGHT = "body_height_m"
ZERO_MOTION = (0.0, 0.0, 0.0)


class Operator:
    """Sends requests to the inbox under one name. The results are shown in `line`."""

    def __init__(self, name: str, inbox: Inbox, abilities: Callable[[str], Abilities]) -> None:
        """`abilities`: returns the abilities of a policy of the run by its name."""
        self._name, self._inbox, self._abilities = name, inbox, abilities
        self._result = self._velocity_refusal = ""
        self._gait = ""  # requested last; empty before a request for the current policy
        self._height_m: float | None = None  # requested last, None before a request for the current policy

    @property
    def line(self) -> str:
        """Why the last velocity was refused, or the result of the last request."""
        return self._velocity_refusal or self._result

    def move(self, shares: Sequence[float]) -> None:
        """Request shares (3,), from -1 to 1, of the current policy's maximum commands."""
        velocity, status = list(ZERO_MOTION), self._inbox.status
        if status is not None and any(shares):
            ranges = vars(self._abilities(status.policy).limits.ranges).values()
            velocity = [
                share * high if share > 0.0 else -share * low
                for share, (low, high) in zip(shares, ranges, strict=True)
            ]
        self._velocity_refusal = self._inbox.put(self._name, velocity=velocity)

    def request(self, behaviour: Behaviour) -> None:
        """Request a behaviour, such as to walk, stand, lie down or get up."""
        self._result = self._inbox.put(self._name, behaviour=behaviour) or behaviour.value.replace("_", " ")

    def stop(self) -> None:
        """Stop the robot: it lies down; a second stop damps it."""
        self._inbox.stop(self._name)
        self._result = "STOP"

    def take_over(self) -> None:
        """Take control."""
        self._result = self._inbox.take_over(self._name)

    def next_gait(self) -> None:
        """Request the gait after the one that was requested last, at first after the current one."""
        gaits = [] if (status := self._inbox.status) is None else list(status.offer.gaits)
        if status is None or not gaits:
            self._result = "this policy has one gait only"
            return
        latest = self._gait if self._gait in gaits else status.applied.gait
        gait = gaits[((gaits.index(latest) if latest in gaits else 0) + 1) % len(gaits)]
        refusal = self._inbox.put(self._name, gait=gait)
        self._gait = self._gait if refusal else gait
        self._result = refusal or f"gait {gait}"

    def next_policy(self) -> None:
        """Request the next policy of the run."""
        names = [] if (status := self._inbox.status) is None else list(status.offer.policies)
        if status is None or len(names) < 2:
            self._result = "this run has one policy only"
            return
        name = names[(names.index(status.policy) + 1) % len(names)]
        self._gait, self._height_m = "", None
        self._result = self._inbox.put(self._name, policy=name) or f"policy {name}"

    def raise_body(self, by_m: float) -> None:
        """Change the height of the body that was requested last, at first the present height."""
        span = None if (status := self._inbox.status) is None else status.offer.settings.get(BODY_HEIGHT)
        if status is None or span is None:
            self._result = "this policy's body height is fixed"
            return
        current_m = status.applied.settings.get(BODY_HEIGHT, span.default)
        height_m = (current_m if self._height_m is None else self._height_m) + by_m
        self._height_m = min(max(height_m, span.lowest), span.highest)
        refusal = self._inbox.put(self._name, settings={BODY_HEIGHT: self._height_m})
        self._result = refusal or f"body {self._height_m:.2f} m"
