"""The difference between a recorded motion and the simulation, and what explains it."""

from pathlib import Path

from footfall.identify.compare import compare_leg
from footfall.identify.leg import fixed_legs
from footfall.identify.recording import read_recording
from footfall.robots.description import Robot


def test_a_wrong_friction_is_named(go1: Robot, stiff_log: Path) -> None:
    gap = compare_leg(fixed_legs(go1)[0], read_recording(stiff_log, go1))
    assert (gap.error_rad > 2.0 * gap.noise_rad).all()
    for shares in gap.explains:
        assert max(shares, key=shares.__getitem__) == "joint_friction", shares
