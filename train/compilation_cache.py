"""JAX's cache of compiled programs, while nobody else can have written it."""

import jax
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from footfall.common.cache import compilation_cache
from footfall.common.private_files import NotPrivateError, make_private_folder

LEAST_COMPILE_S = 1.0  # what compiles in less is not kept


def use_compilation_cache() -> str:
    """Compile once per machine: keep compiled programs where the user's caches are.

    JAX runs what it finds there, so nobody else may have written it. Call it before anything is compiled.

    Returns:
        why there is no cache, one line; empty if there is one.
    """
    folder, reason = compilation_cache(), ""
    try:
        make_private_folder(folder)
    except NotPrivateError as error:
        reason = str(error)
    except OSError as error:
        reason = f"{folder}: {error.strerror}"
    jax.config.update("jax_compilation_cache_dir", None if reason else str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_COMPILE_S)
    if not reason:
        return ""
    reset_cache()  # JAX keeps to the folder that it began with
    return f"{reason}: no compiled programs are taken from there, compiling afresh"
