"""A recording that several tests of identification read."""

from pathlib import Path

import numpy as np
import pytest

from footfall.identify.excitation import ExcitationConfig
from footfall.identify.record import record
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import Robot


@pytest.fixture(scope="session")
def stiff_log(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short log of a simulated go1 with twice its joint friction."""
    log = tmp_path_factory.mktemp("stiff") / "log.mcap"
    short = ExcitationConfig(settle_s=0.3, triangle_s=0.4, chirp_s=0.6, burst_s=0.2)
    record(go1, simulated_bus(go1, {"joint_friction": np.full(len(go1.joint_names), 2.0)}), log, short)
    return log
