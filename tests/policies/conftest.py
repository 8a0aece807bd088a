"""Fixtures that several tests of policies share."""

from collections.abc import Callable

import pytest

from footfall.common.errors import UserError
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot


@pytest.fixture(scope="session")
def refusal() -> Callable[[str, Robot], str]:
    """Loads a policy that must be refused, and returns the message, which is one line."""

    def load(spec: str, robot: Robot) -> str:
        with pytest.raises(UserError) as caught:
            load_policy(spec, robot)
        assert "\n" not in str(caught.value)
        return str(caught.value)

    return load
