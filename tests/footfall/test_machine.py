"""Findings of doctor on this machine."""

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
    assert machine.check_simulators()[1:3] == (False, "mujoco 3.17.0, mujoco-mjx 3.16.0")


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The answer of another Python: its exit status and output; `late` if it does not answer in time."""
    answer = SimpleNamespace(returncode=0, stdout="", stderr="", late=False)

    def run(command: list[str], *, timeout: float, env: dict[str, str], **_: Any) -> Any:
        if answer.late:
            raise subprocess.TimeoutExpired(command, timeout)
        return answer

    monkeypatch.setattr(machine.subprocess, "run", run)
    return answer


def test_doctor_checks_everything_and_never_fails(done: Any) -> None:
    done.returncode, done.stderr = 1, "nothing works here"
    checks = {
        "processors", "packages", "simulators", "accelerator", "offscreen rendering", "compilation cache",
        "CAN interfaces", "real-time scheduling", "memory locking",
    }  # fmt: skip
    assert checks <= {finding.name for finding in machine.findings()}


def test_an_accelerator_is_any_device_but_a_processor(done: Any) -> None:
    for kinds, gpu in ((["cpu"], False), (["NVIDIA H100", "NVIDIA H100"], True), (["cpu", "TPU v4"], True)):
        done.stdout = "a greeting\n" + json.dumps(kinds)
        found = machine.check_accelerator()
        assert (found.good, found.result) == (gpu, ", ".join(kinds))
        assert ("jax[cuda12]" in found.advice) is not gpu


def test_a_jax_that_fails_or_is_missing(done: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    done.returncode, done.stderr = 1, "trouble\nno such driver\n"
    assert machine.check_accelerator()[1:] == (False, "JAX does not start", "no such driver")
    done.late = True
    assert machine.check_accelerator().advice == "no answer within 60 s"
    monkeypatch.setattr(machine.importlib.util, "find_spec", lambda _: None)
    found = machine.check_accelerator()
    assert (found.good, found.result) == (False, "no JAX")
    assert found.advice.startswith("to train: ")


def test_missing_packages_and_extras_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
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
