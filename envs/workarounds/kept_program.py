"""Compiled programs that are kept from one training to the next, so that they need not be traced again.

JAX's own cache keeps what XLA makes of a program and finds it by the program, which has to be traced first;
that takes longer than all the rest of a start. Here a program is found by what it is made from.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any

import jax
import mujoco
import numpy as np
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from footfall.common.files import write_atomically
from footfall.common.versions import versions
from footfall.robots.description import Robot
from footfall.robots.model import training_model

SOURCES = Path(__file__).parents[2]
TRACED = (
    "common",
    "domain_rand",
    "envs",
    "policies",
    "robots",
    "train",
)  # packages that a program may be made from
LIBRARIES = ("jax", "jaxlib", "mujoco", "mujoco-mjx", "brax", "flax", "optax", "numpy")
SETTINGS = ("JAX_", "XLA_", "CUDA_", "NVIDIA_")  # beginnings of environment variables that JAX heeds

_ahead: dict[str, Future] = {}  # programs that are being read, by what they are made from


def read_ahead(*made_from: Any) -> None:
    """Begin to read the program that is made from these, beside what comes next; `kept` then waits for it."""
    name = fingerprint(made_from)
    if name not in _ahead:
        beside = ThreadPoolExecutor(1)
        _ahead[name] = beside.submit(_look_up, made_from)
        beside.shutdown(wait=False)


def kept(make: Callable[[], jax.stages.Compiled], *made_from: Any) -> jax.stages.Compiled:
    """The program that `make` compiles, or the one that it compiled from the same things before.

    It is kept in a folder of JAX's compilation cache, if there is one. What is not a whole program there is
    compiled anew; what cannot be written down is not kept.

    Args:
        make: compiles the program.
        made_from: all that it depends on besides source, libraries, device and environment variables;
            their `repr` tells them apart, or their bytes.
    """
    ahead = _ahead.pop(fingerprint(made_from), None)
    path, program = ahead.result() if ahead else _look_up(made_from)
    if program is None:
        program = make()
        if path is not None:
            # Beside the training, which need not wait for it; the process does, at its end.
            Thread(target=_write, args=(path, program), name="keep program").start()
    return program


def fingerprint(parts: Iterable[Any]) -> str:
    """A name for all of these together."""
    digest = hashlib.sha256()
    for part in parts:
        content = part if isinstance(part, bytes) else repr(part).encode()
        digest.update(len(content).to_bytes(8, "big") + content)
    return digest.hexdigest()[:32]


def model_bytes(robot: Robot, timestep_s: float) -> bytes:
    """The compiled model that a robot is trained on, with whatever its file includes."""
    model = training_model(robot, timestep_s)
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, buffer=content)
    return content.tobytes()


def _surroundings() -> list[Any]:
    device = jax.local_devices()[0]
    sources = sorted(path for package in TRACED for path in (SOURCES / package).rglob("*.py"))
    return [
        *((path.relative_to(SOURCES), path.read_bytes()) for path in sources),
        versions(LIBRARIES),
        (device.platform, device.device_kind, device.client.platform_version),
        sorted((name, value) for name, value in os.environ.items() if name.startswith(SETTINGS)),
    ]


def _look_up(made_from: tuple[Any, ...]) -> tuple[Path | None, jax.stages.Compiled | None]:
    """Where the program is kept, if it can be, and the program, if it is there."""
    cache = jax.config.values["jax_compilation_cache_dir"]
    if cache is None:
        return None, None
    path = Path(cache) / "programs" / fingerprint([*_surroundings(), *made_from])
    try:
        program, *values = pickle.loads(path.read_bytes())
        return path, deserialize_and_load(program, *map(jax.tree.structure, values))
    except Exception:  # whatever is wrong with the file, a new one mends it
        return path, None


def _write(path: Path, compiled: jax.stages.Compiled) -> None:
    with suppress(Exception):  # a full disk, a program that calls Python
        program, *structures = serialize(compiled)
        # JAX does not write down structures with types of others; these are values of the same structure.
        values = [jax.tree.unflatten(structure, range(structure.num_leaves)) for structure in structures]
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, pickle.dumps((program, *values)))
