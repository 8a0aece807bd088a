"""Where compiled programs are kept: unlike processors that share a home do not share programs."""

from pathlib import Path

import pytest

from footfall.common import cache
from footfall.common.cache import compilation_cache, processor_kind

# As Linux writes it: a tab before the colon.
CORE = "processor\t: {core}\nmodel name\t: {model}\ncpu MHz\t\t: {clock}\nflags\t\t: {flags}\n\n"


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, **said: str) -> str:
    info = tmp_path / "cpuinfo"
    text = {"model": "A", "flags": "sse avx2", "clock": "1000.0"} | said
    info.write_text(CORE.format(core=0, **text) + CORE.format(core=1, **(text | {"clock": "9"})))
    monkeypatch.setattr(cache, "CPU_INFO", info)
    return processor_kind()


def test_a_kind_is_known_by_its_model_and_features_not_by_its_clock(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = kind(tmp_path, monkeypatch)
    assert kind(tmp_path, monkeypatch, clock="2000.0") == first
    assert kind(tmp_path, monkeypatch, model="B") != first
    assert kind(tmp_path, monkeypatch, flags="sse") != first


def test_each_kind_has_a_folder_of_its_own(home: Path) -> None:
    assert compilation_cache() == home / "footfall" / "jax" / processor_kind()


def test_a_folder_that_the_user_names_is_taken_as_it_is(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(home / "mine"))
    assert compilation_cache() == home / "mine"
