"""The loop's time, simulated or by the wall clock, and the time of frames on a bus."""

import gc
import math
import os
import resource
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest
from fake_time import FakeTime

from footfall.deploy import clock as clock_module
from footfall.deploy import interface_time
from footfall.deploy.clock import WallClock, realtime_thread
from footfall.deploy.frames import frame_bits
from footfall.deploy.interface_time import Pacing


def test_wall_time_keeps_deadlines_and_skips_missed_deadlines(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeTime()
    monkeypatch.setattr(clock_module, "time", fake)
    clock = WallClock(2000)
    assert (clock.next_tick(), clock.lateness_us()) == (0, 0.0)
    fake.ns += 500_000
    assert (clock.next_tick(), clock.lateness_us()) == (2000, 7.0)
    assert fake.slept == pytest.approx([0.0015])
    fake.ns = 5_004_300_000  # 2.3 ms later, due 0.3 ms ago
    assert (clock.next_tick(), clock.lateness_us()) == (4000, pytest.approx(300.0))
    fake.ns = 5_011_900_000
    assert (clock.next_tick(), clock.lateness_us()) == (10_000, pytest.approx(1900.0))
    assert (clock.next_tick(), clock.lateness_us()) == (12_000, 7.0)
    assert fake.slept == pytest.approx([0.0015, 0.0001])


class TestUndisturbed:
    """Settings of Python and the system while the loop runs, restored afterwards."""

    RESTORED = (True, False, pytest.approx(0.005), 50_000, os.SCHED_OTHER)

    @staticmethod
    def settings() -> tuple[bool, bool, float, int, int]:
        slack_ns = int(Path("/proc/self/timerslack_ns").read_text())
        frozen = gc.get_freeze_count() > 0
        return gc.isenabled(), frozen, sys.getswitchinterval(), slack_ns, os.sched_getscheduler(0)

    def test_garbage_collection_is_off_and_other_threads_yield(self) -> None:
        with realtime_thread(None) as refused:
            assert self.settings() == (False, True, pytest.approx(1e-4), 1, os.SCHED_OTHER)
        assert (refused, self.settings()) == ([], self.RESTORED)

    def test_a_refused_priority_is_noted(self, monkeypatch: pytest.MonkeyPatch) -> None:
        refuse = Mock(side_effect=PermissionError(1, "Operation not permitted"))
        monkeypatch.setattr(os, "sched_setscheduler", refuse)
        monkeypatch.setattr(clock_module, "may_lock_memory", lambda: False)
        monkeypatch.setattr("resource.getrlimit", lambda _: (8 * 2**20, 8 * 2**20))
        with realtime_thread(80) as refused:
            assert not gc.isenabled()
        assert refused == [
            "memory is not locked: the limit (ulimit -l) is 8 MiB",
            "no real-time priority 80: Operation not permitted",
        ]
        assert self.settings() == self.RESTORED

    def test_when_memory_may_be_locked(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        for limit, capabilities, may in (
            (resource.RLIM_INFINITY, "0000000000000000", True),
            (8 * 2**20, "0000000000004000", True),  # CAP_IPC_LOCK, as setcap gives it
            (8 * 2**20, "000001ffffffbfff", False),  # every other one
            (8 * 2**20, "", False),
        ):
            monkeypatch.setattr("resource.getrlimit", Mock(return_value=(limit, limit)))
            (tmp_path / "status").write_text(f"CapPrm:\t0\nCapEff:\t{capabilities}\n")
            assert clock_module.may_lock_memory(tmp_path / "status") is may, capabilities


@pytest.mark.parametrize("length", [0, 3, 8])
def test_a_frame_counts_the_largest_number_of_stuff_bits(length: int) -> None:
    """The formula of ISO 11898 is 47 + 8 n + floor((34 + 8 n - 1) / 4), with 67 and 54 for 29 bits."""
    assert frame_bits(length) == 47 + 8 * length + math.floor((33 + 8 * length) / 4)
    assert frame_bits(length, True) == 67 + 8 * length + math.floor((53 + 8 * length) / 4)


def test_a_frame_waits_while_the_interfaces_queue_would_overflow(monkeypatch: pytest.MonkeyPatch) -> None:
    """The fourth frame waits for the first of three. Frames of another interface do not wait."""
    fake, pacing = FakeTime(), Pacing(2, queue_frames=3)
    monkeypatch.setattr(interface_time, "time", fake)
    for interfaces, pause_ns, slept in (
        ((0, 0, 0), 0, []),
        ((1, 1, 0), 0, [frame_bits(8) * 1e-6]),
        ((0, 0, 0), 10_000_000, []),  # the queue has run empty
    ):
        fake.ns += pause_ns
        fake.slept.clear()
        for interface in interfaces:
            pacing.wait(interface, frame_bits(8))
        assert fake.slept == pytest.approx(slept)
