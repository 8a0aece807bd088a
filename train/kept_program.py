"""Compiled programs that are kept from one training to the next, so that they need not be traced again.

JAX's own cache keeps what XLA makes of a program and finds it by the program, which has to be traced first;
that takes longer than all the rest of a start. Here a program is found by what it is made from.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import jax
import mujoco
import numpy as np
from jax.experimental.serialize_executable import deserialize_and_load, serialize

from robots.description import Robot
from robots.files import write_atomically
from robots.model import training_model
from robots.versions import versions

SOURCES = Path(__file__).parents[1]
TRACED = ("domain_rand", "envs", "policies", "robots", "train")  # packages that a program may be made from
LIBRARIES = ("jax", "jaxlib", "mujoco", "mujoco-mjx", "brax", "flax", "optax", "numpy")
SETTINGS = ("JAX_", "XLA_", "CUDA_", "NVIDIA_")  # beginnings of environment variables that JAX heeds


def kept(make: Callable[[], jax.stages.Compiled], *made_from: Any) -> jax.stages.Compiled:
    """The program that `make` compiles, or the one that it compiled from the same things before.

    It is kept in a folder of JAX's compilation cache, if there is one. What is not a whole program there is
    compiled anew; what cannot be written down is not kept.

    Args:
        make: compiles the program.
        made_from: all that it depends on besides source, libraries, device and environment variables;
            their `repr` tells them apart, or their bytes.
    """
    cache = jax.config.values["jax_compilation_cache_dir"]
    if cache is None:
        return make()
    folder = Path(cache) / "programs"
    path = folder / fingerprint([*_surroundings(), *made_from])
    with suppress(Exception):  # whatever is wrong with the file
        return _read(path)
    compiled = make()
    with suppress(Exception):  # a full disk, a program that calls Python
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(path, _as_bytes(compiled))
    return compiled


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


def _as_bytes(compiled: jax.stages.Compiled) -> bytes:
    program, *structures = serialize(compiled)
    # JAX does not write down structures with types of others; these are whole values of the same structure.
    values = [jax.tree.unflatten(structure, range(structure.num_leaves)) for structure in structures]
    return pickle.dumps((program, *values))


def _read(path: Path) -> jax.stages.Compiled:
    program, *values = pickle.loads(path.read_bytes())
    return deserialize_and_load(program, *map(jax.tree.structure, values))
