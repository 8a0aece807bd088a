"""Names of the simulated robot's engines; the command line reads them without importing `plant`."""

from typing import Literal

EngineName = Literal["mujoco", "drake", "motrixsim"]
DEFAULT_ENGINE: EngineName = "mujoco"
