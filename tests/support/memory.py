"""Growth of the memory of Python's objects."""

import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def memory_growth() -> Iterator[Callable[[], float]]:
    """A function that returns the growth within the context in kilobytes, once that has ended."""
    growth_kb: list[float] = []
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    try:
        yield lambda: growth_kb[0]
    finally:
        after, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        growth_kb.append((after - before) / 1024)
