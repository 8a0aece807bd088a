"""Findings of doctor on this machine and on a robot's computer, with a folder in place of `/`."""

import json
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
from packaging.requirements import Requirement

from footfall import machine, robot_computer


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


def kernel_files(root: Path, files: dict[str, str]) -> Path:
    for name, content in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(f"{content}\n")
    return root


DEBIAN = "Linux version 6.12.9-amd64 (x@y) #1 SMP PREEMPT_DYNAMIC Debian"
CPU = "sys/devices/system/cpu"
FIRST, SECOND = (f"{CPU}/cpu{k}/cpufreq/scaling_governor" for k in (0, 1))


def test_advice_names_the_setting(tmp_path: Path) -> None:
    rows: list[tuple[str, dict[str, str], str]] = [
        ("processors", {FIRST: "performance"}, ""),
        ("processors", {FIRST: "performance", SECOND: "powersave"}, "cpupower frequency-set -g performance"),
        ("processors", {}, ""), ("isolated_cores", {f"{CPU}/isolated": "2-3"}, ""),
        ("isolated_cores", {f"{CPU}/isolated": ""}, "isolcpus="),
        ("kernel", {"proc/version": DEBIAN.replace("PREEMPT_DYNAMIC", "PREEMPT_RT")}, ""),
        ("kernel", {"proc/version": DEBIAN, "sys/kernel/realtime": "1"}, ""),
        ("kernel", {"proc/version": DEBIAN}, "linux-image-rt"), ("kernel", {}, "linux-image-rt"),
    ]  # fmt: skip
    for k, (check, files, advice) in enumerate(rows):
        found = getattr(robot_computer, f"check_{check}")(kernel_files(tmp_path / str(k), files))
        assert found.good is not bool(advice)
        assert advice in found.advice
        assert found.result


def test_real_time_scheduling_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    for error in (None, PermissionError):
        monkeypatch.setattr("os.sched_setscheduler", Mock(side_effect=error))
        found = robot_computer.check_realtime()
        assert (found.good, bool(found.advice)) == (error is None, error is not None)


def test_an_unsynchronised_clock_is_reported(tmp_path: Path) -> None:
    root = kernel_files(tmp_path, {"proc/17/comm": "bash", "sys/class/ptp/ptp0/clock_name": "igb"})
    alone = robot_computer.check_clock(root, lambda: False)
    assert not alone.good
    assert "chrony" in alone.advice
    assert "ptp4l" in alone.advice
    kernel_files(root, {"proc/18/comm": "chronyd"})
    assert "apt" not in robot_computer.check_clock(root, lambda: False).advice
    assert robot_computer.check_clock(root, lambda: True).good


def link(name: str, state: str = "up", queue: int = 64, kind: int = 280) -> dict[str, str]:
    folder = f"sys/class/net/{name}"
    return {f"{folder}/operstate": state, f"{folder}/tx_queue_len": str(queue), f"{folder}/type": str(kind)}


def controller(bitrate: int = 1_000_000, state: str = "ERROR-ACTIVE") -> dict[str, Any]:
    return {"bittiming": {"bitrate": bitrate}, "state": state}


UP = "ip link set can1 up type can bitrate 1000000 restart-ms 100"


def test_can_interfaces_that_are_not_ready_are_reported_with_the_remedy(tmp_path: Path) -> None:
    rows: list[tuple[dict[str, str], dict[str, Any], list[str]]] = [
        ({}, {}, []), (link("eth0", queue=10, kind=1), {}, []), (link("can1"), controller(), []),
        (link("can1", "down", 10), {}, [UP, "ip link set can1 txqueuelen 64"]),
        (link("can1"), controller(500_000), ["ip link set can1 down", UP]),
        (link("can1"), controller(state="BUS-OFF"), ["ip link set can1 type can restart"]),
        (link("can1"), controller(state="ERROR-PASSIVE"), ["120 ohm"]),
    ]  # fmt: skip
    for k, (second, details, commands) in enumerate(rows):
        root = kernel_files(tmp_path / str(k), {**link("can0"), **second})
        found = {"can1": details} if details else {}
        finding = robot_computer.check_can(root, details=lambda found=found: found)
        assert finding.good is not bool(commands)
        assert [command for command in commands if command not in finding.advice] == []
    for sockets in (True, False):
        finding = robot_computer.check_can(tmp_path, lambda sockets=sockets: sockets)
        assert not finding.good
        assert ("modprobe can_raw" in finding.advice) is not sockets
