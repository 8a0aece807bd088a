"""The folder of compiled programs, and the processor's kind in its name."""

from pathlib import Path

import pytest

from footfall.common import cache
from footfall.common.cache import compilation_cache


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path


def test_a_folder_given_by_the_user_is_used_unchanged(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(home / "mine"))
    assert compilation_cache() == home / "mine"


class TestCache:
    def test_the_processors_kind_is_read_from_the_first_core_only(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """The order of the lines does not matter, on any architecture."""
        info = tmp_path / "cpuinfo"
        monkeypatch.setattr(cache, "CPU_INFO", info)

        def kind(text: str) -> str:
            info.write_text(text)
            return cache.processor_kind()

        first = kind("model name\t: A\nflags\t\t: x y\n\nmodel name: B\n")  # as Linux writes it
        assert kind("model name\t: A\nflags\t\t: x y\ncpu MHz\t\t: 9.0\n\nmodel name: C\n") == first
        for other_core in ("model name\t: B\nflags\t\t: x y\n\n", "model name\t: A\nflags\t\t: x\n\n"):
            assert kind(other_core) != first
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
