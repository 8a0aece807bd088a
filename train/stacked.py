"""Scalars in one array, which a device sends to the host at once."""

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


@jax.tree_util.register_pytree_node_class
class StackedScalars(Mapping[str, jax.Array]):
    """Named float32 scalars of one array. Forty arrays take longer to send than a small iteration takes."""

    def __init__(self, names: tuple[str, ...], values: jax.Array) -> None:
        self._names, self._values = names, values

    @classmethod
    def of(cls, scalars: Mapping[str, jax.Array]) -> "StackedScalars":
        """The scalars, sorted by name."""
        names = tuple(sorted(scalars))
        return cls(names, jnp.stack([jnp.asarray(scalars[name], jnp.float32) for name in names]))

    def send(self) -> None:
        """Start the copy to the host, before the device has later work to do."""
        self._values.copy_to_host_async()

    def on_host(self) -> dict[str, float]:
        """The values by name; waits for the device."""
        return dict(zip(self._names, np.asarray(self._values).tolist(), strict=True))

    def mean(self, axis: int | tuple[int, ...]) -> "StackedScalars":
        """Means along leading axes of the array, such as time."""
        return StackedScalars(self._names, self._values.mean(axis=axis))

    def __getitem__(self, name: str) -> jax.Array:
        return self._values[..., self._names.index(name)]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def tree_flatten(self) -> tuple[tuple[jax.Array], tuple[str, ...]]:
        return (self._values,), self._names

    @classmethod
    def tree_unflatten(cls, names: tuple[str, ...], children: tuple[jax.Array]) -> "StackedScalars":
        return cls(names, children[0])


def floats(scalars: Mapping[str, Any]) -> dict[str, float]:
    """The values of scalars, stacked or not; waits for the device."""
    if isinstance(scalars, StackedScalars):
        return scalars.on_host()
    return {name: float(value) for name, value in scalars.items()}
