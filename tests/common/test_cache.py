"""Caches of programs and values; users without a home folder; pauses of the garbage collector."""

import gc
import weakref
from contextlib import suppress
from pathlib import Path
from unittest.mock import Mock

import pytest
from refused import refusal_of

from footfall.common import cache
from footfall.common.bounded_cache import BoundedCache
from footfall.common.cache import compilation_cache
from footfall.common.collector import collector_paused, lasting_objects
from footfall.deploy.log_store import default_store
from footfall.deploy.wiring_check.proof import is_proven, keep_proof
from footfall.machine import check_cache
from footfall.robots.description import Robot


def test_the_folder_is_the_one_given_by_the_user_or_in_the_home_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "mine"))
    assert compilation_cache() == tmp_path / "mine"
    for variable in ("JAX_COMPILATION_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable)
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert compilation_cache().parent == tmp_path / ".cache" / "footfall" / "jax"


def test_without_a_home_folder_refusals_and_findings_name_what_helps(
    go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a container with `--user 12345`. Trainings have no cache; a wiring is checked in each run."""
    for variable in ("HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME", "JAX_COMPILATION_CACHE_DIR"):
        monkeypatch.delenv(variable, raising=False)
    unknown = Mock(side_effect=RuntimeError("Could not determine home directory."))
    monkeypatch.setattr(Path, "home", unknown)
    assert "XDG_CACHE_HOME" in refusal_of(compilation_cache)
    assert "--log" in refusal_of(default_store, 1000)
    finding = check_cache()
    assert (finding.good, "HOME" in finding.result) == (False, True)
    assert not is_proven(go1, "socketcan")
    assert "HOME" in keep_proof(go1, "socketcan", [])
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/cache")
    assert compilation_cache().is_relative_to("/var/cache/footfall")


def test_the_processors_kind_is_read_from_the_first_core_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The order of the lines does not matter, on any architecture."""
    info = tmp_path / "cpuinfo"
    monkeypatch.setattr(cache, "CPU_INFO", info)

    def kind(text: str) -> str:
        info.write_text(text)
        return cache.processor_kind()

    core = "model name\t: A\nflags\t\t: x y\n"  # as Linux writes it
    first = kind(f"{core}\nmodel name: B\n")
    assert kind(f"{core}cpu MHz\t\t: 9.0\n\nmodel name: C\n") == first
    assert kind("flags\t\t: x y\nbogomips: 9\nmodel name\t: A\n\n") == first
    arm = (f"{core}{field}: 0x41\n\n" for field in ("CPU implementer", "CPU part", "Features"))
    for other_core in ("model name\t: B\nflags\t\t: x y\n\n", "model name\t: A\nflags\t\t: x\n\n", *arm):
        assert kind(other_core) != first
    monkeypatch.setattr(cache.platform, "machine", lambda: "riscv")
    digest = first.rpartition("-")[2]
    assert first != kind(f"{core}\n") == f"riscv-{digest}"
    assert len(digest) == 8
    info.unlink()
    names = set()
    for name in ("one", "two"):
        monkeypatch.setattr(cache.platform, "processor", lambda name=name: name)
        names.add(cache.processor_kind())
    assert len(names) == 2


def test_a_cache_never_holds_more_than_its_limit_and_keeps_the_newest_entry() -> None:
    bounded = BoundedCache[int, str](max_entries=3)
    for key in range(10):
        bounded[key] = str(key)
        assert len(bounded) <= 3
        assert bounded[key] == str(key)


def test_the_collector_is_as_it_was_after_a_pause() -> None:
    for was_on, fails in ((True, False), (True, True), (False, False), (False, True)):
        (gc.enable if was_on else gc.disable)()
        with suppress(KeyError), collector_paused():
            assert not gc.isenabled()
            if fails:
                raise KeyError
        after = gc.isenabled()
        gc.enable()
        assert after is was_on, (was_on, fails)


class Node:
    def __init__(self) -> None:
        self.me = self


def test_the_collector_passes_over_lasting_objects() -> None:
    with lasting_objects():
        lasting = weakref.ref(Node())
    passing = weakref.ref(Node())
    gc.collect()
    kept = [node() is not None for node in (lasting, passing)]
    gc.unfreeze()
    assert kept == [True, False]
