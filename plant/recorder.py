"""Records samples of a walk, from which the arrays of a trace are computed."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from footfall.plant.energy import Power
from footfall.plant.ground_truth import Snapshot, Truth
from footfall.plant.progress import Progress

BLOCK = 32  # samples that are computed at once: one at a time, each would take ten times as long


class TraceSample(NamedTuple):
    """One sample of the walking phase, as in `Trace`."""

    snapshot: Snapshot
    power: Power
    time_s: float
    command: np.ndarray
    joint_target: np.ndarray
    estimated_velocity: np.ndarray
    estimated_height: float


class Recorder:
    """Collects samples; with `keep` also their arrays, otherwise only the progress of the base."""

    def __init__(self, truths: Callable[[Sequence[Snapshot]], Truth], progress: Progress, keep: bool) -> None:
        """`truths` computes the true states of snapshots, `progress` gets those of the base."""
        self._truths, self._progress, self._keep = truths, progress, keep
        self._samples: list[TraceSample] = []  # not computed yet
        self._blocks: list[dict[str, np.ndarray]] = []

    def add(self, sample: TraceSample) -> None:
        """Add one sample, whose arrays must not change afterwards."""
        self._samples.append(sample)
        if len(self._samples) >= BLOCK:
            self._compute()

    def arrays(self, joints: int, feet: int, nq: int) -> dict[str, np.ndarray]:
        """All samples by the names of a trace; empty arrays of the right width if none are kept."""
        if self._samples:
            self._compute()
        if not self._blocks:
            return _no_samples(joints, feet, nq)
        return {name: np.concatenate([block[name] for block in self._blocks]) for name in self._blocks[0]}

    def _compute(self) -> None:
        snapshots, powers, *others = zip(*self._samples, strict=True)
        truths = self._truths(snapshots)
        self._progress.add(truths.base_position, truths.base_velocity)
        if self._keep:
            arrays = map(np.array, others)
            self._blocks.append(
                {
                    **truths._asdict(),
                    **dict(zip(TraceSample._fields[2:], arrays, strict=True)),
                    "electrical_power": np.array([power.electrical for power in powers]),
                    "mechanical_power": np.array([power.mechanical for power in powers]),
                    "positive_power": np.array([power.positive for power in powers]),
                }
            )
        self._samples.clear()


def _no_samples(joints: int, feet: int, nq: int) -> dict[str, np.ndarray]:
    widths: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(_SCALARS, ()),
        **dict.fromkeys(_VECTORS, (3,)),
        **dict.fromkeys(_JOINTS, (joints,)),
        "base_quaternion": (4,),
        "foot_position": (feet, 3),
        "foot_velocity": (feet, 3),
        "foot_contact": (feet,),
        "foot_force": (feet,),
        "qpos": (nq,),
    }
    return {
        name: np.zeros((0, *width), dtype=bool if name in _FLAGS else float) for name, width in widths.items()
    }


_SCALARS = (
    "time_s",
    "estimated_height",
    "electrical_power",
    "mechanical_power",
    "positive_power",
    "legs_touch",
)
_FLAGS = frozenset({"foot_contact", "legs_touch"})
_VECTORS = (
    "command",
    "base_position",
    "base_velocity",
    "base_angular_velocity",
    "estimated_velocity",
)
_JOINTS = ("joint_position", "joint_velocity", "motor_torque", "joint_target")
