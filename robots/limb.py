"""One limb as data: a chain of hinges from the base to a tip."""

from typing import NamedTuple

import numpy as np


class Limb(NamedTuple):
    """A limb with all joints at zero, base frame; m hinges from the base outwards."""

    anchor: np.ndarray  # (m, 3) m, a point on each hinge's axis
    axis: np.ndarray  # (m, 3) unit vectors
    tip: np.ndarray  # (3,) m
    lower: np.ndarray  # (m,) rad, of each joint's range
    upper: np.ndarray  # (m,) rad
    default: np.ndarray  # (m,) rad, in the default pose

    @property
    def reach(self) -> float:
        """Largest distance of the tip from the first hinge, m: the length of the stretched chain."""
        corners = np.concatenate([self.anchor, self.tip[None]])
        return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
