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
        self.outcomes: dict[str, Counter[str]] = {}  # counts by reader
        self.unexpected: dict[str, str] = {}  # tracebacks of unexpected exceptions

    def attempt(self, reader: str, case: int, work: Callable[[], object]) -> None:
        """Run `work` of a reader; any other exception than UserError and Ctrl-C counts as unexpected."""
        counts = self.outcomes.setdefault(reader, Counter())
        try:
            work()
            counts["accepted"] += 1
        except UserError:
            counts["refused"] += 1
        except KeyboardInterrupt:
            raise
        except BaseException:
            counts["unexpected"] += 1
            self.unexpected[f"{reader} {case}"] = traceback.format_exc()[-1500:]
