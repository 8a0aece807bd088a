"""Result of one check of `footfall doctor`."""

from typing import NamedTuple


class Finding(NamedTuple):
    """Result of one check."""

    what: str
    good: bool
    found: str
    advice: str = ""  # what to do; empty if nothing is needed
