"""Orders to a run, with who gave them: logged, so that a log tells who steered, who stopped, and when."""

import json
from enum import StrEnum
from typing import NamedTuple


class OrderKind(StrEnum):
    """What was ordered. A change of policy, gait or settings is a `changes.Change`."""

    STEER = "steer"  # the velocity commands are this owner's from now on
    WALK = "walk"
    STAND = "stand"
    LIE_DOWN = "lie_down"
    GET_UP = "get_up"
    STOP = "stop"  # lie down at once
    DAMP = "damp"  # damp the joints at once


class Order(NamedTuple):
    """One order."""

    kind: OrderKind
    by: str  # who gave it; empty for the run itself, and for STEER if nobody steers
    why: str = ""  # of a stop

    def to_json(self) -> str:
        """As text."""
        return json.dumps({"order": self.kind, "by": self.by} | ({"why": self.why} if self.why else {}))
