"""The loop's time: simulated, or by the wall clock."""

import gc
import os
import resource
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_time import FakeTime

from footfall.deploy import clock as clock_module
from footfall.deploy.clock import WallClock, undisturbed


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

    @pytest.fixture
    def before(self) -> Iterator[None]:
        yield
        assert gc.isenabled()
        assert gc.get_freeze_count() == 0
        assert sys.getswitchinterval() == pytest.approx(0.005)
        assert timer_slack_ns() == 50_000
        assert os.sched_getscheduler(0) == os.SCHED_OTHER

    def test_garbage_collection_is_off_and_other_threads_yield(self, before: None) -> None:
        with undisturbed(None) as refused:
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
            assert sys.getswitchinterval() <= 1e-4
            assert timer_slack_ns() == 1
            assert os.sched_getscheduler(0) == os.SCHED_OTHER
        assert refused == []

    def test_a_refused_priority_is_noted(self, before: None, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse(*_: object) -> None:
            raise PermissionError(1, "Operation not permitted")

        monkeypatch.setattr(os, "sched_setscheduler", refuse)
        monkeypatch.setattr(clock_module, "may_lock_memory", lambda: False)
        monkeypatch.setattr("resource.getrlimit", lambda _: (8 * 2**20, 8 * 2**20))
        with undisturbed(80) as refused:
            assert not gc.isenabled()
        assert refused == [
            "memory is not locked: the limit (ulimit -l) is 8 MiB",
            "no real-time priority 80: Operation not permitted",
        ]

    @pytest.mark.parametrize(
        ("limit", "capabilities", "may"),
        [
            (resource.RLIM_INFINITY, "0000000000000000", True),
            (8 * 2**20, "0000000000004000", True),  # CAP_IPC_LOCK, as setcap gives it
            (8 * 2**20, "000001ffffffbfff", False),  # every other one
            (8 * 2**20, "", False),
        ],
    )
    def test_memory_may_be_locked_without_a_limit_or_beyond_it(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, limit: int, capabilities: str, may: bool
    ) -> None:
        monkeypatch.setattr("resource.getrlimit", lambda _: (limit, limit))
        (tmp_path / "status").write_text(f"CapPrm:\t0\nCapEff:\t{capabilities}\n")
        assert clock_module.may_lock_memory(tmp_path / "status") is may


def timer_slack_ns() -> int:
    return int(Path("/proc/self/timerslack_ns").read_text())
