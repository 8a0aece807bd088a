"""Exceptions with a message for the user."""

from collections.abc import Iterator
from contextlib import contextmanager


class UserError(Exception):
    """Bad input. The message is one line: what is wrong, and what would be right.

    The command line prints it and exits with status 2; nothing else in the project prints it.
    """


class CannotWriteError(UserError):
    """A file could not be written, mostly because the disk is full; its earlier content is intact."""


@contextmanager
def naming(field: str) -> Iterator[None]:
    """Put the name of a field before the message of a UserError that its value causes."""
    try:
        yield
    except UserError as error:
        raise type(error)(f"{field}: {error}") from None
