"""Changes of the policy or its settings by requests; logged, so that a replay repeats them."""

import json
from collections.abc import Mapping
from typing import NamedTuple


class Change(NamedTuple):
    """Changes from a policy step on. Empty fields change nothing."""

    policy: str = ""  # new policy
    gait: str = ""  # new gait of the current policy
    settings: Mapping[str, float] = {}  # changed live settings of the current policy
    at_once: bool = False  # switch the policy immediately, in any state
    by: str = ""  # operator of the request; empty for the run itself

    def to_json(self) -> str:
        """JSON text at full precision."""
        return json.dumps({name: value for name, value in self._asdict().items() if value})

    @classmethod
    def from_json(cls, text: str) -> "Change":
        """Change from a text by `to_json`.

        Raises:
            ValueError: the text is not a change.
        """
        try:
            change = cls(**json.loads(text))
            settings = {str(name): float(value) for name, value in change.settings.items()}
            return cls(str(change.policy), str(change.gait), settings, bool(change.at_once), str(change.by))
        except (TypeError, AttributeError) as error:
            raise ValueError(f"not a change of a run: {error}") from None
