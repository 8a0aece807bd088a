"""A compiled program is kept from one training to the next, and identified by its inputs."""

import os
import pickle
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest
from flax import struct
from hostile import Hostile

import footfall
from footfall.envs.workarounds import program_cache
from footfall.envs.workarounds.program_cache import fingerprint, prefetch

FAR_FUTURE_NS = 2**63


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


class Maker:
    """Traces `advance` and counts how often."""

    def __init__(self) -> None:
        self.made = 0

    def __call__(self) -> Any:
        self.made += 1
        return jax.jit(advance).lower(STATE)


def kept(make: Any, *made_from: Any, report: Any = print) -> Any:
    """The program, after its file has been written."""
    with ThreadPoolExecutor(1) as beside:
        program = program_cache.load_or_compile(make, beside, report, *made_from).result()
    for thread in threading.enumerate():
        if thread.name == "keep program":
            thread.join()
    return program


@pytest.fixture(autouse=True)
def _sources_are_as_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sources count as unchanged, even if they are edited while the tests run."""
    monkeypatch.setattr(footfall, "IMPORTED_AT_NS", FAR_FUTURE_NS)


@pytest.fixture
def make() -> Maker:
    return Maker()


@pytest.fixture
def cache(tmp_path: Path) -> Iterator[Path]:
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only source that programs are made from."""
    path = tmp_path / "source" / "envs" / "locomotion.py"
    path.parent.mkdir(parents=True)
    monkeypatch.setattr(program_cache, "SOURCES", tmp_path / "source")
    return path


def only_file(cache: Path) -> Path:
    (path,) = (cache / "programs").iterdir()
    return path


def test_a_program_is_made_once_and_reused(cache: Path, make: Maker) -> None:
    first, again = kept(make, "settings"), kept(make, "settings")
    assert make.made == 1
    (state, totals), (also_state, also_totals) = first(STATE), again(STATE)
    assert isinstance(also_state, State)
    assert isinstance(also_state.statistics, Statistics)
    assert jax.tree.structure((state, totals)) == jax.tree.structure((also_state, also_totals))
    for one, two in zip(*map(jax.tree.leaves, ((state, totals), (also_state, also_totals))), strict=True):
        assert np.array_equal(one, two)
    assert float(also_totals["total"]) == 6.0


def test_a_program_can_be_read_ahead(cache: Path, make: Maker) -> None:
    kept(make, "settings")
    prefetch(("settings",))
    prefetch(("settings",))  # the same request again
    file = only_file(cache)
    program_cache._loading[fingerprint(("settings",))].result()
    file.unlink()
    assert float(kept(make, "settings")(STATE)[1]["total"]) == 6.0
    assert make.made == 1
    assert fingerprint(("settings",)) not in program_cache._loading
    kept(make, "settings")
    assert make.made == 2


def test_other_inputs_make_another_program(cache: Path, make: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(make, "settings", b"model")
    kept(make, "settings", b"another model")
    kept(make, "other settings", b"model")
    monkeypatch.setenv("XLA_FLAGS", "--xla_gpu_autotune_level=0")
    kept(make, "settings", b"model")
    assert make.made == 4


def test_a_changed_source_makes_another_program(cache: Path, make: Maker, source: Path) -> None:
    for text, made in (("one", 1), ("two", 2), ("one", 2)):
        source.write_text(text)
        kept(make)
        assert make.made == made


def test_no_program_is_kept_if_a_source_changed_after_its_import(
    cache: Path, make: Maker, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """If kept, the old program would be stored under the new source text."""
    source.write_text("new")
    os.utime(source, (0, 0))  # as an editor or a checkout may do
    for imported_at, made, files in ((0, 1, 0), (FAR_FUTURE_NS, 2, 1), (0, 3, 1), (FAR_FUTURE_NS, 3, 1)):
        monkeypatch.setattr(footfall, "IMPORTED_AT_NS", imported_at)
        kept(make)
        assert (make.made, len(list(cache.rglob("programs/*")))) == (made, files)


def test_code_that_others_may_have_written_is_not_run(cache: Path, make: Maker, tmp_path: Path) -> None:
    kept(make)
    file = only_file(cache)
    file.write_bytes(pickle.dumps(Hostile(tmp_path / "made")))
    file.chmod(0o620)
    lines: list[str] = []
    assert float(kept(make, report=lines.append)(STATE)[1]["total"]) == 6.0
    assert not (tmp_path / "made").exists()
    assert (make.made, len(lines)) == (2, 1)


def test_the_least_recently_used_program_is_deleted(
    cache: Path, make: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept(make, "first")
    monkeypatch.setattr(program_cache, "MAX_BYTES", int(2.5 * only_file(cache).stat().st_size))
    kept(make, "second")
    for age, file in enumerate(sorted(cache.rglob("programs/*"), key=lambda path: path.stat().st_mtime_ns)):
        os.utime(file, ns=(age, age))
    kept(make, "first")  # used again: the second is the older one now
    kept(make, "third")
    assert make.made == 3
    kept(make, "first")
    kept(make, "third")
    assert make.made == 3
    kept(make, "second")
    assert make.made == 4


def test_another_driver_or_precision_makes_another_program(
    cache: Path, make: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept(make)
    driver = tmp_path / "version"
    driver.write_text("NVRM version: 590.1")
    monkeypatch.setattr(program_cache, "NVIDIA_DRIVER", driver)
    kept(make)
    assert make.made == 2
    before = jax.config.values["jax_default_matmul_precision"]
    jax.config.update("jax_default_matmul_precision", "highest")
    try:
        kept(make)
    finally:
        jax.config.update("jax_default_matmul_precision", before)
    assert make.made == 3
    (tmp_path / "nvidia_cublas_cu12-12.9.1.4.dist-info").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    kept(make)
    assert make.made == 4


@pytest.mark.parametrize("content", [b"", b"not a program", b"\x80\x04N."])
def test_a_damaged_file_is_replaced(cache: Path, make: Maker, content: bytes) -> None:
    kept(make)
    only_file(cache).write_bytes(content)
    assert float(kept(make)(STATE)[1]["total"]) == 6.0
    assert make.made == 2
    kept(make)
    assert make.made == 2
