"""Where velocity commands come from."""

from collections.abc import Callable

import numpy as np

CommandSource = Callable[[float], np.ndarray]  # time since walking began, s, to (3,) m/s, m/s, rad/s
