"""Changes that a run's request made to what decides: logged, so that a replay makes them again."""

import json
from collections.abc import Mapping
from typing import NamedTuple


class Change(NamedTuple):
    """What changes from a policy step on. What is empty does not."""

    policy: str = ""  # that shall decide
    gait: str = ""  # that the present policy takes up
    settings: Mapping[str, float] = {}  # live settings of the present policy
    at_once: bool = False  # the policy decides from now on, whatever the robot does
    by: str = ""  # who asked for it; empty for the run itself

    def to_json(self) -> str:
        """As text; numbers keep all their digits."""
        return json.dumps({name: value for name, value in self._asdict().items() if value})

    @classmethod
    def from_json(cls, text: str) -> "Change":
        """The change in a text by `to_json`.

        Raises:
            ValueError: it is none.
        """
        try:
            change = cls(**json.loads(text))
            settings = {str(name): float(value) for name, value in change.settings.items()}
            return cls(str(change.policy), str(change.gait), settings, bool(change.at_once), str(change.by))
        except (TypeError, AttributeError) as error:
            raise ValueError(f"no change of a run: {error}") from None
