"""Names of the simulated robot's engines, for the command line, which imports no simulated robot."""

from typing import Literal

EngineName = Literal["mujoco", "drake"]
DEFAULT_ENGINE: EngineName = "mujoco"
