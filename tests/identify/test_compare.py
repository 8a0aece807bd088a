"""The difference between a recorded motion and the simulation, and what explains it."""

from pathlib import Path

import numpy as np

from footfall.identify.compare import compare_leg
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.leg import fixed_legs
from footfall.identify.record import record
from footfall.identify.recording import read_recording
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
SHORT = ExcitationConfig(settle_s=0.3, triangle_s=0.4, chirp_s=0.6, burst_s=0.2)


def test_a_wrong_friction_is_named(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    stiff = {"joint_friction": np.full(len(ROBOT.joint_names), 2.0)}
    record(ROBOT, simulated_bus(ROBOT, stiff), log, SHORT)
    gap = compare_leg(fixed_legs(ROBOT)[0], read_recording(log, ROBOT))
    assert (gap.error_rad > 2.0 * gap.noise_rad).all()
    for joint in range(3):
        shares = gap.explains[joint]
        assert max(shares, key=shares.__getitem__) == "joint_friction", shares
