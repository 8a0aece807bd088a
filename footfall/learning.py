"""The way into the learning wing, which may not be installed."""

import io
from contextlib import redirect_stdout
from types import ModuleType

from robots.errors import UserError

LIBRARIES = frozenset({"jax", "jaxlib", "brax", "flax", "optax", "mujoco", "onnx", "tensorboardX"})


def learning_wing() -> ModuleType:
    """`train.api`, once it is needed.

    Raises:
        UserError: JAX or another library of the `train` extra is missing.
    """
    try:
        with redirect_stdout(io.StringIO()):  # MJX announces there that it goes without Warp, as it should
            from train import api
    except ModuleNotFoundError as error:
        missing = (error.name or "").split(".")[0]
        if missing not in LIBRARIES:
            raise
        raise UserError(
            f"training and export need {error.name}, which is not installed:"
            " install the extra with pip install 'footfall[train]'"
        ) from None
    return api
