"""Start of a training: device, imports and compilation run concurrently."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from threading import Event

import jax
import numpy as np
import pytest

from footfall.common.blocking_threads import any_compiling
from footfall.envs.config import RewardConfig
from footfall.envs.workarounds.program_cache import fingerprint
from footfall.robots.description import Robot, load_robot
from footfall.train import api
from footfall.train.brax import parts, prefetch
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.iteration import Iteration
from footfall.train.brax.parts import assemble
from footfall.train.brax.prefetch import prefetch_programs, program_key
from footfall.train.brax.state import TrainState
from footfall.train.config import load_preset
from footfall.train.runs.folder import Run, open_run


def begun(folder: Path, preset: str = "smoke", seed: int = 7) -> Run:
    return open_run(api.begin(api.TrainRequest(preset=preset, seed=seed, out=folder / f"{preset}-{seed}")))


def test_environment_and_learning_settings_distinguish_programs(go1: Robot, tmp_path: Path) -> None:
    """Other settings, such as the checkpoint interval, do not. Nor does a run's file."""
    plain = load_preset("smoke")
    env, ppo = plain.env, plain.ppo
    changes = (
        {}, {"rewards": (*env.rewards, RewardConfig("torque", -1.0))}, {"substeps": env.substeps + 1},
        {"commands": replace(env.commands, standing_command=0.2)},
    )  # fmt: skip
    others = [replace(plain, env=replace(env, **each)) for each in changes]
    others.append(replace(plain, ppo=replace(ppo, learning_rate=2 * ppo.learning_rate)))
    made = [fingerprint(program_key(go1, config)) for config in others]
    made.append(fingerprint(program_key(load_robot("hexapod"), plain)))
    assert len(set(made)) == len(made), made
    saved = replace(plain, checkpoint_interval_s=plain.checkpoint_interval_s + 1.0)
    assert fingerprint(program_key(go1, saved)) == made[0]
    configs = (load_preset("gpu-quick"), begun(tmp_path, "gpu-quick").config)
    assert len({fingerprint(program_key(go1, config)) for config in configs}) == 1


def test_a_cached_program_is_not_traced(tmp_path: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A training uses exactly the programs that were prefetched. A resumed one needs no first state."""
    run, requested, prefetched = begun(tmp_path), [], []
    programs = {"first state": lambda seed: TrainState(*[int(seed)] * 7), "act": "act", "learn": "learn"}

    def load(lower: object, executor: object, report: Callable[[str], None], *key: object) -> Future:
        requested.append(fingerprint(key))
        report("a warning")
        loaded: Future = Future()
        loaded.set_result(programs[key[0]])
        return loaded

    monkeypatch.setattr(parts, "caches_programs", lambda _: True)
    monkeypatch.setattr(parts, "load_or_compile", load)
    monkeypatch.setattr(prefetch, "prefetch", lambda *programs: prefetched.extend(map(fingerprint, programs)))
    prefetch_programs(go1, run.config)
    assembled, mesh, lines = assemble(run.config, go1), device_mesh(run.config.ppo), []
    assert assembled.prepare(mesh, 7, lines.append) == (TrainState(*[7] * 7), Iteration("act", "learn"))
    assert requested == prefetched
    assert lines == ["a warning"]
    restored = TrainState(*np.arange(7.0)[:, None])
    state, iteration = assembled.prepare(mesh, restored, print)
    assert (float(state.iteration[0]), iteration, requested[3:]) == (
        6.0,
        Iteration("act", "learn"),
        prefetched[:2],
    )


def test_ctrl_c_does_not_wait_for_compilers(
    tmp_path: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, compiled = begun(tmp_path), Event()
    assembled = assemble(run.config, go1)

    def interrupted(lower: object, executor: Executor, *_: object) -> Future:
        executor.submit(compiled.wait, 60)
        raise KeyboardInterrupt

    monkeypatch.setattr(parts, "caches_programs", lambda _: True)
    monkeypatch.setattr(parts, "load_or_compile", interrupted)
    with pytest.raises(KeyboardInterrupt):
        assembled.prepare(device_mesh(run.config.ppo), 0, print)
    assert any_compiling()
    compiled.set()


def test_every_seed_begins_with_the_same_program(tmp_path: Path, go1: Robot) -> None:
    programs = set()
    for seed in (0, 7):
        first_state = assemble(begun(tmp_path, seed=seed).config, go1).first_state
        programs.add(jax.jit(first_state).lower(np.uint32(seed)).as_text())
    assert len(programs) == 1
