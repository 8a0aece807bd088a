"""The way to the rsl_rl back end, which may not be installed."""

import os
from types import ModuleType

from footfall.common.errors import UserError

LIBRARIES = frozenset({"torch", "rsl_rl", "tensordict", "git", "onnxscript"})


def rsl_rl_back_end() -> ModuleType:
    """`footfall.train.rsl_rl.run`, once it is needed.

    Raises:
        UserError: a library of the extra `rsl-rl` is missing.
    """
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # upstream imports GitPython: git may be missing
    try:
        from footfall.train.rsl_rl import run as rsl_rl_run
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if missing not in LIBRARIES:
            raise
        raise UserError(
            f"the trainer rsl_rl needs {missing}, which is not installed:"
            " install the extra with pip install 'footfall[rsl-rl]'"
        ) from None
    return rsl_rl_run
