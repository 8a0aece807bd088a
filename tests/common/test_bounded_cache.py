"""A cache with a limit."""

from footfall.common.bounded_cache import BoundedCache


def test_a_cache_never_holds_more_than_its_limit_and_keeps_the_newest_entry() -> None:
    cache = BoundedCache[int, str](max_entries=3)
    for key in range(10):
        cache[key] = str(key)
        assert len(cache) <= 3
        assert cache[key] == str(key)
