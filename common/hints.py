"""Hints for misspelt names."""

from collections.abc import Iterable, Sequence
from difflib import get_close_matches


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """'. Did you mean NAME?' with the closest known name; empty if none is close."""
    return "".join(f". Did you mean {each}?" for each in get_close_matches(name, list(known), n=1))


def no_setting(names: Sequence[str], known: Sequence[str]) -> str:
    """'no setting NAME (…)' with the closest known settings, or with all of them if none is close."""
    close = list(dict.fromkeys(each for name in names for each in get_close_matches(name, known, n=1)))
    hint = f"did you mean {' and '.join(close)}?" if close else f"there are {', '.join(known)}"
    return f"no setting {', '.join(names)} ({hint})"
