"""What became of malformed input: taken, refused in one line, or escaped. No benchmark itself."""

import traceback
from collections import Counter
from collections.abc import Callable

from footfall.common.errors import UserError


class Tally:
    """What became of the cases."""

    def __init__(self) -> None:
        self.ends: dict[str, Counter[str]] = {}  # of each reader
        self.escaped: dict[str, str] = {}

    def attempt(self, reader: str, case: int, work: Callable[[], object]) -> None:
        """Let a reader do something that may end well or in a UserError."""
        ends = self.ends.setdefault(reader, Counter())
        try:
            work()
            ends["taken"] += 1
        except UserError:
            ends["refused"] += 1
        except BaseException:
            ends["escaped"] += 1
            self.escaped[f"{reader} {case}"] = traceback.format_exc()[-1500:]
