"""Curves of the last seconds."""

from types import SimpleNamespace
from typing import Any

import numpy as np
from page_controls import PageControls

from footfall.pages.live_curves import LiveCurves
from footfall.pages.moment import Moment
from footfall.robots.description import Robot

DATE_S = 1_795_778_150.0  # Unix time, as a run on the wall clock has it


def test_the_time_of_curves_counts_back_from_now(go1: Robot) -> None:
    page = PageControls()
    curves = LiveCurves(page, page.add_folder("curves"), go1)  # type: ignore[arg-type]
    sensed: Any = SimpleNamespace(gyro=np.zeros(3), joint_torque=np.zeros(len(go1.joint_names)))
    still, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for tick in range(41):
        time_s = DATE_S + 0.5 * tick
        curves.add(Moment(time_s, still, level, np.array([0.3, 0.0, 0.0]), still, sensed, np.ones(4)))
    times, measured, command = page.charts["Forward, m/s"].data
    np.testing.assert_allclose(times, np.arange(-10.0, 0.1, 0.5), atol=1e-6)
    np.testing.assert_allclose(measured, 0.3)
    np.testing.assert_allclose(command, 0.0)
