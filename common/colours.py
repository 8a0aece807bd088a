"""Colours of annotations of a robot, in films and on pages; red, green, blue, opacity in [0, 1]."""

import numpy as np

COMMAND = np.array([0.10, 0.45, 0.95, 1.0])
VELOCITY = np.array([0.10, 0.70, 0.35, 1.0])
PUSH = np.array([0.90, 0.15, 0.15, 1.0])
FORCE = np.array([0.95, 0.60, 0.10, 1.0])
PLAN = np.array([0.60, 0.30, 0.85, 1.0])  # footholds, and the path to them
SUPPORT = np.array([0.20, 0.65, 0.75, 0.35])
CENTRE = np.array([0.95, 0.85, 0.25, 1.0])
CAPTURE = np.array([0.90, 0.30, 0.55, 1.0])
