"""Refusals that a user reads."""

from collections.abc import Callable

import pytest

from footfall.common.errors import UserError


def refusal_of(call: Callable[..., object], *arguments: object, **options: object) -> str:
    """The message with which a call refuses its arguments; it is one line."""
    with pytest.raises(UserError) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message
