"""Orders to a run, with their operators: logged, so that a log shows who steered, who stopped, and when."""

import json
from enum import StrEnum
from typing import NamedTuple


class OrderKind(StrEnum):
    """Kind of an order. A change of policy, gait or settings is a `changes.Change`."""

    STEER = "steer"  # from now on this operator gives the velocity commands
    WALK = "walk"
    STAND = "stand"
    LIE_DOWN = "lie_down"
    GET_UP = "get_up"
    STOP = "stop"  # lie down immediately
    DAMP = "damp"  # damp the joints immediately


class Order(NamedTuple):
    """One order."""

    kind: OrderKind
    by: str  # operator; empty for the run itself, and for STEER without an operator
    why: str = ""  # reason of a stop

    def to_json(self) -> str:
        """JSON text."""
        return json.dumps({"order": self.kind, "by": self.by} | ({"why": self.why} if self.why else {}))
