"""Bits of a frame on a CAN wire, against the standard's own example and against what a receiver does."""

from itertools import groupby

from hypothesis import example, given
from hypothesis import strategies as st
from stuff_bits import content_bits, stuffed, wire_bits

from footfall.deploy.frames import EXTENDED, frame_bits

identifiers = st.integers(0, (1 << 11) - 1) | st.integers(0, (1 << 29) - 1).map(lambda i: i | EXTENDED)


def received(bits: list[int]) -> list[int]:
    """What a receiver keeps: it drops the bit after five equal ones."""
    kept: list[int] = []
    run: list[int] = []
    for bit in bits:
        if len(run) == 5:
            assert bit != run[0], "six equal bits are an error"
            run = [bit]
            continue
        run = [*run, bit] if run and run[0] == bit else [bit]
        kept.append(bit)
    return kept


def remainder(bits: list[int]) -> int:
    """Of a polynomial over GF(2), by the CAN checksum's: long division."""
    value = int("".join(map(str, bits)), 2)
    while value.bit_length() > 15:
        value ^= 0b1100010110011001 << (value.bit_length() - 16)
    return value


@given(identifiers, st.binary(max_size=8))
@example(0, bytes(8))
@example(0x7FF, b"\xff" * 8)
@example(0x78, bytes([0x3C] * 8))
def test_a_receiver_gets_the_frame_and_its_checksum_back(identifier: int, data: bytes) -> None:
    content = content_bits(identifier, data)
    sent = list(stuffed(content))
    assert received(sent) == content
    assert remainder(content) == 0
    assert all(len(list(run)) <= 5 for _, run in groupby(sent))


@given(identifiers, st.binary(max_size=8))
@example(0, bytes(8))
@example(0x78, bytes([0x3C] * 8))
def test_the_wires_never_count_too_little(identifier: int, data: bytes) -> None:
    """ISO 11898's shorthand bounds what any content can cause."""
    extended = identifier >= EXTENDED
    least, most = (frame_bits(len(data), extended, stuffed) for stuffed in (False, True))
    assert least <= wire_bits(identifier, data) <= most


def test_fields_stand_where_the_standard_puts_them() -> None:
    """SOF, identifier, RTR, IDE, r0, DLC, data; with 29 bits SRR and IDE stand between its parts."""
    plain = "".join(map(str, content_bits(0x555, b"\xa5")))
    assert plain[:-15] == "010101010101000000110100101"
    extended = "".join(map(str, content_bits(EXTENDED | 0x155 << 18 | 0x20001, b"")))
    assert extended[:-15] == "000101010101111000000000000000010000000"
