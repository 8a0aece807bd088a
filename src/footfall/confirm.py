"""Questions to the user, such as the one before anything moves."""

import sys
from typing import Annotated

from cyclopts import Parameter

from footfall.common.errors import UserError

Yes = Annotated[bool, Parameter(negative=(), help="Do not ask.")]


def confirm(question: str, yes: bool) -> None:
    """Raise UserError unless the user agrees."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise UserError("no terminal for the confirmation: add --yes")
    if ask(f"{question} [y/N] ").strip().lower() not in ("y", "yes"):
        raise UserError("not confirmed")


def ask(question: str) -> str:
    """What the user types; raises UserError at the end of the input (Ctrl-D)."""
    try:
        return input(question)
    except EOFError:
        print()
        raise UserError("no answer") from None
