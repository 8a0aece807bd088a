"""The timing of a batch of frames on simulated wires."""

import math
from dataclasses import dataclass, field

import numpy as np

from footfall.deploy.frames import EXTENDED, Frames, bits_of


@dataclass
class Plan:
    """The timing on the wires of a batch with one layout (channels, identifiers, lengths)."""

    position: np.ndarray  # (k,) position of the frame among the batch's frames on its wire, from 1
    offset: np.ndarray  # (k,) microseconds from the start of the batch on its wire to the frame's end
    occupied: list[float]  # microseconds that the batch takes on each wire
    longest: float  # largest of `occupied`
    frames: np.ndarray  # (channels,) frames on each wire
    max_frames: int  # frames on the busiest wire
    wires: list[int]  # indices of the wires with a frame
    first: list[float]  # lowest precedence number on each wire
    last: list[float]  # highest precedence number on each wire
    orderly: bool  # whether the frames on each wire are in order of precedence
    sent: list[int] = field(default_factory=lambda: [0, 0])  # number of such batches from each side


def precedence(identifier: np.ndarray) -> np.ndarray:
    """Precedence in arbitration, (k,): of two frames the one with the lower number wins."""
    standard = (
        identifier & 0x7FF
    ) << 19  # 11 bits, then the IDE bit: 0 in standard, 1 in extended identifiers
    extended = identifier & 0x1FFF_FFFF
    long = (extended >> 18) << 19 | 1 << 18 | (extended & 0x3FFFF)
    return np.where(identifier >= EXTENDED, long, standard)


def planned(frames: Frames, wires: int) -> Plan:
    """The plan of a batch on a number of wires."""
    channel, duration = frames.channel, bits_of(frames)
    order = precedence(frames.id).astype(float)
    not_later = np.tril(channel[:, None] == channel[None, :]).astype(float)
    on_wire = np.arange(wires)[:, None] == channel[None, :]
    occupied, count = (on_wire @ duration).tolist(), on_wire.sum(axis=1)
    orders = [order[row] for row in on_wire]
    return Plan(
        position=not_later.sum(axis=1),
        offset=not_later @ duration,
        occupied=occupied,
        longest=max(occupied, default=0.0),
        frames=count,
        max_frames=int(count.max(initial=0)),
        wires=np.flatnonzero(count).tolist(),
        first=[float(row.min(initial=math.inf)) for row in orders],
        last=[float(row.max(initial=0.0)) for row in orders],
        orderly=all(bool((np.diff(row) >= 0).all()) for row in orders),
    )
