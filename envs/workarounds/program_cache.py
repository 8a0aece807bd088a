"""Compiled programs that are kept from one training to the next, so that they need not be traced again.

JAX's own cache finds what XLA made of a program by the program, which has to be traced first; on a GPU that
takes longer than all the rest of a start. Here a program is found by what it is made from.

Reason: tracing takes most of a warm start. What is written is JAX's own `serialize_executable`, a pickle
around machine code: a file here is code, and only read if nobody but this user can have written it.
Upstream: https://github.com/jax-ml/jax/issues/476 brought the serialisation, not a cache that skips tracing.
It can go when JAX has one: tests/envs/test_workarounds.py says so.
"""

import hashlib
import os
import pickle
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import jax
import mujoco
import numpy as np
from jax.experimental.serialize_executable import deserialize_and_load, serialize

import footfall
from footfall.common.private_files import NotPrivateError, read_private, write_private
from footfall.common.sources import TRAINING, read_sources
from footfall.common.versions import versions
from footfall.envs.physics.generated import kernels
from footfall.robots.description import Robot
from footfall.robots.model import training_model
from footfall.robots.self_contact import Contacts

SOURCES = Path(__file__).parents[2]
LIBRARIES = ("mujoco", "mujoco-mjx", "brax", "flax", "optax", "numpy")
DEVICE_LIBRARIES = ("jax*", "nvidia_*")  # JAX, its plug-ins, CUDA's parts
ENVIRONMENT = ("JAX_", "XLA_", "CUDA_", "NVIDIA_")  # beginnings of variables that JAX heeds
OF_THE_CACHE = ("jax_compilation_cache", "jax_persistent_cache")  # settings that change no program
NVIDIA_DRIVER = Path("/proc/driver/nvidia/version")
LARGEST_BYTES = 2 * 2**30  # of all programs together; beyond it those go that were not used for longest
CLOCK_SLACK_NS = 2 * 10**9  # file systems may round a time down, by up to two seconds


class _Found(NamedTuple):
    """What the cache has of a program."""

    path: Path | None  # where it is or may be kept; None: nowhere
    program: jax.stages.Compiled | None = None
    refusal: str = ""  # why what is there is not used


_fetched: dict[str, Future[_Found]] = {}  # programs that are being read, by what they are made from


def prefetch(*made_from: Any) -> None:
    """Begin to read the program that is made from these, beside what comes next."""
    name = fingerprint(made_from)
    if name not in _fetched:
        beside = ThreadPoolExecutor(1)
        _fetched[name] = beside.submit(_look_up, made_from)
        beside.shutdown(wait=False)


def load_or_compile(
    lower: Callable[[], jax.stages.Lowered], beside: Executor, say: Callable[[str], None], *made_from: Any
) -> Future[jax.stages.Compiled]:
    """The program that was compiled from the same things before, or else is now.

    It is kept in a folder of JAX's compilation cache, if there is one. What is not a whole program there is
    compiled anew; what cannot be written down is not kept; nor is anything once a source file has changed
    since this process imported it, since the file no longer says what was traced.

    Args:
        lower: traces it, here and now: what `fewer_kernels` replaces, it replaces for every thread.
        beside: compiles it.
        say: told in one line if a file is there that others may have written.
        made_from: all that the program depends on besides source, libraries, device and JAX's settings;
            their `repr` tells them apart, or their bytes.
    """
    fetched = _fetched.pop(fingerprint(made_from), None)
    found = fetched.result() if fetched else _look_up(made_from)
    if found.refusal:
        say(f"{found.refusal}: its compiled programs are not used, compiling afresh")
    if found.program is None:
        return beside.submit(_compile, lower(), found.path)
    there: Future[jax.stages.Compiled] = Future()
    there.set_result(found.program)
    return there


def _compile(lowered: jax.stages.Lowered, path: Path | None) -> jax.stages.Compiled:
    program = lowered.compile()
    if path is not None and _source() is not None:
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


def model_bytes(robot: Robot, timestep_s: float, contacts: Contacts = "feet") -> bytes:
    """The compiled model that a robot is trained on, with whatever its file includes."""
    model = training_model(robot, timestep_s, contacts)
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, buffer=content)
    return content.tobytes()


def _source() -> list[tuple[Path, bytes]] | None:
    """Our source files, as this process imported them; None if one of them has changed since."""
    source = read_sources(SOURCES, TRAINING)
    latest = footfall.IMPORTED_AT_NS - CLOCK_SLACK_NS
    # Asked after they were read. Unlike a file's other time, that of its last change cannot be set.
    return source if all((SOURCES / path).stat().st_ctime_ns < latest for path, _ in source) else None


def _surroundings() -> list[Any]:
    """Libraries, device and settings that make a program what it is."""
    device = jax.local_devices()[0]
    return [
        versions(LIBRARIES),
        _device_libraries(),
        (device.platform, device.device_kind, device.client.platform_version),
        NVIDIA_DRIVER.read_text() if NVIDIA_DRIVER.is_file() else "",
        sorted((name, value) for name, value in os.environ.items() if name.startswith(ENVIRONMENT)),
        sorted((n, repr(v)) for n, v in jax.config.values.items() if not n.startswith(OF_THE_CACHE)),
    ]


def _device_libraries() -> list[str]:
    """Names and versions as their folders have them: to read all installed packages takes much longer."""
    folders = {Path(entry) for entry in sys.path}
    patterns = [f"{name}.dist-info" for name in DEVICE_LIBRARIES]
    return sorted(path.name for folder in folders for each in patterns for path in folder.glob(each))


def _look_up(made_from: tuple[Any, ...]) -> _Found:
    cache, source = jax.config.values["jax_compilation_cache_dir"], _source()
    if cache is None or source is None:
        return _Found(None)
    path = Path(cache) / "programs" / fingerprint([*source, *_surroundings(), *made_from])
    try:
        program, called, *values = pickle.loads(read_private(path))
        kernels.adopt(called)
        found = _Found(path, deserialize_and_load(program, *map(jax.tree.structure, values)))
        os.utime(path)  # used: the last to be evicted
        return found
    except NotPrivateError as error:
        return _Found(path, refusal=str(error))
    except Exception:  # whatever is wrong with the file, a new one mends it
        return _Found(path)


def _write(path: Path, compiled: jax.stages.Compiled) -> None:
    with suppress(Exception):  # a full disk, a folder of others, a program that calls Python
        program, *structures = serialize(compiled)
        # JAX does not write down structures with types of others; these are values of the same structure.
        values = [jax.tree.unflatten(structure, range(structure.num_leaves)) for structure in structures]
        write_private(path, pickle.dumps((program, kernels.compiled(), *values)))
        _evict(path.parent)


def _evict(folder: Path) -> None:
    """Drop the programs that were not used for longest, until the rest fits; never the newest one."""
    programs = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns, reverse=True)
    total = 0
    for index, path in enumerate(programs):
        total += path.stat().st_size
        if index and total > LARGEST_BYTES:
            path.unlink()
