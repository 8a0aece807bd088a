"""Hints at the name that a misspelt one stands for."""

from collections.abc import Iterable
from difflib import get_close_matches


def meant(name: str, known: Iterable[str]) -> str:
    """'. Did you mean NAME?' with the closest known name; empty if none is close."""
    return "".join(f". Did you mean {each}?" for each in get_close_matches(name, list(known), n=1))
