"""Shared fixtures, and an environment that keeps the tests fast and alike on every machine."""

import os
from importlib.metadata import distributions
from pathlib import Path

# Set before anything imports JAX, for all processes that the tests start: they run on the CPU, keep compiled
# programs between runs, and have XLA compile quickly rather than well: they compile much and run little.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault(
    "XLA_FLAGS",
    "--xla_backend_optimization_level=0 --xla_llvm_disable_expensive_passes=true"
    + " --xla_cpu_parallel_codegen_split_count=1"
    # XLA ends the process at a flag that it does not know, as 0.11.2 does at this one.
    + " --xla_cpu_use_fusion_emitters=false"
    * any(found.version.startswith("0.10.") for found in distributions(name="jaxlib")),
)
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")  # no source locations in programs
os.environ["XDG_STATE_HOME"] = str(Path(__file__).parents[1] / ".cache" / "state")  # not the user's
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(__file__).parents[1] / ".cache" / "jax"))

import gc
import multiprocessing
import shutil
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Executor, Future
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from file_order import LONGEST, TOGETHER
from hypothesis import settings
from recorder import Recorder
from shell import Shell
from tiny_policy import contract_of

from footfall.common import locks
from footfall.common.config import dump
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.policies.contract import Contract, Gait, Term
from footfall.policies.gaits import find_gait
from footfall.robots.commands import CommandRange
from footfall.robots.description import ROBOTS, Robot, load_robot

# If a shell starts the tests in the background, the tests and their processes ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)

settings.register_profile("footfall", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("footfall")

HERE = Path(__file__).parent
PROGRAMS_OF_A_CONTEXT = 200  # more would need much memory, because a context keeps their constants

locks.NAMESPACE = f"footfall-tests-{os.getpid()}"  # tests of another run hold buses of the same names


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file's tests stay in one worker, since they share slow preparations; so do those of some files."""
    from xdist.scheduler import LoadFileScheduling

    class Scheduling(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return TOGETHER.get(file.removeprefix("tests/"), file)

    return Scheduling(config, log)


def share_contexts() -> None:
    """Programs that are compiled one after the other have one MLIR context, if JAX has been imported.

    JAX makes one for every program, a third of a small program's compilation time; JAX 0.11 shares contexts
    by itself. While another thread runs, every program has a context of its own.
    """
    try:
        mlir: Any = sys.modules["jax._src.interpreters.mlir"]
        make = mlir.make_ir_context
    except (KeyError, AttributeError):
        return
    threads = set(threading.enumerate())
    made: list[Any] = []

    def context() -> Any:
        if not threads.issuperset(threading.enumerate()):
            return make()
        if len(made) % PROGRAMS_OF_A_CONTEXT == 0:
            made[:] = [make()]
        made.append(made[-1])
        return made[-1]

    mlir.make_ir_context = context


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Imports of the collection stay, so the garbage collector need not look at them."""
    gc.disable()
    try:
        return (yield)
    finally:
        share_contexts()
        gc.collect()
        gc.freeze()
        gc.set_threshold(20_000)
        gc.enable()


unfrozen: list[bool] = []  # not empty if a test has called gc.unfreeze


def unfreeze(original: Callable[[], None] = gc.unfreeze) -> None:
    original()
    unfrozen.append(True)


gc.unfreeze = unfreeze


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown() -> None:
    """Freeze again after a run in real time, which has unfrozen all objects at its end."""
    if unfrozen:
        unfrozen.clear()
        gc.freeze()


def pytest_configure(config: pytest.Config) -> None:
    """Each worker begins collection with another room, and reads the files that others have compiled."""
    worker = getattr(config, "workerinput", None)
    if worker is not None and [Path(name).resolve() for name in config.args] == [HERE]:
        rooms = sorted({str(HERE / path.relative_to(HERE).parts[0]) for path in HERE.rglob("test_*.py")})
        first = int(worker["workerid"].removeprefix("gw")) * len(rooms) // worker["workercount"]
        config.args = rooms[first:] + rooms[:first]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take longest. The order is the same wherever collection began."""
    rank = {name: index for index, name in enumerate(LONGEST)}

    def order(item: pytest.Item) -> tuple[int, str]:
        name = item.path.relative_to(HERE).as_posix()
        return rank.get(name, len(LONGEST)), name

    items.sort(key=order)


@pytest.fixture(scope="session", autouse=True)
def forked_evaluations() -> Iterator[None]:
    """Evaluations fork their processes from one that has already imported what they need."""
    from footfall.evaluate import pool, suite, weakest

    multiprocessing.set_forkserver_preload([suite.run_task.__module__, weakest.__name__])
    forking = SimpleNamespace(get_context=lambda _: multiprocessing.get_context("forkserver"))

    def run_all(*arguments: Any, **options: Any) -> list[pool.TaskResult[Any]]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(pool, "multiprocessing", forking)
            return pool.run_all(*arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        for module in (suite, weakest):
            patch.setattr(module, "run_all", run_all)
        yield


@pytest.fixture(scope="session")
def kept_programs() -> Iterator[None]:
    """Trainings in this process with equal programs share one, because tracing takes long.

    Programs are kept in memory, because XLA cannot serialise a program again that it has read from its cache:
    the program's functions are not found.
    """
    from footfall.envs.workarounds.program_cache import fingerprint
    from footfall.train.brax import parts

    kept: dict[str, Future[Any]] = {}

    def load_or_compile(lower: Callable[[], Any], executor: Executor, _: Any, *key: Any) -> Future[Any]:
        name = fingerprint(key)
        if name not in kept:
            kept[name] = executor.submit(lower().compile)
        return kept[name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(parts, "caches_programs", lambda mesh: mesh.size == 1)
        patch.setattr(parts, "load_or_compile", load_or_compile)
        yield


@pytest.fixture(scope="session")
def six_iterations(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A preset's file: a checkpoint after each iteration, and a program that all who use it share."""
    from footfall.train.config import load_preset

    smoke = load_preset("smoke")
    ppo = replace(smoke.ppo, total_steps=6 * smoke.ppo.steps_per_iteration)
    env = replace(smoke.env, physics="c")  # compiled faster
    config = replace(smoke, ppo=ppo, env=env, checkpoint_interval_s=0.0)
    path = tmp_path_factory.mktemp("presets") / "six.yaml"
    path.write_text(dump(config))
    return str(path)


@pytest.fixture(scope="session")
def whole_run(six_iterations: str, kept_programs: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A training that nothing interrupted, of six iterations and seed 5. Tests may read but not change it."""
    from footfall.train.api import TrainRequest, train

    return train(TrainRequest(preset=six_iterations, seed=5, out=tmp_path_factory.mktemp("runs") / "whole"))


@pytest.fixture(scope="session")
def go1() -> Robot:
    return load_robot("go1")


@pytest.fixture(scope="session")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    """Made-up robots of each kind. Tests may read but not change them."""
    from made_up import bodies

    return bodies(tmp_path_factory.mktemp("bodies"))


@pytest.fixture
def quick_standing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots of simulated episodes stand up in 0.3 s instead of 1 s."""

    def quick(robot: Robot) -> DeployConfig:
        return replace(deploy_config(robot), stand_s=0.3)

    for module in ("plant.episode", "evaluate.episodes"):
        monkeypatch.setattr(f"footfall.{module}.deploy_config", quick)


@pytest.fixture
def own_folder(tmp_path: Path) -> Path:
    """A user's copy of the go1 folder, free to be changed."""
    folder = tmp_path / "mine"
    shutil.copytree(ROBOTS / "go1", folder)
    return folder


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    """The command line, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> Recorder:
    """Stands in for the functions that a verb calls."""
    return Recorder(monkeypatch)


@pytest.fixture(scope="session")
def contract(go1: Robot) -> Contract:
    """A contract that fits go1 and uses every observation term, some with history."""
    phase = np.zeros(12)
    for foot_phase, joints in zip(find_gait("trot", go1).phase, go1.foot_joints, strict=True):
        phase[joints] = foot_phase
    observation = (
        Term("gyro", 0.25, 2),
        Term("gravity"),
        Term("command"),
        Term("joint_position", 1.0, 3),
        Term("joint_velocity", 0.05, 3),
        Term("last_action", 1.0, 2),
        Term("clock"),
    )
    commands = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0))
    gait = Gait(2.2, tuple(phase.tolist()), (0.0, 0.3, -0.6) * 4)
    return contract_of(go1, *observation, commands=commands, gait=gait)
