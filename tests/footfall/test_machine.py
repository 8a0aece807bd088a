"""The output of doctor for its findings."""

import json
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from packaging.requirements import Requirement

from footfall import machine


def test_both_simulators_are_of_one_release(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"mujoco": "3.17.0", "mujoco-mjx": "3.17.0"}
    monkeypatch.setattr(machine, "version", versions.__getitem__)
    assert machine.check_simulators()[:2] == ("simulators", True)
    versions["mujoco-mjx"] = "3.16.0"
    found = machine.check_simulators()
    assert not found.good
    assert found.found == "mujoco 3.17.0, mujoco-mjx 3.16.0"


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The answer of another Python: set `code`, `out` and `err`; `calls` records how it was called."""
    answer = SimpleNamespace(code=0, out="", err="", calls=[], fails=lambda environment: False)

    def run(command: list[str], **options: Any) -> Any:
        answer.calls.append((command, options))
        if answer.code == "late":
            raise subprocess.TimeoutExpired(command, options["timeout"])
        code = 1 if answer.fails(options["env"]) else answer.code
        return SimpleNamespace(returncode=code, stdout=answer.out, stderr=answer.err)

    monkeypatch.setattr(machine.subprocess, "run", run)
    return answer


class TestDoctor:
    def test_it_checks_everything_and_never_fails(self, done: Any) -> None:
        done.code, done.err = 1, "nothing works here"
        result = " ".join(finding.what for finding in machine.findings())
        for what in (
            "processors", "packages", "simulators", "accelerator", "offscreen rendering",
            "compilation cache", "CAN interfaces", "real-time", "memory locking",
        ):  # fmt: skip
            assert what in result

    @pytest.mark.parametrize(
        ("kinds", "gpu"),
        [(["cpu"], False), (["NVIDIA H100", "NVIDIA H100"], True), (["cpu", "TPU v4"], True)],
    )
    def test_an_accelerator_is_any_device_but_a_processor(self, done: Any, kinds: list, gpu: bool) -> None:
        done.out = "a greeting\n" + json.dumps(kinds)
        found = machine.check_accelerator()
        assert (found.good, found.found) == (gpu, ", ".join(kinds))
        assert ("jax[cuda12]" in found.advice) is not gpu

    def test_a_jax_that_fails_or_is_missing(self, done: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        done.code, done.err = 1, "trouble\nno such driver\n"
        assert machine.check_accelerator()[1:] == (False, "JAX does not start", "no such driver")
        done.code = "late"
        assert machine.check_accelerator().advice == "no answer within 60 s"
        monkeypatch.setattr(machine.importlib.util, "find_spec", lambda _: None)
        found = machine.check_accelerator()
        assert (found.good, found.found) == (False, "no JAX")
        assert found.advice.startswith("to train: ")

    def test_rendering_is_tried_as_chosen_or_twice(self, done: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("MUJOCO_GL", "glfw")
        assert machine.check_rendering()[1:3] == (True, "works with MUJOCO_GL=glfw")
        monkeypatch.delenv("MUJOCO_GL")
        assert machine.check_rendering().found == "works with MUJOCO_GL=egl"
        done.fails = lambda environment: environment["MUJOCO_GL"] == "egl"
        assert machine.check_rendering()[1:3] == (True, "works with MUJOCO_GL=osmesa")
        done.fails = lambda environment: True
        assert not machine.check_rendering().good
        tried = [options["env"]["MUJOCO_GL"] for _, options in done.calls]
        assert tried == ["glfw", "egl", "egl", "osmesa", "egl", "osmesa"]

    def test_the_cache_is_counted_whole(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(machine, "compilation_cache", lambda: tmp_path / "jax")
        assert machine.check_cache().found == f"{tmp_path / 'jax'}: empty"
        (tmp_path / "jax" / "deep").mkdir(parents=True)
        (tmp_path / "jax" / "a").write_bytes(bytes(2**20))
        (tmp_path / "jax" / "deep" / "b").write_bytes(bytes(2 * 2**20))
        assert machine.check_cache()[1:3] == (True, f"{tmp_path / 'jax'}: 2 files, 3 MiB")

    def test_only_the_simulator_for_training_may_be_missing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        there = {"mujoco": "3.1"}

        def find(name: str) -> str:
            if name not in there:
                raise machine.PackageNotFoundError(name)
            return there[name]

        monkeypatch.setattr(machine, "version", find)
        assert machine.check_simulators()[1:3] == (True, "mujoco-mjx is not installed")
        there.clear()
        assert machine.check_simulators()[1:] == (False, "mujoco is not installed", "")

    def test_missing_packages_and_extras_are_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lacking: dict[str, list] = {"": [], "train": [], "pages": [], "dev": ["x"]}
        monkeypatch.setattr(machine, "extras", lambda: [name for name in lacking if name])
        monkeypatch.setattr(machine, "missing", lambda extra="": lacking[extra])
        assert machine.check_packages()[1:3] == (True, "all that are required on a robot")
        assert machine.check_extras()[1:3] == (True, "train, pages")
        lacking[""] = [Requirement("mujoco>=9")]
        lacking["pages"] = [Requirement("aiohttp"), Requirement("rich>1")]
        found = machine.check_packages()
        assert (found.good, found.found) == (False, "missing or too old: mujoco")
        assert "mujoco>=9" in found.advice
        found = machine.check_extras()
        assert (found.good, found.found) == (False, "train; pages lacks aiohttp, rich")
        assert "pages" in found.advice
        assert "train" not in found.advice.replace(str(Path.cwd()), "")
        lacking["train"] = [Requirement("jax")]
        assert machine.check_extras().found == "train lacks jax; pages lacks aiohttp, rich"
