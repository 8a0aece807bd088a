"""Start of a training: device, imports and compilation run concurrently."""

import threading
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from footfall.envs.config import RewardConfig
from footfall.envs.workarounds.program_cache import fingerprint
from footfall.robots.description import load_robot
from footfall.train import api
from footfall.train.brax import parts, prefetch
from footfall.train.brax.devices import GPU_OPTIONS, caches_programs, compiler_options, device_mesh
from footfall.train.brax.iteration import Iteration
from footfall.train.brax.parts import assemble
from footfall.train.brax.prefetch import made_from, prefetch_programs
from footfall.train.brax.state import TrainState
from footfall.train.config import load_preset
from footfall.train.entry import start_device
from footfall.train.runs.folder import open_run


def test_the_device_starts_on_own_programs_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Even its first operation is a compiled program."""
    names = ("jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs")
    before = {name: jax.config.values[name] for name in names}
    began, found = threading.Event(), []

    def first_operation(_: int) -> None:
        found.append(jax.config.values["jax_compilation_cache_dir"])
        began.set()

    monkeypatch.setattr("jax.numpy.zeros", first_operation)
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path))
    try:
        for mode in (0o700, 0o777):
            tmp_path.chmod(mode)
            began.clear()
            start_device()
            assert began.wait(60)
    finally:
        for name, value in before.items():
            jax.config.update(name, value)
        reset_cache()
    assert found == [str(tmp_path), None]


def test_a_device_may_not_start(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    tried = threading.Event()

    def no_device(_: int) -> None:
        tried.set()
        raise RuntimeError("Unable to initialize backend")

    monkeypatch.setattr("jax.numpy.zeros", no_device)
    start_device()
    for thread in threading.enumerate():
        if thread.name == "start device":
            thread.join()
    assert tried.is_set()
    assert capsys.readouterr() == ("", "")


def test_a_training_on_processors_leaves_nvidias_driver_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    initialised = []
    driver = SimpleNamespace(cuInit=lambda flags: initialised.append(jax_platforms))
    monkeypatch.setattr("ctypes.CDLL", lambda _: driver)
    for jax_platforms in ("cpu", "cuda"):
        monkeypatch.setenv("JAX_PLATFORMS", jax_platforms)
        start_device()
        for thread in threading.enumerate():
            if thread.name in ("wake driver", "start device"):
                thread.join()
    assert initialised == ["cuda"]


def test_xla_accepts_the_gpu_options() -> None:
    lowered = jax.jit(lambda x: x + 1).lower(1.0)
    lowered.compile(compiler_options=dict(GPU_OPTIONS))
    with pytest.raises(Exception, match="xla_gpu_no_such"):
        lowered.compile(compiler_options={"xla_gpu_no_such": True})


def test_only_gpus_get_options_and_the_program_of_one_gpu_is_kept() -> None:
    for platform, count, options, kept in (
        ("gpu", 1, GPU_OPTIONS, True),
        ("gpu", 2, GPU_OPTIONS, False),
        ("cpu", 1, None, False),
    ):
        mesh = SimpleNamespace(devices=np.array([SimpleNamespace(platform=platform)] * count), size=count)
        assert compiler_options(mesh) is options
        assert caches_programs(mesh) is kept


def test_a_run_reads_its_programs_ahead(tmp_path: Path) -> None:
    """The settings go through the run folder's file between the two."""
    robot = load_robot("go1")
    folder = api.begin(api.TrainRequest(preset="gpu-quick", out=tmp_path / "run"))
    requested, opened = (made_from(robot, c) for c in (load_preset("gpu-quick"), open_run(folder).config))
    assert fingerprint(requested) == fingerprint(opened)


def test_environment_and_learning_settings_distinguish_programs() -> None:
    """Only these: the interval of checkpoints is not part of a program."""
    go1, plain = load_robot("go1"), load_preset("smoke")
    env = plain.env
    others = {
        "plain": plain,
        "rewards": replace(plain, env=replace(env, rewards=(*env.rewards, RewardConfig("torque", -1.0)))),
        "commands": replace(plain, env=replace(env, commands=replace(env.commands, standing_command=0.2))),
        "physics": replace(plain, env=replace(env, substeps=env.substeps + 1)),
        "learning": replace(plain, ppo=replace(plain.ppo, learning_rate=2 * plain.ppo.learning_rate)),
    }
    made = [fingerprint(made_from(go1, config)) for config in others.values()]
    made.append(fingerprint(made_from(load_robot("hexapod"), plain)))
    assert len(set(made)) == len(made), dict(zip([*others, "robot"], made, strict=True))
    saved = replace(plain, checkpoint_interval_s=plain.checkpoint_interval_s + 1.0)
    assert fingerprint(made_from(go1, saved)) == made[0]


def test_a_kept_program_is_not_traced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All programs are requested as they were read ahead; a resumed run has its state."""
    run = open_run(api.begin(api.TrainRequest(preset="smoke", seed=7, out=tmp_path / "run")))
    robot, requested, read = load_robot("go1"), [], []
    programs = {"first state": lambda seed: TrainState(*[int(seed)] * 7), "act": "act", "learn": "learn"}

    def ready(lower: object, beside: object, say: Callable[[str], None], *made: object) -> Future:
        requested.append(fingerprint(made))
        say("a warning")
        there: Future = Future()
        there.set_result(programs[made[0]])
        return there

    monkeypatch.setattr(parts, "caches_programs", lambda _: True)
    monkeypatch.setattr(parts, "load_or_compile", ready)
    monkeypatch.setattr(prefetch, "prefetch", lambda *made: read.extend(map(fingerprint, made)))
    prefetch_programs(robot, run.config)
    assembled, mesh, said = assemble(run.config, robot), device_mesh(run.config.ppo), []
    assert assembled.prepare(mesh, 7, said.append) == (TrainState(*[7] * 7), Iteration("act", "learn"))
    assert requested == read
    assert said == ["a warning"]
    restored = TrainState(*np.arange(7.0)[:, None])
    state, iteration = assembled.prepare(mesh, restored, print)
    assert (float(state.iteration[0]), iteration, requested[3:]) == (6.0, Iteration("act", "learn"), read[:2])


def test_every_seed_begins_with_the_same_program(tmp_path: Path) -> None:
    programs = set()
    for seed in (0, 7):
        run = open_run(api.begin(api.TrainRequest(preset="smoke", seed=seed, out=tmp_path / str(seed))))
        first_state = assemble(run.config, load_robot("go1")).first_state
        programs.add(jax.jit(first_state).lower(np.uint32(seed)).as_text())
    assert len(programs) == 1
