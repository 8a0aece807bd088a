"""A trained actor, as any trainer hands it to the export."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

LOGGED_OBSERVATIONS = 1000  # observations of an iteration that a trainer keeps for the export's parity check


class Actor(NamedTuple):
    """An actor: an observation normaliser and an ELU network. Arrays are float32."""

    trainer: str
    mean: np.ndarray  # (observation,) subtracted from the observation
    scale: np.ndarray  # (observation,) divides the difference
    layers: tuple[tuple[np.ndarray, np.ndarray], ...]  # kernel (inputs, outputs) and bias, in order
    act: Callable[[np.ndarray], np.ndarray]  # the trainer's own network: (k, observation) to means (k, n)
