"""Start of a training: device, imports and compilation run concurrently."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import replace
from pathlib import Path
from threading import Event

import jax
import numpy as np
import pytest

from footfall.common.in_time import any_compiling
from footfall.envs.config import RewardConfig
from footfall.envs.workarounds.program_cache import fingerprint
from footfall.robots.description import load_robot
from footfall.train import api
from footfall.train.brax import parts, prefetch
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.iteration import Iteration
from footfall.train.brax.parts import assemble
from footfall.train.brax.prefetch import made_from, prefetch_programs
from footfall.train.brax.state import TrainState
from footfall.train.config import load_preset
from footfall.train.runs.folder import open_run


def test_a_run_reads_its_programs_ahead(tmp_path: Path) -> None:
    """The settings go through the run folder's file between the two."""
    robot = load_robot("go1")
    folder = api.begin(api.TrainRequest(preset="gpu-quick", out=tmp_path / "run"))
    requested, opened = (made_from(robot, c) for c in (load_preset("gpu-quick"), open_run(folder).config))
    assert fingerprint(requested) == fingerprint(opened)


def test_environment_and_learning_settings_distinguish_programs() -> None:
    """Other settings do not distinguish programs, such as the interval of checkpoints."""
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

    def ready(lower: object, beside: object, report: Callable[[str], None], *made: object) -> Future:
        requested.append(fingerprint(made))
        report("a warning")
        there: Future = Future()
        there.set_result(programs[made[0]])
        return there

    monkeypatch.setattr(parts, "caches_programs", lambda _: True)
    monkeypatch.setattr(parts, "load_or_compile", ready)
    monkeypatch.setattr(prefetch, "prefetch", lambda *made: read.extend(map(fingerprint, made)))
    prefetch_programs(robot, run.config)
    assembled, mesh, lines = assemble(run.config, robot), device_mesh(run.config.ppo), []
    assert assembled.prepare(mesh, 7, lines.append) == (TrainState(*[7] * 7), Iteration("act", "learn"))
    assert requested == read
    assert lines == ["a warning"]
    restored = TrainState(*np.arange(7.0)[:, None])
    state, iteration = assembled.prepare(mesh, restored, print)
    assert (float(state.iteration[0]), iteration, requested[3:]) == (6.0, Iteration("act", "learn"), read[:2])


def test_ctrl_c_does_not_wait_for_the_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = open_run(api.begin(api.TrainRequest(preset="smoke", out=tmp_path / "run")))
    assembled, compiled = assemble(run.config, load_robot("go1")), Event()

    def begun(lower: object, executor: Executor, *_: object) -> Future:
        executor.submit(compiled.wait, 60)
        raise KeyboardInterrupt

    monkeypatch.setattr(parts, "caches_programs", lambda _: True)
    monkeypatch.setattr(parts, "load_or_compile", begun)
    with pytest.raises(KeyboardInterrupt):
        assembled.prepare(device_mesh(run.config.ppo), 0, print)
    assert any_compiling()
    compiled.set()


def test_every_seed_begins_with_the_same_program(tmp_path: Path) -> None:
    programs = set()
    for seed in (0, 7):
        run = open_run(api.begin(api.TrainRequest(preset="smoke", seed=seed, out=tmp_path / str(seed))))
        first_state = assemble(run.config, load_robot("go1")).first_state
        programs.add(jax.jit(first_state).lower(np.uint32(seed)).as_text())
    assert len(programs) == 1
