"""How many stuff bits a walk's frames have, where simulated wires count the most that they could have.

    python benchmarks/stuff_bits.py [--robot go1] [--policy go1-flat] [--seconds 4]

Stuffs every 50th batch of a walk in lockstep bit by bit, CAN 2.0 with its checksum. Prints a JSON object:
bits of a frame on average, as they are and as the wires count them.
"""

import argparse
import json
from collections.abc import Iterator

import numpy as np

from footfall.deploy.frames import EXTENDED, Frames, frame_bits
from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

CRC_POLYNOMIAL = 0x4599  # x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1, of ISO 11898
LONGEST_RUN = 5  # equal bits, after which an opposite one is stuffed in
EVERY = 50  # batches one is looked at


def content_bits(identifier: int, data: bytes) -> list[int]:
    """What of a frame may be stuffed: from the start of frame to the checksum, before stuffing."""
    if identifier & EXTENDED:
        base, rest = (identifier & ~EXTENDED) >> 18, identifier & 0x3FFFF
        head = [0, *_bits(base, 11), 1, 1, *_bits(rest, 18), 0, 0, 0]  # SRR and IDE; RTR and two reserved
    else:
        head = [0, *_bits(identifier, 11), 0, 0, 0]  # RTR, IDE and one reserved
    content = [*head, *_bits(len(data), 4), *(bit for byte in data for bit in _bits(byte, 8))]
    checksum = 0
    for bit in content:
        feedback = bit ^ checksum >> 14
        checksum = checksum << 1 & 0x7FFF ^ CRC_POLYNOMIAL * feedback
    return content + _bits(checksum, 15)


def stuffed(bits: list[int]) -> Iterator[int]:
    """The bits as they are sent."""
    last, run = -1, 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        yield bit
        if run == LONGEST_RUN:
            last, run = 1 - bit, 1
            yield last


def wire_bits(identifier: int, data: bytes) -> int:
    """Bits that a frame occupies on the wire, the three of interframe space included."""
    content = content_bits(identifier, data)
    stuff = sum(1 for _ in stuffed(content)) - len(content)
    return frame_bits(len(data), identifier >= EXTENDED, stuffed=False) + stuff


def _bits(value: int, count: int) -> list[int]:
    return [value >> place & 1 for place in reversed(range(count))]


class Listener:
    """Looks at what a simulated robot's wires carry."""

    def __init__(self) -> None:
        self.exact: list[int] = []  # bits of each frame that was looked at
        self.counted: list[int] = []  # as the wires count them
        self._batches = 0
        self._wires: SimulatedWires | None = None

    def watch(self, _: ControlLoop, body: SimulatedRobot) -> None:
        """To be called after each tick: listens from the first on."""
        if self._wires is None:
            self._wires = body._wires
            send = self._wires.send

            def listened(side: Side, frames: Frames, now_us: float) -> int:
                self._look(frames)
                return send(side, frames, now_us)

            self._wires.send = listened  # type: ignore[method-assign]

    def _look(self, frames: Frames) -> None:
        self._batches += 1
        if self._batches % EVERY:
            return
        for identifier, data, length in zip(
            frames.id.tolist(), frames.data, frames.length.tolist(), strict=True
        ):
            self.exact.append(wire_bits(identifier, data[:length].tobytes()))
            self.counted.append(frame_bits(length, identifier >= EXTENDED))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--seconds", type=float, default=4.0)
    options = parser.parse_args()
    robot, listener, command = load_robot(options.robot), Listener(), np.array([0.5, 0.0, 0.0])
    episode = Episode(lambda _: command, options.seconds, record=False)
    run_episode(robot, load_policy(options.policy, robot), episode, listener.watch)
    exact, counted = np.mean(listener.exact), np.mean(listener.counted)
    shown = {
        "frames": len(listener.exact),
        "bits": round(float(exact), 1),
        "bits_counted": round(float(counted), 1),
        "counted_too_much": round(float(counted / exact - 1.0), 3),
        "most_bits": max(listener.exact),
    }
    print(json.dumps(shown))


if __name__ == "__main__":
    main()
