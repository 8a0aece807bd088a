"""A pause of the garbage collector."""

import gc
import weakref
from contextlib import suppress

import pytest

from footfall.common.collector import collector_paused, lasting_objects


@pytest.mark.parametrize("was_on", [True, False])
@pytest.mark.parametrize("fails", [True, False])
def test_the_collector_is_as_it_was_after_a_pause(was_on: bool, fails: bool) -> None:
    (gc.enable if was_on else gc.disable)()
    with suppress(KeyError), collector_paused():
        assert not gc.isenabled()
        if fails:
            raise KeyError
    after = gc.isenabled()
    gc.enable()
    assert after is was_on


class Node:
    def __init__(self) -> None:
        self.me = self


def test_the_collector_passes_over_lasting_objects() -> None:
    with lasting_objects():
        lasting = weakref.ref(Node())
    passing = weakref.ref(Node())
    gc.collect()
    kept = [node() is not None for node in (lasting, passing)]
    gc.unfreeze()
    assert kept == [True, False]
