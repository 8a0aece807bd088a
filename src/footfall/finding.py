"""What a check of `footfall doctor` found."""

from typing import NamedTuple


class Finding(NamedTuple):
    """Result of one check."""

    what: str
    good: bool
    found: str
    advice: str = ""  # what to do about it, where something is to be done
