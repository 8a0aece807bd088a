"""Writes wait while an interface's queue is full."""

import pytest
from fake_time import FakeTime

from footfall.deploy import interface_time
from footfall.deploy.frames import frame_bits
from footfall.deploy.interface_time import Pacing


def test_a_frame_waits_while_the_queue_would_overflow(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fourth frame waits for the first of three. Frames of another interface do not wait."""
    fake = FakeTime()
    monkeypatch.setattr(interface_time, "time", fake)
    pacing = Pacing(2, queue_frames=3)

    def send(*interfaces: int) -> None:
        for interface in interfaces:
            pacing.wait(interface, frame_bits(8))

    send(0, 0, 0)
    assert fake.slept == []
    send(1, 1, 0)
    assert fake.slept == pytest.approx([frame_bits(8) * 1e-6])
    fake.slept.clear()
    fake.ns += 10_000_000  # the queue runs empty
    send(0, 0, 0)
    assert fake.slept == []
