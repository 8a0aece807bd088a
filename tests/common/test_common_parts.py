"""Common parts by themselves: what doctor finds on machines that differ, settings, outputs, versions."""

import gc
import json
import os
import resource
import stat
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from footfall import machine
from footfall.common import cache, colours, config, installation, versions
from footfall.common.collector import collector_paused
from footfall.common.config import dump, load, merged, read_yaml, structure, unstructure
from footfall.common.errors import CannotWriteError, UserError
from footfall.common.files import write_atomically
from footfall.common.outputs import check_outputs, is_device, write_json, write_text
from footfall.common.private_files import NotPrivateError, read_private, write_private
from footfall.common.sources import read_sources


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What a Python of its own answers: set `code`, `out` and `err`; `asked` keeps how it was called."""
    answer = SimpleNamespace(code=0, out="", err="", asked=[], fails=lambda environment: False)

    def run(command: list[str], **options: Any) -> Any:
        answer.asked.append((command, options))
        if answer.code == "late":
            raise subprocess.TimeoutExpired(command, options["timeout"])
        code = 1 if answer.fails(options["env"]) else answer.code
        return SimpleNamespace(returncode=code, stdout=answer.out, stderr=answer.err)

    monkeypatch.setattr(machine.subprocess, "run", run)
    return answer


class TestDoctor:
    def test_it_looks_at_everything_once_in_a_newcomers_order(self, monkeypatch: pytest.MonkeyPatch) -> None:
        names = [check.__name__ for check in machine.CHECKS]
        assert names == [
            "_python", "_processors", "_packages", "_extras", "_simulators", "_accelerator", "_rendering",
            "_cache", "_can", "_multicast", "_realtime", "_locked_memory",
        ]  # fmt: skip
        monkeypatch.setattr(machine, "CHECKS", (lambda: "a", lambda: "b"))
        assert list(machine.findings()) == ["a", "b"]

    def test_a_probe_is_pythons_last_line_or_its_error(self, done: Any) -> None:
        done.out, done.err = "first\nlast\n", "trouble\nat the end\n"
        assert machine._probe("print()", MUJOCO_GL="egl") == (True, "last")
        command, options = done.asked[0]
        assert command == [sys.executable, "-P", "-c", "print()"]
        assert options["env"]["MUJOCO_GL"] == "egl"
        assert options["env"]["PATH"] == os.environ["PATH"]
        done.code = 1
        assert machine._probe("") == (False, "at the end")
        done.code, done.out = 0, ""
        assert machine._probe("") == (True, "")
        done.code = "late"
        assert machine._probe("") == (False, "no answer within 60 s")

    @pytest.mark.parametrize(
        ("kinds", "gpu"),
        [(["cpu"], False), (["NVIDIA H100", "NVIDIA H100"], True), (["cpu", "TPU v4"], True)],
    )
    def test_an_accelerator_is_any_device_but_a_processor(self, done: Any, kinds: list, gpu: bool) -> None:
        done.out = json.dumps(kinds)
        found = machine._accelerator()
        assert (found.good, found.found) == (gpu, ", ".join(kinds))
        assert ("jax[cuda12]" in found.advice) is not gpu

    def test_a_jax_that_does_not_start_or_is_not_there(
        self, done: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        done.code, done.err = 1, "no such driver"
        assert machine._accelerator()[1:] == (False, "JAX does not start", "no such driver")
        monkeypatch.setattr(machine.importlib.util, "find_spec", lambda _: None)
        found = machine._accelerator()
        assert (found.good, found.found) == (False, "no JAX")
        assert found.advice.startswith("to train: ")

    def test_rendering_is_tried_as_chosen_or_in_two_ways(
        self, done: Any, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("MUJOCO_GL", "glfw")
        assert machine._rendering()[1:3] == (True, "works with MUJOCO_GL=glfw")
        monkeypatch.delenv("MUJOCO_GL")
        assert machine._rendering().found == "works with MUJOCO_GL=egl"
        done.fails = lambda environment: environment["MUJOCO_GL"] == "egl"
        assert machine._rendering()[1:3] == (True, "works with MUJOCO_GL=osmesa")
        done.fails = lambda environment: True
        assert not machine._rendering().good
        tried = [options["env"]["MUJOCO_GL"] for _, options in done.asked]
        assert tried == ["glfw", "egl", "egl", "osmesa", "egl", "osmesa"]

    @pytest.mark.parametrize(
        ("limit", "locks", "good", "found"),
        [
            (resource.RLIM_INFINITY, False, True, "unlimited"),
            (256 * 2**20, False, True, "limit 256 MiB"),
            (256 * 2**20 - 1, False, False, "limit 256 MiB"),
            (8 * 2**20, True, True, "limit 8 MiB"),
        ],
    )
    def test_memory_may_be_locked_within_a_limit_or_beyond_it(
        self, monkeypatch: pytest.MonkeyPatch, limit: int, locks: bool, good: bool, found: str
    ) -> None:
        monkeypatch.setattr(machine.resource, "getrlimit", lambda kind: (limit, 1))
        monkeypatch.setattr(machine, "_may_lock_beyond_the_limit", lambda: locks)
        finding = machine._locked_memory()
        assert (finding.good, finding.found) == (good, found)
        assert bool(finding.advice) is not good

    @pytest.mark.parametrize("answer", [0, -1])
    def test_a_block_that_was_locked_is_unlocked_again(
        self, monkeypatch: pytest.MonkeyPatch, answer: int
    ) -> None:
        calls = []
        library = SimpleNamespace(
            mlock=lambda block, size: calls.append(("lock", size.value)) or answer,
            munlock=lambda block, size: calls.append(("unlock", size.value)),
        )
        monkeypatch.setattr(machine.ctypes, "CDLL", lambda *_, **__: library)
        assert machine._may_lock_beyond_the_limit() is (answer == 0)
        size = 16 * 2**20
        assert calls == [("lock", size), ("unlock", size)][: 2 if answer == 0 else 1]

    @pytest.mark.parametrize("status", [0, 256])
    def test_a_child_tries_whether_real_time_is_permitted(
        self, monkeypatch: pytest.MonkeyPatch, status: int
    ) -> None:
        monkeypatch.setattr(machine.os, "fork", lambda: 77)
        monkeypatch.setattr(machine.os, "waitpid", lambda pid, _: (pid, status))
        found = machine._realtime()
        assert (found.good, found.found) == (status == 0, "permitted" if status == 0 else "not permitted")
        assert ("rtprio" in found.advice) is (status != 0)

    def test_can_interfaces_are_network_links_of_their_type(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(machine, "NETWORK", tmp_path)
        monkeypatch.setattr(machine, "_has_can_sockets", lambda: True)
        assert machine._can()[1:3] == (False, "none")
        for name, kind in (("can1", "280"), ("eth0", "1"), ("can0", "280"), ("odd", None)):
            (tmp_path / name).mkdir()
            if kind is not None:
                (tmp_path / name / "type").write_text(f"{kind}\n")
        assert machine._can()[:3] == ("CAN interfaces", True, "can0, can1")
        assert machine._can().advice == ""

    def test_the_cache_is_counted_with_all_below_it(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(machine, "compilation_cache", lambda: tmp_path / "jax")
        assert machine._cache().found == f"{tmp_path / 'jax'}: empty"
        (tmp_path / "jax" / "deep").mkdir(parents=True)
        (tmp_path / "jax" / "a").write_bytes(bytes(2**20))
        (tmp_path / "jax" / "deep" / "b").write_bytes(bytes(2 * 2**20))
        assert machine._cache()[1:3] == (True, f"{tmp_path / 'jax'}: 2 files, 3 MiB")

    def test_only_the_missing_simulator_for_training_may_lack(self, monkeypatch: pytest.MonkeyPatch) -> None:
        there = {"mujoco": "3.1"}

        def find(name: str) -> str:
            if name not in there:
                raise machine.PackageNotFoundError(name)
            return there[name]

        monkeypatch.setattr(machine, "version", find)
        assert machine._simulators()[1:3] == (True, "mujoco-mjx is not installed")
        there.clear()
        assert machine._simulators()[1:] == (False, "mujoco is not installed", "")

    def test_packages_and_extras_that_lack_are_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lacking: dict[str, list] = {"": [], "train": [], "pages": [], "dev": ["x"]}
        require = installation.Requirement
        monkeypatch.setattr(machine, "extras", lambda: [name for name in lacking if name])
        monkeypatch.setattr(machine, "missing", lambda extra="": lacking[extra])
        assert machine._packages()[1:3] == (True, "all that acting on a robot needs")
        assert machine._extras()[1:3] == (True, "train, pages")
        lacking[""] = [require("mujoco>=9")]
        lacking["pages"] = [require("aiohttp"), require("rich>1")]
        found = machine._packages()
        assert (found.good, found.found) == (False, "missing or too old: mujoco")
        assert "mujoco>=9" in found.advice
        found = machine._extras()
        assert (found.good, found.found) == (False, "train; pages lacks aiohttp, rich")
        assert "pages" in found.advice
        assert "train" not in found.advice.replace(str(Path.cwd()), "")
        lacking["train"] = [require("jax")]
        assert machine._extras().found == "train lacks jax; pages lacks aiohttp, rich"


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

    def test_without_a_cache_of_the_users_it_lies_in_the_home(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.delenv("JAX_COMPILATION_CACHE_DIR", raising=False)
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.setattr(cache.Path, "home", lambda: tmp_path)
        assert cache.compilation_cache().parent == tmp_path / ".cache" / "footfall" / "jax"


@pytest.mark.parametrize("was_on", [True, False])
@pytest.mark.parametrize("fails", [True, False])
def test_the_collector_is_as_it_was_after_a_pause(was_on: bool, fails: bool) -> None:
    (gc.enable if was_on else gc.disable)()
    try:
        with collector_paused():
            assert not gc.isenabled()
            if fails:
                raise KeyError
    except KeyError:
        pass
    finally:
        after = gc.isenabled()
        gc.enable()
    assert after is was_on


@dataclass(frozen=True)
class Inner:
    size: float
    names: tuple[str, ...] = ()
    on: bool = False


@dataclass(frozen=True)
class Outer:
    count: int
    inner: Inner
    label: str = "none"


@dataclass(frozen=True)
class Defaults:
    count: int = 3


@dataclass(frozen=True)
class Span:
    ends: tuple[float, float]


class TestSettings:
    def test_are_plain_data_as_json_has_them(self) -> None:
        assert unstructure(Span((0.2, 0.8))) == {"ends": [0.2, 0.8]}

    def test_a_file_reads_as_what_was_dumped(self, tmp_path: Path) -> None:
        settings = Outer(3, Inner(2.5, ("b", "a"), True), "yes")
        path = tmp_path / "a.yaml"
        path.write_text(dump(settings))
        assert load(path, Outer) == settings
        assert dump(settings).splitlines()[0] == "count: 3"  # in the order of the fields
        inner = unstructure(settings)["inner"]
        assert (inner["size"], list(inner["names"]), inner["on"]) == (2.5, ["b", "a"], True)

    @pytest.mark.parametrize(
        ("data", "says"),
        [
            ({"count": 1.0, "inner": {"size": 1}}, "here: count: 1.0 is not a whole number"),
            ({"count": True, "inner": {"size": 1}}, "here: count: True is not a whole number"),
            ({"count": 1, "inner": {"size": True}}, "here: inner.size: True is not a number"),
            ({"count": 1, "inner": {"size": "1"}}, "here: inner.size: '1' is not a number"),
            ({"count": 1, "inner": {"size": 10**400}}, "here: inner.size: not a finite number"),
            ({"count": 1, "inner": {"size": -float("inf")}}, "here: inner.size: not a finite number"),
            ({"count": 1, "inner": {"size": 1, "on": 1}}, "here: inner.on: 1 is not true or false"),
            ({"count": 1, "inner": {"size": 1, "names": [7]}}, "here: inner.names[0]: 7 is not text"),
            (
                {"count": 1, "inner": {"size": 1, "b": 2, "a": 3}},
                "here: inner: no setting a, b (there are size, names, on)",
            ),
            ({"count": 1, "inner": None}, "here: inner: expected a mapping of settings"),
            ({"count": 1, "inner": 3}, "here: inner: expected a mapping of settings"),
            ([1], "here: expected a mapping of settings, found list"),
        ],
    )
    def test_what_is_wrong_is_named_with_its_place(self, data: Any, says: str) -> None:
        with pytest.raises(UserError) as caught:
            structure(data, Outer, "here")
        assert str(caught.value) == says

    def test_an_empty_file_leaves_every_setting_at_its_default(self, tmp_path: Path) -> None:
        (tmp_path / "empty.yaml").write_text("# nothing\n")
        assert load(tmp_path / "empty.yaml", Defaults) == Defaults()
        with pytest.raises(UserError, match=r"empty\.yaml: count: required"):
            load(tmp_path / "empty.yaml", Outer)

    @pytest.mark.parametrize("text", ["1e-3", "-2E5", "+3.e4", "1e3"])
    def test_exponents_make_numbers(self, text: str) -> None:
        assert structure({"size": text}, Inner, "").size == float(text)

    def test_a_merge_replaces_leaf_by_leaf_and_leaves_both_as_they_were(self) -> None:
        base = {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
        changes = {"a": {"c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
        expected = {"a": {"b": 1, "c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
        assert merged(base, changes) == expected
        assert base == {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
        assert merged({"a": 1}, {"a": {"b": 2}}) == {"a": {"b": 2}}

    def test_a_file_of_the_largest_size_is_read_and_one_byte_more_refused(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(config, "LARGEST_BYTES", 2000)
        path = tmp_path / "a.yaml"
        path.write_text("a: 1 #" + "x" * 1994)
        assert read_yaml(path) == {"a": 1}
        path.write_text("a: 1 #" + "x" * 1995)
        with pytest.raises(UserError, match="larger than 2,000 bytes"):
            read_yaml(path)
        with pytest.raises(UserError, match=r"no\.yaml: No such file"):
            read_yaml(tmp_path / "no.yaml")


class TestOutputs:
    def test_content_is_plain_whatever_it_was(self, tmp_path: Path) -> None:
        content = {
            1: (1, 2.5),
            "array": np.array([[1.5, np.nan]]),
            "number": np.float32(0.5),
            "flag": np.bool_(True),
            "path": Path("a/b"),
            "nested": [{"x": float("-inf")}],
            "none": None,
        }
        write_json(tmp_path / "a.json", content)
        text = (tmp_path / "a.json").read_text()
        assert json.loads(text) == {
            "1": [1, 2.5],
            "array": [[1.5, None]],
            "number": 0.5,
            "flag": True,
            "path": "a/b",
            "nested": [{"x": None}],
            "none": None,
        }
        assert text.endswith("}\n")
        write_json(None, content)

    def test_a_device_is_written_to_and_not_replaced(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        assert is_device(pipe)
        assert is_device(Path("/dev/null"))
        assert not is_device(tmp_path)
        assert not is_device(tmp_path / "none")
        check_outputs(pipe, Path("/dev/null"))
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        try:
            write_text(pipe, "through ✓")
            assert os.read(reader, 100).decode() == "through ✓"
        finally:
            os.close(reader)
        assert stat.S_ISFIFO(pipe.stat().st_mode)

    def test_a_link_leads_to_its_file_which_is_replaced(self, tmp_path: Path) -> None:
        (tmp_path / "there").mkdir()
        real, link = tmp_path / "there" / "real", tmp_path / "link"
        real.write_text("old")
        link.symlink_to(real)
        check_outputs(link)
        write_text(link, "new")
        assert real.read_text() == "new"
        assert link.is_symlink()
        with pytest.raises(UserError, match="cannot write two outputs"):
            check_outputs(link, tmp_path / "other", real)
        check_outputs(link, tmp_path / "other", None, None)

    def test_a_file_has_the_mode_that_it_is_given(self, tmp_path: Path) -> None:
        write_atomically(tmp_path / "a", b"x", mode=0o604)
        assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o604
        mask = os.umask(0o077)
        try:
            write_atomically(tmp_path / "b", b"y")
            assert os.umask(0o077) == 0o077  # it is left as it was
        finally:
            os.umask(mask)
        assert stat.S_IMODE((tmp_path / "b").stat().st_mode) == 0o600
        assert issubclass(CannotWriteError, UserError)


class TestPrivateFiles:
    def test_folder_and_file_are_for_their_owner_alone(self, tmp_path: Path) -> None:
        path = tmp_path / "deep" / "folder" / "file"
        write_private(path, b"mine")
        write_private(path, b"mine again")
        assert read_private(path) == b"mine again"
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700

    @pytest.mark.parametrize("mode", [0o720, 0o702])
    def test_neither_group_nor_others_may_write_to_its_folder(self, tmp_path: Path, mode: int) -> None:
        path = tmp_path / "folder" / "file"
        write_private(path, b"")
        path.parent.chmod(mode)
        for act in (lambda: read_private(path), lambda: write_private(path, b"")):
            with pytest.raises(NotPrivateError, match=f"others may write to {path.parent}"):
                act()

    def test_a_folder_that_is_a_link_is_refused(self, tmp_path: Path) -> None:
        write_private(tmp_path / "real" / "file", b"")
        (tmp_path / "link").symlink_to(tmp_path / "real")
        with pytest.raises(NotPrivateError, match="link is a symbolic link"):
            read_private(tmp_path / "link" / "file")
        with pytest.raises(NotPrivateError, match="link is a symbolic link"):
            write_private(tmp_path / "link" / "file", b"")


def test_sources_are_all_files_of_their_kinds_at_any_depth_of_their_packages(tmp_path: Path) -> None:
    files = ("b/two.py", "a/one.py", "a/deep/er/three.py", "a/own.yaml", "a/notes.md", "c/four.py", "five.py")
    for file in files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(f"of {file}")

    def read(*kinds: str) -> list[tuple[str, str]]:
        found = read_sources(tmp_path, ("b", "a"), *((kinds,) if kinds else ()))
        return [(str(path), content.decode()) for path, content in found]

    python = [(file, f"of {file}") for file in ("a/deep/er/three.py", "a/one.py", "b/two.py")]
    assert read() == python
    assert read("*.py", "*.yaml", "*.*ml") == sorted([*python, ("a/own.yaml", "of a/own.yaml")])


def test_versions_of_python_and_of_each_package() -> None:
    found = versions.versions(["numpy", "no-such-package"])
    assert found == {
        "python": ".".join(map(str, sys.version_info[:3])),
        "numpy": np.__version__,
        "no-such-package": "not installed as a package",
    }


def test_arrows_of_command_velocity_and_push_are_blue_green_and_red() -> None:
    strongest = [int(np.argmax(each[:3])) for each in (colours.COMMAND, colours.VELOCITY, colours.PUSH)]
    assert strongest == [2, 1, 0]


class TestRequirements:
    """Of a package with nested extras, as a distribution's metadata tells of them."""

    LINES = (
        "numpy>=1.26",
        "mujoco; python_version >= '3'",
        "winonly; sys_platform == 'nowhere'",
        "jax; extra == 'train'",
        "footfall[train,video]; extra == 'all'",
        "av>=10; extra == 'video'",
        "pytest; extra == 'dev'",
    )

    @pytest.fixture(autouse=True)
    def told(self, monkeypatch: pytest.MonkeyPatch) -> None:
        metadata = SimpleNamespace(
            get_all=lambda name: ["all", "train"] if name == "Provides-Extra" else None
        )
        known = SimpleNamespace(requires=list(self.LINES), metadata=metadata)
        monkeypatch.setattr(installation, "distribution", lambda name: known)

    def test_an_extra_is_made_of_what_it_adds_and_includes(self) -> None:
        def names(*extra: str) -> list[str]:
            return [str(package) for package in installation.requirements(*extra)]

        assert names() == ["numpy>=1.26", "mujoco"]
        assert names("train") == ["jax"]
        assert names("all") == ["jax", "av>=10"]
        assert installation.extras() == ["all", "train"]

    def test_what_is_missing_is_absent_or_of_another_version(self, monkeypatch: pytest.MonkeyPatch) -> None:
        there = {"numpy": "1.25", "jax": "0.4", "av": "11.0rc1"}

        def find(name: str) -> str:
            if name not in there:
                raise installation.PackageNotFoundError(name)
            return there[name]

        monkeypatch.setattr(installation, "version", find)
        assert [package.name for package in installation.missing()] == ["numpy", "mujoco"]
        assert [package.name for package in installation.missing("all")] == []
        there["av"] = "9.9"
        assert [package.name for package in installation.missing("all")] == ["av"]
