"""Counts malformed input that was accepted, refused in one line, or caused an unexpected exception.

Not a benchmark itself.
"""

import traceback
from collections import Counter
from collections.abc import Callable

from footfall.common.errors import UserError


class Tally:
    """Outcomes of the cases."""

    def __init__(self) -> None:
        self.ends: dict[str, Counter[str]] = {}  # counts of outcomes, by reader
        self.escaped: dict[str, str] = {}

    def attempt(self, reader: str, case: int, work: Callable[[], object]) -> None:
        """Run `work` of a reader; any exception but a UserError counts as unexpected."""
        ends = self.ends.setdefault(reader, Counter())
        try:
            work()
            ends["taken"] += 1
        except UserError:
            ends["refused"] += 1
        except BaseException:
            ends["escaped"] += 1
            self.escaped[f"{reader} {case}"] = traceback.format_exc()[-1500:]
