"""Arrays of NumPy and JAX: which library one belongs to, and indices that are fast."""

from typing import Any

import numpy as np

Array = Any  # a NumPy or a JAX array


def library(array: Array) -> Any:
    """The array's namespace. NumPy's own `__array_namespace__()` takes as long as a sum over joints."""
    return np if isinstance(array, np.ndarray) else array.__array_namespace__()


def as_slice(indices: np.ndarray) -> slice | np.ndarray:
    """Rising indices evenly apart as a slice, which NumPy reads and writes faster; others as they are."""
    apart = np.diff(indices)
    step = int(apart[0]) if len(apart) else 1
    even = step > 0 and bool((apart == step).all())
    return slice(int(indices[0]), int(indices[-1]) + 1, step) if even else indices
