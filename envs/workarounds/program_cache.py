"""Cache of compiled programs from one training to the next, so that they need not be traced again.

The key of JAX's own cache is the traced program; on a GPU, tracing takes longer than all the rest of a start.
Here the key is what the program is made from.
Reason: tracing takes most of a warm start. JAX's own `serialize_executable` writes the files, as a pickle
around machine code: a file here is code, and is only read if no other user can have written it.
Upstream: https://github.com/jax-ml/jax/issues/476 brought the serialisation, not a cache that skips tracing.
Remove it when JAX has one: tests/envs/test_workarounds.py then fails.
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
ENVIRONMENT_PREFIXES = ("JAX_", "XLA_", "CUDA_", "NVIDIA_")  # of environment variables that JAX reads
MEMORY_PREFIX = "XLA_PYTHON_CLIENT_"  # of those that change no program
CACHE_SETTINGS = ("jax_compilation_cache", "jax_persistent_cache")  # settings that change no program
NVIDIA_DRIVER = Path("/proc/driver/nvidia/version")
MAX_BYTES = 2 * 2**30  # of all programs together; beyond it, the least recently used are deleted
CLOCK_SLACK_NS = 2 * 10**9  # file systems may round a time down, by up to two seconds


class _Found(NamedTuple):
    """The result of looking a program up in the cache."""

    path: Path | None  # its file, which need not exist; None: there is no cache
    program: jax.stages.Compiled | None = None
    refusal: str = ""  # why an existing file is not used


_loading: dict[str, Future[_Found]] = {}  # programs that are being loaded, by fingerprint


def prefetch(*programs: tuple[Any, ...]) -> None:
    """Start loading programs in the background; each is given by its key."""
    by_name = {fingerprint(key): key for key in programs}
    missing = {name: key for name, key in by_name.items() if name not in _loading}
    if not missing:
        return
    # Read here: a background thread would wait for Python's lock after each of hundreds of files.
    source, installed = _source(), _installed()
    executor = ThreadPoolExecutor(len(missing))
    for name, key in missing.items():
        _loading[name] = executor.submit(_look_up, key, source, installed)
    executor.shutdown(wait=False)


def load_or_compile(
    lower: Callable[[], jax.stages.Lowered],
    executor: Executor,
    report: Callable[[str], None],
    *key: Any,
) -> Future[jax.stages.Compiled]:
    """The program from the cache, or compiled now.

    The cache is a folder in JAX's compilation cache, if there is one. A damaged file is compiled again. A
    program that cannot be serialised is not kept. Once a source file has changed since this process
    imported it, no program is kept, since the file no longer shows what was traced.

    Args:
        lower: traces the program, in this thread: `fewer_kernels` replaces functions for every thread.
        executor: compiles the program.
        report: shows one line if other users may have written the file.
        key: all that the program depends on besides source, libraries, device and JAX's settings;
            compared by `repr`, or as bytes.
    """
    loading = _loading.pop(fingerprint(key), None)
    found = loading.result() if loading else _look_up(key, _source(), _installed())
    if found.refusal:
        report(f"{found.refusal}: its compiled programs are not used, compiling again")
    if found.program is None:
        return executor.submit(_compile, lower(), found.path)
    loaded: Future[jax.stages.Compiled] = Future()
    loaded.set_result(found.program)
    return loaded


def _compile(lowered: jax.stages.Lowered, path: Path | None) -> jax.stages.Compiled:
    program = lowered.compile()
    if path is not None and _source() is not None:
        # In the background: the training does not wait for it, the process does at its end.
        Thread(target=_write, args=(path, program), name="keep program").start()
    return program


def fingerprint(parts: Iterable[Any]) -> str:
    """A digest of all parts."""
    digest = hashlib.sha256()
    for part in parts:
        content = part if isinstance(part, bytes) else repr(part).encode()
        digest.update(len(content).to_bytes(8, "big") + content)
    return digest.hexdigest()[:32]


def model_bytes(robot: Robot, timestep_s: float, contacts: Contacts = "feet") -> bytes:
    """The compiled model that a robot is trained on, as bytes."""
    model = training_model(robot, timestep_s, contacts)
    content = np.empty(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, buffer=content)
    return content.tobytes()


def _source() -> list[tuple[Path, bytes]] | None:
    """footfall's source files, as this process imported them; None if a file has changed since."""
    source = read_sources(SOURCES, TRAINING)
    latest_ns = footfall.IMPORTED_AT_NS - CLOCK_SLACK_NS
    # Checked after reading. Unlike mtime, ctime cannot be set.
    return source if all((SOURCES / path).stat().st_ctime_ns < latest_ns for path, _ in source) else None


def _surroundings(installed: Any) -> list[Any]:
    """Libraries, device and settings that a program depends on."""
    device = jax.local_devices()[0]
    return [
        installed,
        (device.platform, device.device_kind, device.client.platform_version),
        NVIDIA_DRIVER.read_text() if NVIDIA_DRIVER.is_file() else "",
        sorted(
            (name, value)
            for name, value in os.environ.items()
            if name.startswith(ENVIRONMENT_PREFIXES) and not name.startswith(MEMORY_PREFIX)
        ),
        sorted((n, repr(v)) for n, v in jax.config.values.items() if not n.startswith(CACHE_SETTINGS)),
    ]


def _installed() -> tuple[dict[str, str], list[str]]:
    """Versions of the libraries that programs are made with."""
    return versions(LIBRARIES), _device_libraries()


def _device_libraries() -> list[str]:
    """Names and versions from folder names: reading all installed packages takes much longer."""
    folders = {Path(entry) for entry in sys.path}
    patterns = [f"{name}.dist-info" for name in DEVICE_LIBRARIES]
    return sorted(path.name for folder in folders for pattern in patterns for path in folder.glob(pattern))


def _look_up(key: tuple[Any, ...], source: list[tuple[Path, bytes]] | None, installed: Any) -> _Found:
    folder = jax.config.values["jax_compilation_cache_dir"]
    if folder is None or source is None:
        return _Found(None)
    path = Path(folder) / "programs" / fingerprint([*source, *_surroundings(installed), *key])
    try:
        program, compiled_kernels, *values = pickle.loads(read_private(path))  # see `_write`
        kernels.adopt(compiled_kernels)
        found = _Found(path, deserialize_and_load(program, *map(jax.tree.structure, values)))
        os.utime(path)  # mark as most recently used
        return found
    except NotPrivateError as error:
        return _Found(path, refusal=str(error))
    except Exception:  # any damage of the file: a new one replaces it
        return _Found(path)


def _write(path: Path, compiled: jax.stages.Compiled) -> None:
    with suppress(Exception):  # a full disk, another user's folder, a program that calls Python
        program, *structures = serialize(compiled)
        # JAX does not serialise structures with foreign types; these are values of the same structure.
        values = [jax.tree.unflatten(structure, range(structure.num_leaves)) for structure in structures]
        write_private(path, pickle.dumps((program, kernels.compiled(), *values)))
        _evict(path.parent)


def _evict(folder: Path) -> None:
    """Delete the least recently used programs until the rest fits; never the newest one."""
    programs = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns, reverse=True)
    total = 0
    for index, path in enumerate(programs):
        total += path.stat().st_size
        if index and total > MAX_BYTES:
            path.unlink()
