"""Result of one check of `footfall doctor`."""

from typing import NamedTuple


class Finding(NamedTuple):
    """Result of one check."""

    name: str
    good: bool
    result: str
    advice: str = ""  # what to do; empty if nothing is needed
