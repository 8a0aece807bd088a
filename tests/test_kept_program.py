"""A compiled program is kept from one training to the next, and found again only by what it was made from."""

import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from flax import struct

from footfall.envs.workarounds import kept_program
from footfall.envs.workarounds.kept_program import fingerprint, model_bytes, read_ahead
from footfall.robots.description import load_robot


@struct.dataclass
class Statistics:
    mean: jax.Array


class State(NamedTuple):
    numbers: jax.Array
    statistics: Statistics
    parts: tuple[dict[str, jax.Array], ...]


STATE = State(jnp.arange(3.0), Statistics(jnp.float32(2.0)), ({"a": jnp.ones((2, 2))}, {}))


def advance(state: State) -> tuple[State, dict[str, jax.Array]]:
    numbers = state.numbers * state.statistics.mean
    return state._replace(numbers=numbers), {"total": numbers.sum()}


class Maker:
    """Compiles `advance` and counts how often."""

    def __init__(self) -> None:
        self.made = 0

    def __call__(self) -> Any:
        self.made += 1
        return jax.jit(advance).lower(STATE).compile()


def kept(make: Any, *made_from: Any) -> Any:
    """The program, once whatever is written of it is written."""
    program = kept_program.kept(make, *made_from)
    for thread in threading.enumerate():
        if thread.name == "keep program":
            thread.join()
    return program


@pytest.fixture
def make() -> Maker:
    return Maker()


@pytest.fixture
def cache(tmp_path: Path) -> Iterator[Path]:
    before = jax.config.values["jax_compilation_cache_dir"]
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)


def only_file(cache: Path) -> Path:
    (path,) = (cache / "programs").iterdir()
    return path


def test_a_program_is_made_once_and_does_the_same_from_then_on(cache: Path, make: Maker) -> None:
    first, again = kept(make, "settings"), kept(make, "settings")
    assert make.made == 1
    (state, totals), (also_state, also_totals) = first(STATE), again(STATE)
    assert isinstance(also_state, State)
    assert isinstance(also_state.statistics, Statistics)
    assert jax.tree.structure((state, totals)) == jax.tree.structure((also_state, also_totals))
    for one, two in zip(*map(jax.tree.leaves, ((state, totals), (also_state, also_totals))), strict=True):
        assert np.array_equal(one, two)
    assert float(also_totals["total"]) == 6.0


def test_a_program_may_be_read_ahead(cache: Path, make: Maker) -> None:
    kept(make, "settings")
    read_ahead("settings")
    read_ahead("settings")  # the same request again
    file = only_file(cache)
    kept_program._ahead[fingerprint(("settings",))].result()
    file.unlink()
    assert float(kept(make, "settings")(STATE)[1]["total"]) == 6.0
    assert make.made == 1
    assert fingerprint(("settings",)) not in kept_program._ahead
    kept(make, "settings")
    assert make.made == 2


def test_nobody_waits_for_a_program_to_be_written(
    cache: Path, make: Maker, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked_for = threading.Event()

    def slow(program: Any) -> Any:
        assert asked_for.wait(60)
        return serialize(program)

    serialize = kept_program.serialize
    monkeypatch.setattr(kept_program, "serialize", slow)
    kept_program.kept(make, "settings")
    assert not (cache / "programs").exists()
    asked_for.set()
    kept(make, "settings")
    assert only_file(cache).stat().st_size > 0


def test_what_is_not_there_to_be_read_ahead_is_made(cache: Path, make: Maker) -> None:
    read_ahead("settings")
    assert float(kept(make, "settings")(STATE)[1]["total"]) == 6.0
    assert make.made == 1


def test_other_things_make_another_program(cache: Path, make: Maker, monkeypatch: pytest.MonkeyPatch) -> None:
    kept(make, "settings", b"model")
    kept(make, "settings", b"another model")
    kept(make, "other settings", b"model")
    monkeypatch.setenv("XLA_FLAGS", "--xla_gpu_autotune_level=0")
    kept(make, "settings", b"model")
    assert make.made == 4


def test_changed_source_makes_another_program(
    cache: Path, make: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "source" / "envs" / "velocity.py"
    source.parent.mkdir(parents=True)
    monkeypatch.setattr(kept_program, "SOURCES", tmp_path / "source")
    for text, made in (("one", 1), ("two", 2), ("one", 2)):
        source.write_text(text)
        kept(make)
        assert make.made == made


def test_every_package_of_ours_that_a_program_imports_counts() -> None:
    imported = {
        match
        for package in kept_program.TRACED
        for path in (kept_program.SOURCES / package).rglob("*.py")
        for match in re.findall(r"^(?:from|import) footfall\.(\w+)", path.read_text(), re.MULTILINE)
    }
    ours = {path.parent.name for path in kept_program.SOURCES.glob("*/__init__.py")}
    assert imported & ours == set(kept_program.TRACED)


@pytest.mark.parametrize("content", [b"", b"not a program", b"\x80\x04N."])
def test_a_damaged_file_is_replaced(cache: Path, make: Maker, content: bytes) -> None:
    kept(make)
    only_file(cache).write_bytes(content)
    assert float(kept(make)(STATE)[1]["total"]) == 6.0
    assert make.made == 2
    kept(make)
    assert make.made == 2


def test_what_cannot_be_written_is_not_kept(cache: Path, make: Maker) -> None:
    (cache / "programs").write_text("a file where the folder should be")
    assert float(kept(make)(STATE)[1]["total"]) == 6.0


def test_a_program_that_calls_python_is_not_kept(cache: Path) -> None:
    shape = jax.ShapeDtypeStruct((), jnp.float32)

    def calling() -> Any:
        return jax.jit(lambda x: jax.pure_callback(lambda y: 2 * y, shape, x)).lower(1.0).compile()

    assert [float(kept(calling)(3.0)) for _ in range(2)] == [6.0, 6.0]
    assert not any(cache.rglob("programs/*"))


def test_nothing_is_kept_without_a_cache(cache: Path, make: Maker) -> None:
    jax.config.update("jax_compilation_cache_dir", None)
    kept(make)
    kept(make)
    assert make.made == 2
    assert list(cache.iterdir()) == []


def test_fingerprints_tell_apart_what_only_joins_to_the_same() -> None:
    assert len({fingerprint(p) for p in (["ab", "c"], ["a", "bc"], [b"abc"], ["abc"], [])}) == 5


def test_a_model_is_known_by_its_content() -> None:
    robot = load_robot("go1")
    assert model_bytes(robot, 0.005) == model_bytes(robot, 0.005)
    assert model_bytes(robot, 0.005) != model_bytes(robot, 0.004)
