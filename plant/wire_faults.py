"""Faults of simulated wires, on demand."""

from dataclasses import dataclass

import numpy as np

from footfall.deploy import can_errors
from footfall.deploy.frames import Frames

ERROR_BITS = 23  # largest number of bits of an error after the frame: flag, echo, delimiter, interframe space

PASSIVE_ABOVE, BUS_OFF_ABOVE = 127, 255  # error counts of a controller, ISO 11898-1


@dataclass(frozen=True)
class WireFaults:
    """Shares of all frames, 0 to 1, and indices of wires; draws come from the seed."""

    lost: float = 0.0  # frames that never arrive, as after a buffer overflow
    corrupted: float = 0.0  # frames that arrive with one wrong data bit, undetected by the checksum
    destroyed: float = 0.0  # transmissions destroyed by an error; the frame is repeated up to 16 times
    unplugged: tuple[int, ...] = ()  # wires without other nodes, on which no frame is acknowledged
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("lost", "corrupted", "destroyed"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}: a share from 0 up to, not including, 1")


class FaultyWires:
    """Draws faults, and counts errors at the controller's interfaces."""

    def __init__(self, faults: WireFaults, wires: int, random: np.random.Generator | None = None) -> None:
        """Draws come from `random`, or from the faults' seed."""
        self._faults = faults
        self._random = random or np.random.default_rng(faults.seed)
        self.transmit_errors = np.zeros(wires, np.int64)  # error counters of the controller's interfaces

    def working(self, channel: np.ndarray) -> np.ndarray:
        """Mask (k,) of the frames on working wires."""
        dead = np.isin(channel, self._faults.unplugged) | (self.transmit_errors[channel] > BUS_OFF_ABOVE)
        return np.asarray(~dead)

    def count_unacknowledged(self, channel: np.ndarray) -> None:
        """Count unacknowledged frames: a controller stops counting once it is error-passive."""
        unacknowledged = np.intersect1d(channel, self._faults.unplugged).astype(np.intp)
        self.transmit_errors[unacknowledged] = PASSIVE_ABOVE + 1

    def repetitions(self, channel: np.ndarray, from_host: bool) -> np.ndarray:
        """Number of destroyed transmissions of each frame, (k,)."""
        if self._faults.destroyed == 0.0:
            return np.zeros(len(channel), np.int64)
        repetitions = np.minimum(self._random.geometric(1.0 - self._faults.destroyed, len(channel)) - 1, 16)
        if from_host:  # each error adds 8, each success subtracts 1
            for wire, count in zip(channel.tolist(), repetitions.tolist(), strict=True):
                self.transmit_errors[wire] = max(self.transmit_errors[wire] + 8 * count - 1, 0)
        return repetitions

    def deliver(self, frames: Frames) -> Frames:
        """The transmitted frames that arrive."""
        faults, random = self._faults, self._random
        if faults.lost:
            frames = frames.take(random.random(len(frames.id)) >= faults.lost)
        if faults.corrupted:
            data = frames.data.copy()
            for row in np.flatnonzero((random.random(len(data)) < faults.corrupted) & (frames.length > 0)):
                bit = int(random.integers(8 * int(frames.length[row])))
                data[row, bit // 8] ^= np.uint8(1 << bit % 8)
            frames = frames._replace(data=data, id=frames.id.copy())  # a new array: the data differs
        return frames

    def fault(self, names: tuple[str, ...]) -> str:
        """First bus that fails, and why; empty if all work."""
        for name, errors in zip(names, self.transmit_errors.tolist(), strict=True):
            if errors > BUS_OFF_ABOVE:
                return f"bus {name} {can_errors.BUS_OFF_TEXT}"
            if errors > PASSIVE_ABOVE:
                return f"bus {name} {can_errors.PASSIVE_TEXT}"
        return ""
