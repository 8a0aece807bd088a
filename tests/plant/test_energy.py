"""Energy of the motors' work."""

import numpy as np
import pytest

from footfall.plant.energy import EnergyMeter
from footfall.robots.description import Robot


class TestEnergy:
    def test_power_is_the_mean_since_the_last_call(self, go1: Robot) -> None:
        meter = EnergyMeter(go1)
        torque, velocity = np.zeros(12), np.zeros(12)
        torque[0], velocity[0] = 2.0, 3.0
        torque[5], velocity[5] = 1.0, -4.0
        # The mean of the velocities before and after counts.
        meter.add(torque, velocity - 1.0, velocity + 1.0)
        meter.add(0 * torque, velocity, velocity)
        first = meter.take()
        assert first.mechanical == pytest.approx((6.0 - 4.0) / 2)
        assert first.positive == pytest.approx(6.0 / 2)
        # Winding resistance, as seen at the joint
        hip, knee = (0.17 / (0.105 * gear) ** 2 for gear in (6.0, 9.0))
        assert first.electrical == pytest.approx(1.0 + (hip * 4.0 + knee * 1.0) / 2)
        meter.add(0 * torque, velocity, velocity)
        assert meter.take().electrical == 0.0

    def test_each_step_counts_once_for_any_number_of_steps(self, go1: Robot) -> None:
        meter = EnergyMeter(go1)
        rng = np.random.default_rng(4)
        assert tuple(meter.take()) == (0.0, 0.0, 0.0)
        resistance, constant, gear = np.full(12, 0.17), np.full(12, 0.105), np.tile([6.0, 6.0, 9.0], 4)
        for steps in (200, 3, 64):
            torque, before, after = rng.normal(size=(3, steps, 12)) * 5.0
            velocity = (before + after) / 2
            reused = np.zeros((3, 12))
            for row in zip(torque, before, after, strict=True):
                reused[:] = row
                meter.add(*reused)
            power = meter.take()
            shaft = torque * velocity
            assert power.mechanical == pytest.approx(shaft.sum() / steps)
            assert power.positive == pytest.approx(shaft[shaft > 0].sum() / steps)
            loss = resistance * (torque / (gear * constant)) ** 2
            assert power.electrical == pytest.approx((shaft + loss).sum() / steps)
