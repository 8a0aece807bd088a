"""Faults injected into a run change their frames and readings and nothing else."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from some_motors import report

from footfall.deploy.drivers import imu
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wiring_of
from footfall.plant.frame_changes import dropped, flipped, from_imu, late
from footfall.plant.injection import FaultInjector, InjectingBus, InjectingCommandSource
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.description import Robot

READING = imu.Inertial((0.1, -0.2, 0.3), (1.0, 2.0, 9.0), (1.0, 0.0, 0.0, 0.0))


def batch(number: int, k: int = 1) -> Frames:
    """Frames of motors with a number in all their bytes, that many milliseconds after the start."""
    data, time_us = np.full((k, 8), number, np.uint8), np.full(k, 1000.0 * number)
    return Frames(np.zeros(k, int), np.full(k, 0x100), data, np.full(k, 8), time_us)


def of_imu(counter: int = 7) -> Frames:
    return Frames(np.zeros(3, int), np.array(imu.IDS), imu.encode(READING, counter), np.full(3, 8))


class TestFrames:
    def test_a_delayed_frame_arrives_once_with_a_later_time(self) -> None:
        hold = late(3000)
        came = [hold([batch(n)] if n < 3 else [], 1000 * n) for n in range(7)]
        found = [[(int(each.data[0, 0]), float(each.time_us[0])) for each in batches] for batches in came]
        assert found == [[], [], [], [(0, 3000.0)], [(1, 4000.0)], [(2, 5000.0)], []]

    def test_a_share_of_frames_gets_lost(self) -> None:
        """A quarter of 4000 is 1000, with a standard deviation of 27."""
        left = dropped(0.25, np.random.default_rng(0))(batch(7, k=4000))
        assert 4000 - len(left.id) == pytest.approx(1000, abs=110)
        assert len(dropped(0.0, np.random.default_rng(0))(batch(7, k=100)).id) == 100

    def test_one_bit_of_a_share_of_frames_is_flipped(self) -> None:
        whole = batch(0x55, k=4000)
        changed = flipped(0.25, np.random.default_rng(0))(whole)
        bits = np.unpackbits(changed.data ^ whole.data, axis=1).astype(int)
        assert set(bits.sum(axis=1).tolist()) == {0, 1}
        assert bits.sum() == pytest.approx(1000, abs=110)
        assert bits.sum(axis=0).min() > 0  # each of the 64 bits may change
        assert (whole.data == 0x55).all()


class TestReadings:
    """The frames of a go1's motors and IMU."""

    VALUES = np.array([0.05, 0.4, 0.9])[:, None] * np.linspace(-1.0, 1.0, 12)

    @pytest.fixture
    def arriving(self, go1: Robot) -> list[Frames]:
        end = open_motor_end(wiring_of(go1))
        return [end.reply(slice(None), report(self.VALUES, temperature_c=31)), of_imu()]

    @pytest.fixture
    def injector(self, go1: Robot, arriving: list[Frames]) -> FaultInjector:
        bus: Any = SimpleNamespace(receive=lambda _: arriving)
        anything: Any = None
        command, rng = InjectingCommandSource(np.zeros(3)), np.random.default_rng(1)
        return FaultInjector(go1, wiring_of(go1), anything, InjectingBus(bus), anything, command, rng)

    def test_one_motors_reading_changes(self, injector: FaultInjector, arriving: list[Frames]) -> None:
        def change(values: np.ndarray, temperature: np.ndarray) -> None:
            np.testing.assert_allclose(values, self.VALUES, atol=0.02)
            assert temperature.tolist() == [31] * 12
            values[:, injector.joint] = 0.0
            temperature[injector.joint] = 90

        injector.on_values(change)
        motors, of_the_imu = injector.bus.receive(0)
        differ = (motors.data != arriving[0].data).any(axis=1)
        assert np.flatnonzero(differ).tolist() == [injector.joint]
        np.testing.assert_array_equal(of_the_imu.data, arriving[1].data)

    def test_half_the_reading_rate_makes_lag(self, injector: FaultInjector, arriving: list[Frames]) -> None:
        """Readings from 10 ms after the first one arrive 20 ms after it."""
        injector.falls_behind(0.5, from_imu)
        read: list[list[int]] = []
        for now_ms in range(21):
            arriving[:] = [of_imu(counter=now_ms)]
            counters = [imu.decode_gyro(f.data[0].tobytes())[1] for f in injector.bus.receive(1000 * now_ms)]
            read.append(counters)
        assert (read[0], read[20]) == ([0], [10])
        assert [counter for counters in read for counter in counters] == list(range(11))
