"""The loop's time: simulated, or by the wall clock."""

import gc
import os
import resource
from types import SimpleNamespace
from typing import Any

import pytest
from fake_time import FakeTime

from footfall.deploy import clock as clock_module
from footfall.deploy.clock import LockstepClock, WallClock, undisturbed


class TestClocks:
    def test_wall_time_keeps_to_its_deadlines_and_skips_what_was_missed(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
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

    def test_lockstep_time_begins_at_zero(self) -> None:
        clock = LockstepClock(1500)
        assert [clock.next_tick() for _ in range(3)] == [0, 1500, 3000]
        assert clock.lateness_us() == 0.0

    @pytest.mark.parametrize("priority", [None, 42])
    @pytest.mark.parametrize("refused", [False, True])
    def test_a_priority_is_taken_for_as_long_as_it_lasts_where_it_is_given(
        self, monkeypatch: pytest.MonkeyPatch, priority: int | None, refused: bool
    ) -> None:
        calls: list[tuple] = []

        def set_scheduler(pid: int, policy: int, parameter: Any) -> None:
            if refused:
                raise PermissionError
            calls.append((pid, policy, parameter))

        library = SimpleNamespace(
            mlockall=lambda flags: calls.append(("lock", flags)), munlockall=lambda: calls.append(("unlock",))
        )
        monkeypatch.setattr(clock_module, "ctypes", SimpleNamespace(CDLL=lambda _, use_errno=False: library))
        unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
        monkeypatch.setattr(clock_module.resource, "getrlimit", lambda _: unlimited)
        monkeypatch.setattr(os, "sched_getscheduler", lambda _: 1)
        monkeypatch.setattr(os, "sched_getparam", lambda _: "usual")
        monkeypatch.setattr(os, "sched_param", lambda value: value)
        monkeypatch.setattr(os, "sched_setscheduler", set_scheduler)
        with undisturbed(priority):
            assert not gc.isenabled()
            assert gc.get_freeze_count() > 0
        assert gc.isenabled()
        assert gc.get_freeze_count() == 0
        fifo, back = (0, os.SCHED_FIFO, 42), (0, 1, "usual")
        if priority is None:
            assert calls == []
        else:
            assert calls == [("lock", 3), *([] if refused else [fifo, back]), ("unlock",)]
