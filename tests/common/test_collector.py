"""A pause of the garbage collector."""

import gc

import pytest

from footfall.common.collector import collector_paused


@pytest.mark.parametrize("was_on", [True, False])
@pytest.mark.parametrize("fails", [True, False])
def test_the_collector_is_as_it_was_after_a_pause(was_on: bool, fails: bool) -> None:
    (gc.enable if was_on else gc.disable)()
    try:
        with collector_paused():
            assert not gc.isenabled()
            if fails:
                raise KeyError
    except KeyError:
        pass
    finally:
        after = gc.isenabled()
        gc.enable()
    assert after is was_on
