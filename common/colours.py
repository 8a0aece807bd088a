"""Colours of velocity arrows, alike in films and on pages; red, green, blue, opacity in [0, 1]."""

import numpy as np

COMMAND = np.array([0.10, 0.45, 0.95, 1.0])
VELOCITY = np.array([0.10, 0.70, 0.35, 1.0])
PUSH = np.array([0.90, 0.15, 0.15, 1.0])
