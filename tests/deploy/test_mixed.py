"""Motors of several makers on one robot: each maker's driver handles its own joints."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from footfall.deploy.drivers.driver import Replies
from footfall.deploy.drivers.mixed import MixedDriver
from footfall.deploy.frames import Frames
from footfall.plant.motor_ends.mixed import MixedMotorEnd

FIRST, SECOND = np.array([2, 0]), np.array([1, 3, 4])  # joints of the two makers, each in its own order


def frames(identifier: Any, time_us: np.ndarray | None = None) -> Frames:
    identifier = np.atleast_1d(identifier)
    k = len(identifier)
    return Frames(np.zeros(k, int), identifier, np.zeros((k, 8), np.uint8), np.full(k, 8), time_us)


@dataclass
class Maker:
    """A driver whose frames have one identifier for each joint, beginning at `first_id`."""

    first_id: int
    n: int
    turns: int = 1  # batches of damping
    why: str = ""  # it is not ready
    on: tuple[bool, ...] = ()
    knows_time: bool = True
    knows_current: bool = True

    def __post_init__(self) -> None:
        numbers = self.first_id + np.arange(self.n)
        self.filters = ({"can_id": self.first_id, "can_mask": 0x7F0, "extended": False},)
        self.lowest, self.highest = -1.0 * np.tile(numbers, (5, 1)), 1.0 * np.tile(numbers, (5, 1))
        self.gain_rounding, self.exchange_bits = 0.1 * np.tile(numbers, (2, 1)), 10 * numbers

    def query_settings(self) -> Frames:
        return frames(self.first_id)

    def not_ready(self) -> str:
        return self.why

    def not_confirmed_off(self) -> np.ndarray:
        return np.array(self.on)

    def command(self, values: np.ndarray) -> Frames:
        made = frames(self.first_id + np.arange(self.n))
        made.data[:] = values[0][:, None]
        return made

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        return tuple(frames(self.first_id + turn) for turn in range(self.turns))

    def replies(self, frames: Frames) -> Replies:
        ours = (frames.id >= self.first_id) & (frames.id < self.first_id + self.n)
        motor = frames.id[ours] - self.first_id
        value = 1.0 * frames.id[ours]
        times = frames.time_us[ours] if self.knows_time and frames.time_us is not None else None
        current = value + 40 if self.knows_current else None
        rows = np.tile(value, (3, 1))
        return Replies(motor, rows, frames.id[ours] % 256, value + 20, value + 30, times, current)


def mixed(first: Maker, second: Maker) -> MixedDriver:
    return MixedDriver([(first, FIRST), (second, SECOND)])  # type: ignore[list-item]


@pytest.fixture
def driver() -> MixedDriver:
    return mixed(Maker(0x10, 2), Maker(0x20, 3, knows_current=False))


BY_JOINT = [0x11, 0x20, 0x10, 0x21, 0x22]


def test_limits_rounding_and_bits_are_each_joints_own(driver: MixedDriver) -> None:
    np.testing.assert_array_equal(driver.highest, np.tile(BY_JOINT, (5, 1)))
    np.testing.assert_array_equal(driver.lowest, -driver.highest)
    np.testing.assert_allclose(driver.gain_rounding, 0.1 * np.tile(BY_JOINT, (2, 1)))
    np.testing.assert_array_equal(driver.exchange_bits, 10 * np.array(BY_JOINT))
    assert [each["can_id"] for each in driver.filters] == [0x10, 0x20]


def test_each_motor_gets_its_joints_command(driver: MixedDriver) -> None:
    sent = driver.command(np.tile(np.arange(5), (5, 1)))
    result = dict(zip(sent.id.tolist(), sent.data[:, 0].tolist(), strict=True))
    assert [result[identifier] for identifier in BY_JOINT] == [0, 1, 2, 3, 4]


def test_each_reply_is_its_joints_with_its_time(driver: MixedDriver) -> None:
    """Of five frames, in any order, one belongs to no motor."""
    received = frames([0x22, 0x11, 0x7F, 0x20, 0x10], np.array([5.0, 6.0, 7.0, 8.0, 9.0]))
    replies = driver.replies(received)
    order = np.argsort(replies.motor)
    assert np.asarray(replies.motor)[order].tolist() == [0, 1, 2, 4]
    codes = np.array([0x11, 0x20, 0x10, 0x22])
    np.testing.assert_array_equal(replies.values[:, order], np.tile(codes, (3, 1)))
    np.testing.assert_array_equal(replies.error[order], codes)
    np.testing.assert_array_equal(replies.temperature_c[order], codes + 20)
    np.testing.assert_array_equal(replies.voltage[order], codes + 30)
    assert replies.current_a is not None
    np.testing.assert_array_equal(replies.current_a[order], [0x11 + 40, np.nan, 0x10 + 40, np.nan])
    assert replies.time_us is not None
    assert replies.time_us[order].tolist() == [6.0, 8.0, 9.0, 5.0]


def test_motors_not_confirmed_off_are_given_by_joint() -> None:
    driver = mixed(Maker(0x10, 2, on=(True, False)), Maker(0x20, 3, on=(False, False, True)))
    assert driver.not_confirmed_off().tolist() == [False, False, True, False, True]


def test_only_motors_that_are_not_ready_are_queried() -> None:
    driver = mixed(Maker(0x10, 2), Maker(0x20, 3, why="the hip has not reported its range"))
    assert driver.query_settings().id.tolist() == [0x20]
    assert driver.not_ready() == "the hip has not reported its range"


def test_batches_of_damping_go_out_in_each_makers_own_turn() -> None:
    """Two batches of one maker and three of the other: after six ticks both start again."""
    driver = mixed(Maker(0x10, 2, turns=2), Maker(0x20, 3, turns=3))
    sent = [batch.id.tolist() for batch in driver.damping(np.zeros(5))]
    assert sent == [[0x10 + turn % 2, 0x20 + turn % 3] for turn in range(6)]


def test_each_maker_has_its_own_behaviour_after_a_timeout() -> None:
    ends: list[Any] = [
        SimpleNamespace(filters=(), broadcasts=False, time_out_error=number, time_out_latches=latches)
        for number, latches in ((1, True), (2, False))
    ]
    mixed = MixedMotorEnd([(ends[0], np.array([0, 2])), (ends[1], np.array([1]))])
    assert mixed.time_out_latches.tolist() == [True, False, True]
    assert mixed.time_out_error.tolist() == [1, 2, 1]
