"""The output of doctor for its findings."""

import json
import subprocess
from types import SimpleNamespace
from typing import Any

import pytest
from packaging.requirements import Requirement

from footfall import machine


def test_mujoco_and_mjx_must_be_of_one_release(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"mujoco": "3.17.0", "mujoco-mjx": "3.17.0"}
    monkeypatch.setattr(machine, "version", versions.__getitem__)
    assert machine.check_simulators()[:2] == ("simulators", True)
    versions["mujoco-mjx"] = "3.16.0"
    found = machine.check_simulators()
    assert not found.good
    assert found.result == "mujoco 3.17.0, mujoco-mjx 3.16.0"


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
    def test_doctor_checks_everything_and_never_fails(self, done: Any) -> None:
        done.code, done.err = 1, "nothing works here"
        result = " ".join(finding.name for finding in machine.findings())
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
        assert (found.good, found.result) == (gpu, ", ".join(kinds))
        assert ("jax[cuda12]" in found.advice) is not gpu

    def test_a_jax_that_fails_or_is_missing(self, done: Any, monkeypatch: pytest.MonkeyPatch) -> None:
        done.code, done.err = 1, "trouble\nno such driver\n"
        assert machine.check_accelerator()[1:] == (False, "JAX does not start", "no such driver")
        done.code = "late"
        assert machine.check_accelerator().advice == "no answer within 60 s"
        monkeypatch.setattr(machine.importlib.util, "find_spec", lambda _: None)
        found = machine.check_accelerator()
        assert (found.good, found.result) == (False, "no JAX")
        assert found.advice.startswith("to train: ")

    def test_missing_packages_and_extras_are_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lacking: dict[str, list] = {"": [], "train": [], "pages": [], "dev": ["x"]}
        monkeypatch.setattr(machine, "extras", lambda: [name for name in lacking if name])
        monkeypatch.setattr(machine, "missing", lambda extra="": lacking[extra])
        assert machine.check_packages().good
        assert machine.check_extras()[1:3] == (True, "train, pages")
        lacking[""] = [Requirement("mujoco>=9")]
        lacking["pages"] = [Requirement("aiohttp"), Requirement("rich>1")]
        found = machine.check_packages()
        assert not found.good
        assert "mujoco>=9" in found.advice
        assert machine.check_extras().result == "train; pages lacks aiohttp, rich"
