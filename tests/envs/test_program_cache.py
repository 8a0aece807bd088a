"""A compiled program is kept from one training to the next, and identified by its inputs."""

import os
import pickle
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import Mock

import jax
import numpy as np
import pytest
from flax import struct
from hostile import Hostile

import footfall
from footfall.envs.workarounds import program_cache
from footfall.envs.workarounds.program_cache import fingerprint, prefetch

IN_2001_NS, FAR_FUTURE_NS = 10**18, 2**63


@struct.dataclass
class Statistics:
    mean: jax.Array


class State(NamedTuple):
    numbers: jax.Array
    statistics: Statistics
    parts: tuple[dict[str, jax.Array], ...]


STATE = State(
    np.arange(3.0, dtype=np.float32), Statistics(np.float32(2.0)), ({"a": np.ones((2, 2), np.float32)}, {})
)


def advance(state: State) -> tuple[State, dict[str, jax.Array]]:
    numbers = state.numbers * state.statistics.mean
    return state._replace(numbers=numbers), {"total": numbers.sum()}


def kept(make: Any, *key: Any, report: Any = print) -> Any:
    """The program, after its file has been written."""
    with ThreadPoolExecutor(1) as beside:
        program = program_cache.load_or_compile(make, beside, report, *key).result()
    for thread in threading.enumerate():
        if thread.name == "keep program":
            thread.join()
    return program


@pytest.fixture(autouse=True)
def _sources_are_as_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sources count as unchanged, even if they are edited while the tests run."""
    monkeypatch.setattr(footfall, "IMPORTED_AT_NS", FAR_FUTURE_NS)


@pytest.fixture
def make() -> Mock:
    """Traces `advance` and counts how often."""
    return Mock(side_effect=lambda: jax.jit(advance).lower(STATE))


@pytest.fixture
def cache(tmp_path: Path) -> Iterator[Path]:
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def only_file(cache: Path) -> Path:
    (path,) = (cache / "programs").iterdir()
    return path


def test_a_program_is_made_once_and_reused(cache: Path, make: Mock) -> None:
    first, again = (kept(make, "settings")(STATE) for _ in range(2))
    assert make.call_count == 1
    assert isinstance(again[0], State)
    assert isinstance(again[0].statistics, Statistics)
    jax.tree.map(np.testing.assert_array_equal, first, again)
    assert float(again[1]["total"]) == 6.0


def test_a_program_can_be_read_ahead(cache: Path, make: Mock) -> None:
    kept(make, "settings")
    for _ in range(2):
        prefetch(("settings",))
    program_cache._loading[fingerprint(("settings",))].result()
    only_file(cache).unlink()
    assert float(kept(make, "settings")(STATE)[1]["total"]) == 6.0
    assert make.call_count == 1
    assert fingerprint(("settings",)) not in program_cache._loading
    kept(make, "settings")
    assert make.call_count == 2


def test_a_changed_source_makes_another_program_which_is_not_kept_if_it_changed_after_its_import(
    cache: Path, make: Mock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If kept, the old program would be stored under the new source text."""
    source = tmp_path / "source" / "envs" / "locomotion.py"  # the only one that programs are made from
    source.parent.mkdir(parents=True)
    monkeypatch.setattr(program_cache, "SOURCES", tmp_path / "source")
    for text, imported_at, made, files in (
        ("one", FAR_FUTURE_NS, 1, 1), ("two", FAR_FUTURE_NS, 2, 2), ("one", FAR_FUTURE_NS, 2, 2),
        ("new", IN_2001_NS, 3, 2), ("new", FAR_FUTURE_NS, 4, 3), ("new", IN_2001_NS, 5, 3),
        ("new", FAR_FUTURE_NS, 5, 3),
    ):  # fmt: skip
        source.write_text(text)
        os.utime(source, (0, 0))  # as an editor or a checkout may do
        monkeypatch.setattr(footfall, "IMPORTED_AT_NS", imported_at)
        kept(make)
        assert (make.call_count, len(list(cache.rglob("programs/*")))) == (made, files)


def test_code_that_others_may_have_written_is_not_run(cache: Path, make: Mock, tmp_path: Path) -> None:
    kept(make)
    file = only_file(cache)
    file.write_bytes(pickle.dumps(Hostile(tmp_path / "made")))
    file.chmod(0o620)
    lines: list[str] = []
    assert float(kept(make, report=lines.append)(STATE)[1]["total"]) == 6.0
    assert not (tmp_path / "made").exists()
    assert (make.call_count, len(lines)) == (2, 1)


def test_the_longest_unused_program_goes(cache: Path, make: Mock, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(make, "first")
    monkeypatch.setattr(program_cache, "MAX_BYTES", int(2.5 * only_file(cache).stat().st_size))
    kept(make, "second")
    for age, file in enumerate(sorted(cache.rglob("programs/*"), key=lambda path: path.stat().st_mtime_ns)):
        os.utime(file, ns=(age, age))
    kept(make, "first")  # used again: the second is the older one now
    for name, made in (("third", 3), ("first", 3), ("third", 3), ("second", 4)):
        kept(make, name)
        assert make.call_count == made


def test_another_input_library_driver_or_precision_makes_another_program(
    cache: Path, make: Mock, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def count(*key: object) -> int:
        kept(make, *key)
        return make.call_count

    assert count("settings", b"model") == 1
    assert count("settings", b"another model") == 2
    assert count("other settings", b"model") == 3
    monkeypatch.setenv("XLA_FLAGS", "--xla_gpu_autotune_level=0")
    assert count("settings", b"model") == 4
    driver = tmp_path / "version"
    driver.write_text("NVRM version: 590.1")
    monkeypatch.setattr(program_cache, "NVIDIA_DRIVER", driver)
    assert count("settings", b"model") == 5
    before = jax.config.values["jax_default_matmul_precision"]
    jax.config.update("jax_default_matmul_precision", "highest")
    try:
        assert count("settings", b"model") == 6
    finally:
        jax.config.update("jax_default_matmul_precision", before)
    (tmp_path / "nvidia_cublas_cu12-12.9.1.4.dist-info").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    assert count("settings", b"model") == 7


@pytest.mark.parametrize("content", [b"", b"not a program", b"\x80\x04N."])
def test_a_damaged_file_is_replaced(cache: Path, make: Mock, content: bytes) -> None:
    kept(make)
    only_file(cache).write_bytes(content)
    for _ in range(2):
        assert float(kept(make)(STATE)[1]["total"]) == 6.0
        assert make.call_count == 2
