"""JAX's cache of compiled programs, used only if no other user can write to it."""

import jax
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from footfall.common.cache import compilation_cache
from footfall.common.errors import UserError
from footfall.common.private_files import NotPrivateError, make_private_folder

MIN_COMPILE_S = 1.0  # programs that compile faster are not kept


def use_compilation_cache() -> str:
    """Keep compiled programs in the user's cache folder, so that a machine compiles each once.

    JAX runs the code in the cache, so no other user may write to it. Call this before anything is compiled.

    Returns:
        One line with the reason if there is no cache; otherwise empty.
    """
    folder, reason = None, ""
    try:
        folder = compilation_cache()
        make_private_folder(folder)
    except (NotPrivateError, UserError) as error:
        reason = str(error)
    except OSError as error:
        reason = f"{folder}: {error.strerror}"
    jax.config.update("jax_compilation_cache_dir", None if reason else str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", MIN_COMPILE_S)
    if not reason:
        return ""
    reset_cache()  # JAX would keep using its first folder
    return f"{reason}: compiling without a cache"
