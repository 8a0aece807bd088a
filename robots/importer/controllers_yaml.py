"""Writes `controllers.yaml` for an imported robot: the controller `stand`."""

import numpy as np

from footfall.robots.importer.machine import Machine
from footfall.robots.importer.motors import Drive
from footfall.robots.importer.robot_yaml import DAMPING_RATIO


def controllers_yaml(machine: Machine, drive: Drive) -> str:
    """The text of `controllers.yaml`: `stand` alone, with the gains of the stiffest joint for all of them.

    Walking controllers need figures that model files do not contain.
    """
    w = 2 * np.pi * drive.natural_frequency_hz
    armature = max(hinge.armature for hinge in machine.hinges)
    return f"""# Gains of the hand-written controllers (policies/controllers/), not tuned.
stand:
  rate_hz: 500.0
  kp: {armature * w**2:.4g}
  kd: {2 * DAMPING_RATIO * armature * w:.4g}
  tilt_gain: 0.3
  tilt_rate_gain_s: 0.02
  most_tilt_rad: 0.2
  settle_s: 0.5
"""
