"""Energy of the motors' work."""

import tracemalloc

import numpy as np
import pytest

from footfall.plant.energy import EnergyMeter
from footfall.robots.description import Robot


class TestEnergy:
    def test_each_step_counts_once_for_any_number_of_steps(self, go1: Robot) -> None:
        meter = EnergyMeter(go1)
        rng = np.random.default_rng(4)
        assert tuple(meter.take()) == (0.0, 0.0, 0.0)
        resistance, constant, gear = np.full(12, 0.17), np.full(12, 0.105), np.tile([6.0, 6.0, 9.0], 4)
        for steps in (200, 3, 64):
            torque, before, after = rng.normal(size=(3, steps, 12)) * 5.0
            velocity = (before + after) / 2
            for row in zip(torque, before, after, strict=True):
                meter.add(*row)
            power = meter.take()
            shaft = torque * velocity
            assert power.mechanical == pytest.approx(shaft.sum() / steps)
            assert power.positive == pytest.approx(shaft[shaft > 0].sum() / steps)
            loss = resistance * (torque / (gear * constant)) ** 2
            assert power.electrical == pytest.approx((shaft + loss).sum() / steps)

    def test_memory_does_not_grow_if_nobody_takes_the_power(self, go1: Robot) -> None:
        """A served simulated robot may run for hours."""
        meter = EnergyMeter(go1)
        tracemalloc.start()
        try:
            for _ in range(5000):
                meter.add(*np.ones((3, 12)))
            assert tracemalloc.get_traced_memory()[0] < 200_000
        finally:
            tracemalloc.stop()
        assert meter.take().mechanical == pytest.approx(12.0)
