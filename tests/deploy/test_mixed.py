"""Motors of several makers on one robot: each maker's driver handles its own joints."""

from dataclasses import replace

import numpy as np
import pytest
from reports import report

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.description import load_robot

MODELS = "RS03", "DM8009", "ODrive"
WIRING = replace(wiring_of(load_robot("go1")), models=MODELS * 4, motor_id=np.arange(4, 16))
ROBSTRIDE, DAMIAO, ODRIVE = (np.arange(first, 12, 3) for first in range(3))  # joints
END = open_motor_end(WIRING)
ALL = np.arange(12)
READINGS = np.array([[0.01], [0.1], [0.3]]) * ALL
REPORT = report(READINGS, 7 * (ALL == 3), 44)


def exchange(driver: Driver, ticks: int) -> None:
    """The motors answer queries, and ODrives send their readings."""
    for tick in range(ticks):
        answers = END.settings_replies(driver.query_settings()), END.broadcast(1000 * tick, ALL >= 0, REPORT)
        for frames in filter(None, answers):
            driver.replies(frames)


@pytest.fixture
def driver() -> Driver:
    """All motors have reported their settings."""
    driver = open_driver(WIRING)
    exchange(driver, 100)
    return driver


def test_limits_rounding_and_bits_are_each_joints_own() -> None:
    driver = open_driver(WIRING)
    for joints in (ROBSTRIDE, DAMIAO, ODRIVE):
        own = open_driver(WIRING.take(joints))
        for figures in ("lowest", "highest", "gain_rounding", "exchange_bits"):
            np.testing.assert_array_equal(getattr(driver, figures)[..., joints], getattr(own, figures))
        assert all(each in driver.filters for each in own.filters)


def test_commands_and_readings_are_each_joints_own(driver: Driver) -> None:
    """ODrives send their readings by themselves."""
    command = np.array([[0.01], [0.2], [30.0], [0.1], [0.5]]) * ALL
    requests = END.requests(driver.command(command))
    received = np.full((5, 12), np.nan)
    received[:, requests.motor] = requests.values
    both = np.union1d(ROBSTRIDE, DAMIAO)
    np.testing.assert_allclose(received[:, both], command[:, both], atol=0.1)
    frames = END.reply(slice(None), REPORT)
    for times in (None, np.arange(len(frames.id))):
        replies = driver.replies(frames._replace(time_us=times))
        np.testing.assert_allclose(replies.values, READINGS[:, replies.motor], atol=0.02)
        assert np.asarray(replies.motor)[replies.error > 0].tolist() == [3]
        assert (replies.temperature_c == 44).all()
        assert np.isnan(replies.current_a).all()
        assert (replies.time_us is None) == (times is None)
    said = END.broadcast(0, ALL >= 0, REPORT)
    assert said is not None
    replies = driver.replies(said)
    assert set(np.asarray(replies.motor)) <= set(ODRIVE)
    np.testing.assert_allclose(replies.values[0], READINGS[0, replies.motor], atol=1e-6)


def test_only_motors_that_are_not_ready_are_queried(driver: Driver) -> None:
    started = open_driver(WIRING)
    assert started.not_ready().startswith("motor FR_hip_joint")
    exchange(started, 2)
    assert len(started.query_settings().id) > 0
    assert (driver.not_ready(), len(driver.query_settings().id)) == ("", 0)


def test_motors_not_confirmed_off_are_given_by_joint(driver: Driver) -> None:
    driver.replies(END.reply(slice(None), report(READINGS, on=ALL != 4)))
    assert np.flatnonzero(~driver.not_confirmed_off()).tolist() == [4]


def test_batches_of_damping_go_out_in_each_makers_own_turn(driver: Driver) -> None:
    """An ODrive needs three frames, the others one: they get it each time."""
    one, two, three = (set(batch.id.tolist()) for batch in driver.damping(np.ones(12)))
    assert len(one & two & three) == 8
    assert len(one | two | three) == 8 + 3 * 4


def test_each_maker_has_its_own_behaviour_after_a_timeout() -> None:
    assert END.broadcasts  # as ODrives do
    for joints in (ROBSTRIDE, DAMIAO, ODRIVE):
        own = open_motor_end(WIRING.take(joints))
        assert set(END.timeout_error[joints]) == {own.timeout_error}
        assert set(END.timeout_latches[joints]) == {own.timeout_latches}
