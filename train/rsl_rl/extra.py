"""The way to the rsl_rl back end, which may not be installed."""

import os
from types import ModuleType

from footfall.common.installation import needs_extra


def rsl_rl_back_end() -> ModuleType:
    """`footfall.train.rsl_rl.run`, once it is needed.

    Raises:
        UserError: a library of the extra `rsl-rl` is missing.
    """
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # upstream imports GitPython: git may be missing
    with needs_extra("rsl-rl", "the trainer rsl_rl needs"):
        from footfall.train.rsl_rl import run as rsl_rl_run
    return rsl_rl_run
