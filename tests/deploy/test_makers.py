"""Motors of every maker: requests, rounding, settings at the start, robots that stand."""

from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from reports import report
from some_motors import MAKERS, read_settings, two_motors, with_motors

from footfall import Robot, run_episode
from footfall.deploy.drivers import damiao, robstride
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.robot import SimulatedRobot

MIT, DAMIAO, ROBSTRIDE, ODRIVE = (
    two_motors(*models)
    for models in (("AK70-10", "AK80-9"), ("DM4310", "DM8009"), ("RS00", "RS03"), ("ODrive", "ODrive"))
)
ALL = pytest.mark.parametrize("wiring", [MIT, DAMIAO, ROBSTRIDE, ODRIVE], ids=list(MAKERS)[:4])
WITH_SETTINGS = pytest.mark.parametrize("wiring", [DAMIAO, ROBSTRIDE], ids=["Damiao", "RobStride"])


def both_ends(wiring: Wiring) -> tuple[Any, Any]:
    """A driver that has read all settings, and its simulated motors."""
    driver, end = open_driver(wiring), open_motor_end(wiring)
    if wiring is not ODRIVE:
        read_settings(driver, end)
    return driver, end


@ALL
class TestRequests:
    def test_motors_decode_each_request(self, wiring: Wiring) -> None:
        driver, end = both_ends(wiring)
        for frames, kind in (
            (driver.enable(), Request.ENABLE),
            (driver.disable(), Request.DISABLE),
            (driver.clear(), Request.CLEAR),
            (driver.zero(), Request.ZERO),
        ):
            assert not len(frames.id) or end.requests(frames).kind.tolist() == [kind] * 2


@pytest.mark.parametrize(
    ("wiring", "codes"), [(DAMIAO, [65535, 4095, 4095, 4095, 4095]), (ROBSTRIDE, [65535] * 5)]
)
class TestRounding:
    """Values are rounded to the nearest code and clamped to the range."""

    @given(share=arrays.arrays(float, (5, 2), elements=st.floats(-2.0, 2.0)))
    def test_rounding_of_commands_and_readings(
        self, wiring: Wiring, codes: list[int], share: np.ndarray
    ) -> None:
        assume(not (share > 0.998).all(axis=0).any())  # would read as a special frame of MIT mode
        driver, end = both_ends(wiring)
        highest, rows = driver.highest, [0, 1, 4]
        half = 0.5 * (highest - driver.lowest) / np.array(codes)[:, None] * (1 + 1e-9)
        requests = end.requests(driver.command(share * highest))
        assert np.all(np.abs(requests.values - np.clip(share * highest, driver.lowest, highest)) <= half)
        readings = np.clip(share * highest, -highest, highest)[rows]
        for _ in range(2):  # the second time from arrays that were seen before
            replies = driver.replies(end.reply(slice(None), report(share[rows] * highest[rows], 0, 33)))
        assert np.all(np.abs(replies.values - readings) <= half[rows])
        assert replies.temperature_c.tolist() == [33, 33]


@WITH_SETTINGS
class TestSettings:
    def own(self, end: Any) -> tuple[dict[int, float], int]:
        """Settings of the knee's motor, and the index of its time-out: 2000 are 0.1 s, 20 000 are 1 s."""
        if hasattr(end, "registers"):
            return end.registers[1], damiao.TIMEOUT
        return end.parameters[1], robstride.TIMEOUT

    @pytest.mark.parametrize(("setting", "kept"), [(0, 2000), (4_000_000_000, 2000), (2001, 2000), (40, 40)])
    def test_a_wrong_timeout_is_set_and_read_back(self, wiring: Wiring, setting: int, kept: int) -> None:
        driver, end = open_driver(wiring), open_motor_end(wiring)
        settings, timeout = self.own(end)
        settings[timeout] = setting
        read_settings(driver, end)
        assert settings[timeout] == kept

    @pytest.mark.parametrize(("setting", "message"), [(0, "has no"), (20_000, "1 s")])
    def test_a_motor_that_ignores_it_is_disabled(self, wiring: Wiring, setting: int, message: str) -> None:
        """The motor confirms the write, but reports its old setting."""
        driver, end = open_driver(wiring), open_motor_end(wiring)
        settings, timeout = self.own(end)
        settings[timeout] = setting
        for _ in range(8):
            queries = driver.query_settings()
            reads = queries.data[:, 2] == damiao.READ if wiring is DAMIAO else queries.id >> 24 & 0x1F == 0x11
            driver.replies(queries.take(~reads)._replace(id=np.full((~reads).sum(), 0x203)))
            if (answer := end.settings_replies(queries.take(reads))) is not None:
                driver.replies(answer)
        assert driver.not_ready().startswith("motor knee (can1, id 3) ")
        assert message in driver.not_ready()


@pytest.mark.parametrize("maker", ["Damiao", "RobStride", "ODrive"])
def test_a_rebooted_motor_is_a_fault(go1: Robot, maker: str) -> None:
    robot, joint = with_motors(go1, **MAKERS[maker]), 8

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and 0.1 < loop.walking_s < 0.1021:
            body.reboot(np.array([joint]))

    trace = run_episode(robot, Hold(robot), short_episode(duration_s=0.6), watch)
    assert trace.faults == (f"motor {wiring_of(robot).label(joint)} reports that it is disabled",)
    assert maker == "ODrive" or trace.walked_s < 0.12  # an axis reports it with its next heartbeat


IDENTIFIERS = [
    *(0x000, 0x103, 0x203, 0x003, 0x061, 0x069, 0x06E, 0x07C, 0x7FF, EXTENDED | 0x028003FD),
    EXTENDED | 0x110003FD,
]


MIXTURES = "AK70-10 AK80-9|DM4310 DM8009|RS00 RS03|ODrive ODrive|AK80-9 RS03|ODrive DM4310"


@pytest.mark.parametrize("models", MIXTURES.split("|"))
def test_random_frames_raise_nothing_and_readings_stay_in_range(models: str) -> None:
    """The test sends 20,000 frames with identifiers of every kind on both buses, some of the right length."""
    wiring = two_motors(*models.split())
    driver, end = open_driver(wiring), open_motor_end(wiring)
    rng, count = np.random.default_rng(1), 100
    highest = driver.highest[[0, 1, 4]]
    for _ in range(200):
        near = rng.choice(IDENTIFIERS, count) ^ rng.integers(0, 2, count) * (1 << rng.integers(0, 29, count))
        data = rng.integers(0, 256, (count, 8)).astype(np.uint8)
        data[::3, 0] = rng.choice([3, 0x13, 0x83], len(data[::3]))
        length = np.where(rng.random(count) < 0.7, 8, rng.integers(0, 9, count))
        frames = Frames(rng.integers(0, 2, count), near, data, length)
        motor, values, error, temperature, *_ = driver.replies(frames)
        assert values.shape == (3, len(temperature)) == (3, len(error))
        assert np.all(np.abs(values) <= highest[:, motor] * (1 + 1e-9))
        end.requests(frames)
        end.settings_replies(frames)
        driver.not_ready()
