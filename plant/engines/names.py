"""Names of the engines, which the command line needs without their libraries."""

from typing import Literal

EngineName = Literal["mujoco", "drake"]
DEFAULT_ENGINE: EngineName = "mujoco"
