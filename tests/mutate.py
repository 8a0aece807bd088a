"""Files gone wrong, from a seed."""

import numpy as np


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes with up to a dozen places changed, cut out, repeated, swapped or torn off."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 13))):
        if not data:
            break
        kind, at = int(rng.integers(6)), int(rng.integers(len(data)))
        size = int(rng.integers(1, 33))
        if kind == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at : at + size] = rng.bytes(size)
        elif kind == 2:
            del data[at : at + size]
        elif kind == 3:
            data[at:at] = data[at : at + size]
        elif kind == 4:
            data[at : at + 8] = (255 if rng.integers(2) else 0).to_bytes() * 8
        elif rng.integers(4) == 0:
            del data[at:]
    return bytes(data)
