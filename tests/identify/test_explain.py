"""The effect that explains a misfit."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from footfall.identify.excitation import ExcitationConfig
from footfall.identify.explain import explained
from footfall.identify.fit import FitConfig, problem_of
from footfall.identify.leg import fixed_legs
from footfall.identify.record import record
from footfall.identify.recording import read_recording
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
SHORT = ExcitationConfig(settle_s=0.2, triangle_s=0.5, chirp_s=0.4, burst_s=0.2)
BUS_S = 0.0007  # transport time of a command and of a reading


def test_an_effect_missing_in_the_model_is_named(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    record(ROBOT, simulated_bus(ROBOT, {"stribeck_friction": 0.5 * ROBOT.motor.friction}), log, SHORT)
    recordings = [read_recording(log, ROBOT)]
    whole = problem_of(fixed_legs(ROBOT)[0], recordings, FitConfig(window_s=0.2, rate_hz=125.0))
    free = tuple(each for each in whole.parameters if each.quantity in ("armature", "joint_friction"))
    delays = {each: BUS_S for each in whole.parameters if each.quantity == "delay_s"}
    problem = replace(whole, parameters=free, fixed=delays)
    found = explained(problem, np.zeros(len(free)), rounds=1)
    assert found.best == "stribeck_friction", found
