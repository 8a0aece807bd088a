"""Where compiled programs are kept."""

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


def test_a_kind_is_its_model_and_features_not_clock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = kind(tmp_path, monkeypatch)
    assert kind(tmp_path, monkeypatch, clock="2000.0") == first
    assert kind(tmp_path, monkeypatch, model="B") != first
    assert kind(tmp_path, monkeypatch, flags="sse") != first


def test_a_folder_that_the_user_names_is_taken_as_it_is(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(home / "mine"))
    assert compilation_cache() == home / "mine"


class TestCache:
    def test_a_kind_is_the_first_cores_and_no_other_lines(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """In any order of lines, on any architecture."""
        info = tmp_path / "cpuinfo"
        monkeypatch.setattr(cache, "CPU_INFO", info)

        def kind(text: str) -> str:
            info.write_text(text)
            return cache.processor_kind()

        first = kind("model name\t: A\nflags\t\t: x y\n\nmodel name: B\n")
        assert kind("flags\t\t: x y\nbogomips: 9\nmodel name\t: A\n\n") == first
        for line in ("CPU implementer", "CPU part", "Features"):
            assert kind(f"model name\t: A\nflags\t\t: x y\n{line}: 0x41\n\n") != first
        monkeypatch.setattr(cache.platform, "machine", lambda: "riscv")
        other = kind("model name\t: A\nflags\t\t: x y\n\n")
        assert other != first
        assert other.startswith("riscv-")
        assert other.rpartition("-")[2] == first.rpartition("-")[2]
        assert len(first.rpartition("-")[2]) == 8
        info.unlink()
        names = []
        for name in ("one", "two"):
            monkeypatch.setattr(cache.platform, "processor", lambda name=name: name)
            names.append(cache.processor_kind())
        assert names[0] != names[1]

    def test_default_is_the_home_folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.setattr(cache.Path, "home", lambda: tmp_path)
        assert cache.compilation_cache().parent == tmp_path / ".cache" / "footfall" / "jax"
