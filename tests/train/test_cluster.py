"""Two processes, or two devices, train one policy: each learns from its share, both compute the same."""

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import jax
import numpy as np
import pytest
from go1_smoke import FEW_IN_C

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.train import api, cluster
from footfall.train.brax.devices import caches_programs, device_mesh
from footfall.train.config import load_preset
from footfall.train.progress import newest_checkpoint
from footfall.train.runs import checkpoint

SCRIPT = Path(__file__).parents[1] / "support" / "two_devices.py"
BOTH_PROCESSES = """
import os, sys
import footfall.train.brax.trainer  # once for both
from footfall.__main__ import main
for index in "01":
    if os.fork() == 0:
        sys.argv += ["--process", index]
        printed = os.open(f"printed{index}", os.O_CREAT | os.O_WRONLY)
        os.dup2(printed, 1), os.dup2(printed, 2)
        sys.exit(main())
sys.exit(any([os.wait()[1] for _ in "01"]))
"""
# The older partitioner, as with jax 0.11 (envs/workarounds/partitioner.py): Shardy compiles more.
TWO = {"JAX_NUM_CPU_DEVICES": "2", "JAX_PLATFORMS": "cpu", "JAX_USE_SHARDY_PARTITIONER": "0"}


def test_two_processes_train_one_run_that_one_process_continues(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The task has few terms and small networks, because each process compiles it."""
    smoke = load_preset("smoke")
    ppo = replace(smoke.ppo, actor_hidden_dims=(8,), critic_hidden_dims=(8,))
    small = replace(smoke, ppo=ppo, env=FEW_IN_C, checkpoint_interval_s=0.0)
    (tmp_path / "small.yaml").write_text(dump(small))
    with socket.socket() as free:
        free.bind(("localhost", 0))
        coordinator = f"localhost:{free.getsockname()[1]}"
    options = (
        f"--preset small.yaml --steps 1024 --out run --no-evaluate --processes 2 --coordinator {coordinator}"
    )
    command = [sys.executable, "-c", BOTH_PROCESSES, "train", *options.split()]
    started = subprocess.Popen(command, cwd=tmp_path, start_new_session=True)
    try:
        status = started.wait(timeout=420)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(started.pid, signal.SIGKILL)
    first, second = ((tmp_path / f"printed{index}").read_text() for index in "01")
    assert status == 0, first + second
    assert ["exported" in printed for printed in (first, second)] == [True, False]

    folder = tmp_path / "run"
    lines = (folder / "metrics.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in lines] == [256, 512, 768, 1024]
    assert (folder / "policy.onnx").is_file()
    assert checkpoint.latest(folder / "checkpoints") == folder / "checkpoints" / "00000004.ckpt"

    config = folder / "config.yaml"
    config.write_text(config.read_text().replace("total_steps: 1024", "total_steps: 1536"))
    api.resume(folder)
    assert "resuming from 00000004.ckpt" in capsys.readouterr().out
    assert checkpoint.latest(folder / "checkpoints") == folder / "checkpoints" / "00000006.ckpt"


def test_processes_resume_from_one_checkpoint(whole_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = api.open_run(whole_run)
    monkeypatch.setattr(cluster, "processes", lambda: 2)
    oldest = min(opened.checkpoints.iterdir())  # this process sees newer ones
    monkeypatch.setattr(cluster, "broadcast", lambda _: (int(oldest.stem),))
    assert newest_checkpoint(opened) == oldest
    monkeypatch.setattr(cluster, "broadcast", lambda _: (9,))
    with pytest.raises(UserError, match=r"\b0 .*00000009\.ckpt"):
        newest_checkpoint(opened)


def test_a_failure_in_one_process_is_reported_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    gather = Mock(return_value=np.array([False, False, True]))
    monkeypatch.setattr(cluster, "processes", lambda: 3)
    monkeypatch.setattr(cluster.multihost_utils, "process_allgather", gather)
    with pytest.raises(UserError, match=r"\b2\b"), cluster.all_or_none():
        pass
    with pytest.raises(ValueError, match="mine"), cluster.all_or_none():
        raise ValueError("mine")
    assert [bool(call.args[0]) for call in gather.call_args_list] == [False, True]
    monkeypatch.setattr(cluster.multihost_utils, "broadcast_one_to_all", lambda values: values + 1)
    assert cluster.broadcast(3, 0) == (4, 1)


def test_each_device_learns_from_its_share_and_both_end_with_the_same_parameters() -> None:
    """Equal shares train as one device does; statistics of each device reach both."""
    command, pipes = [sys.executable, str(SCRIPT)], {"capture_output": True, "text": True}
    done = subprocess.run(command, env=os.environ | TWO, timeout=300, check=False, **pipes)
    assert done.returncode == 0, done.stderr[-2000:]
    results = json.loads(done.stdout.splitlines()[-1])
    assert results["moved"] > 1e-3
    assert results["other_share_on_the_second"] > 1e-4
    assert max(results["same_share_on_both"], results["statistics"]) < 1e-6
    counts = ("between_devices", "devices", "environments_of_each", "copies_of_parameters")
    assert [results[name] for name in counts] == [0.0, 2, 16, 2]


def test_only_programs_of_a_single_gpu_are_cached(monkeypatch: pytest.MonkeyPatch) -> None:
    for platform, visible, cached in (("gpu", 1, True), ("gpu", 2, False), ("cpu", 1, False)):
        monkeypatch.setattr(jax, "device_count", lambda count=visible: count)
        mesh: Any = SimpleNamespace(size=1, devices=np.array([SimpleNamespace(platform=platform)]))
        assert caches_programs(mesh) == cached


def test_environments_that_do_not_divide_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jax, "devices", lambda: ["one", "two"])
    config = replace(load_preset("smoke").ppo, num_envs=12, num_mini_batches=4)
    with pytest.raises(UserError, match=r"\b8\b"):
        device_mesh(config)
