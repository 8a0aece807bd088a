"""A cache for keys that may never repeat."""

from typing import TypeVar

Key = TypeVar("Key")
Value = TypeVar("Value")


class BoundedCache(dict[Key, Value]):
    """A dictionary that is emptied when it is full.

    For layouts of frames: with frames lost at random, or values in identifiers, layouts never repeat.
    """

    def __init__(self, max_entries: int = 64) -> None:
        super().__init__()
        self._max_entries = max_entries

    def __setitem__(self, key: Key, value: Value) -> None:
        if len(self) >= self._max_entries:
            self.clear()
        super().__setitem__(key, value)
