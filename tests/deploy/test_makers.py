"""Motors of every maker, and of several makers on one robot: frames, settings, drive limits, standing up."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from changed_robots import with_each_motor
from deploy_policies import Hold, short_episode, stand_still
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from some_motors import MAKERS, read_settings, report, two_motors, with_motors
from watched_simulation import Simulation

from footfall import Robot, UserError, load_robot, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import damiao, robstride
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.frame_changes import late
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.robot import SimulatedRobot

MODELS = ["AK70-10 AK80-9", "DM4310 DM8009", "RS00 RS03", "ODrive ODrive", "AK80-9 RS03", "ODrive DM4310"]
MIT, DAMIAO, ROBSTRIDE, ODRIVE, *_ = WIRINGS = [two_motors(*pair.split()) for pair in MODELS]


def both_ends(wiring: Wiring) -> tuple[Any, Any]:
    """A driver that has read all settings, and its simulated motors."""
    driver, end = open_driver(wiring), open_motor_end(wiring)
    if wiring is not ODRIVE:
        read_settings(driver, end)
    return driver, end


@pytest.mark.parametrize("wiring", [MIT, DAMIAO, ROBSTRIDE, ODRIVE], ids=list(MAKERS)[:4])
def test_motors_decode_each_request(wiring: Wiring) -> None:
    driver, end = both_ends(wiring)
    for kind in (Request.ENABLE, Request.DISABLE, Request.CLEAR, Request.ZERO):
        frames = getattr(driver, kind.name.lower())()
        assert not len(frames.id) or end.requests(frames).kind.tolist() == [kind] * 2


@pytest.mark.parametrize(("wiring", "codes"), [(DAMIAO, [65535] + [4095] * 4), (ROBSTRIDE, [65535] * 5)])
@given(share=arrays.arrays(float, (5, 2), elements=st.floats(-2.0, 2.0)))
def test_values_are_rounded_and_clamped(wiring: Wiring, codes: list[int], share: np.ndarray) -> None:
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


def with_timeout(wiring: Wiring, setting: int) -> tuple[Any, Any, dict[int, float], int]:
    """Both ends, the settings of the knee's motor, and the index of its timeout, in units of 50 us."""
    driver, end = open_driver(wiring), open_motor_end(wiring)
    settings = (end.registers if wiring is DAMIAO else end.parameters)[1]
    timeout = damiao.TIMEOUT if wiring is DAMIAO else robstride.TIMEOUT
    settings[timeout] = setting
    return driver, end, settings, timeout


@pytest.mark.parametrize("wiring", [DAMIAO, ROBSTRIDE], ids=["Damiao", "RobStride"])
def test_a_wrong_timeout_is_set_and_read_back_or_the_motor_is_not_ready(wiring: Wiring) -> None:
    for setting, kept in ((0, 2000), (4_000_000_000, 2000), (2001, 2000), (40, 40)):
        driver, end, settings, timeout = with_timeout(wiring, setting)
        read_settings(driver, end)
        assert settings[timeout] == kept
    # A motor that confirms each write, but still reports its old setting.
    for setting, message in ((0, "has no"), (20_000, "1 s")):
        driver, end, *_ = with_timeout(wiring, setting)
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


@pytest.mark.parametrize("maker", ["MIT mode", "ODrive", "moteus", "mixed", "Damiao"])
def test_a_robot_whose_replies_are_late_stands_up(go1: Robot, maker: str) -> None:
    """Before they are enabled, the motors report their settings late."""
    robot = with_motors(go1, **MAKERS[maker])
    simulated = Simulation(robot, motor_timeout_s=None, hanging=True)
    simulated.bus.incoming = late(1000 if maker == "Damiao" else 5000)
    config = DeployConfig(stand_s=0.1, safety=SafetyConfig(damping_s=0.1))
    session = Session(stand_still, 0.05, realtime=False, config=config, lie_down=False)
    outcome = run_session(robot, Hold(robot), simulated.bus, session)
    assert (outcome.faults, outcome.final_state) == ((), "IDLE")


@pytest.mark.parametrize("wiring", WIRINGS, ids=MODELS)
def test_random_frames_raise_nothing_and_readings_stay_in_range(wiring: Wiring) -> None:
    """The test sends 20,000 frames with identifiers of every kind on both buses, most of the right length."""
    driver, end = open_driver(wiring), open_motor_end(wiring)
    rng, count = np.random.default_rng(1), 100
    identifiers = [0x000, 0x103, 0x203, 0x003, 0x061, 0x069, 0x06E, 0x07C, 0x7FF]
    identifiers += [EXTENDED | 0x028003FD, EXTENDED | 0x110003FD]
    for _ in range(200):
        near = rng.choice(identifiers, count) ^ rng.integers(0, 2, count) * (1 << rng.integers(0, 29, count))
        data = rng.integers(0, 256, (count, 8)).astype(np.uint8)
        data[::3, 0] = rng.choice([3, 0x13, 0x83], len(data[::3]))
        length = np.where(rng.random(count) < 0.7, 8, rng.integers(0, 9, count))
        frames = Frames(rng.integers(0, 2, count), near, data, length)
        motor, values, error, temperature, *_ = driver.replies(frames)
        assert values.shape == (3, len(temperature)) == (3, len(error))
        assert np.all(np.abs(values) <= driver.highest[[0, 1, 4]][:, motor] * (1 + 1e-9))
        end.requests(frames)
        end.settings_replies(frames)
        driver.not_ready()


# What a maker's drives limit, and the limits of the simulated drives.
LIMITS = {
    "RobStride": ("torque", lambda end: [own[0x700B] for own in end.parameters]),
    "moteus": ("torque", lambda end: end.torque_limit),
    "ODrive": ("current", lambda end: end.current_limit),
}


@pytest.mark.parametrize("maker", LIMITS)
def test_the_drives_limit_is_the_peak_torque_and_is_read_back(go1: Robot, maker: str) -> None:
    limit, limits_of = LIMITS[maker]
    robot = with_each_motor(with_motors(go1, **MAKERS[maker]), drive_limit=limit, current_endpoint=301)
    wiring = wiring_of(robot)
    driver, end = open_driver(wiring), open_motor_end(wiring)
    assert not np.allclose(limits_of(end), wiring.highest)
    for _ in range(10):
        answer = end.settings_replies(driver.query_settings())
        if answer is not None:
            driver.replies(answer)
    assert maker == "ODrive" or driver.not_ready() == ""
    motors = [robot.description.motors[joint.motor] for joint in robot.description.joints]
    expected = np.array([motor.peak_torque_nm for motor in motors])
    if limit == "current":
        expected /= [motor.gear_ratio * motor.torque_constant_nm_a for motor in motors]
    np.testing.assert_allclose(limits_of(end), expected, rtol=1e-6)


def test_a_limit_that_a_maker_does_not_have_is_refused(go1: Robot) -> None:
    for maker, limit in (("MIT mode", "torque"), ("Damiao", "current"), ("moteus", "current")):
        robot = with_each_motor(with_motors(go1, **MAKERS[maker]), drive_limit=limit)
        with pytest.raises(UserError, match=f"FR_hip_joint: .*{limit}"):
            open_driver(wiring_of(robot))


class TestSeveralMakers:
    """Each maker's driver handles its own joints of one robot."""

    joints, models = np.arange(12), ("RS03", "DM8009", "ODrive") * 4
    wiring = replace(wiring_of(load_robot("go1")), models=models, motor_id=joints + 4)
    by_maker = robstride, damiao, odrive = tuple(np.arange(first, 12, 3) for first in range(3))
    end = open_motor_end(wiring)
    readings = np.array([[0.01], [0.1], [0.3]]) * joints
    own_report = report(readings, 7 * (joints == 3), 44)

    def exchange(self, driver: Driver, ticks: int) -> None:
        """The motors answer queries, and ODrives send their readings."""
        for tick in range(ticks):
            queries = driver.query_settings()
            sent = self.end.broadcast(1000 * tick, self.joints >= 0, self.own_report)
            for frames in filter(None, (self.end.settings_replies(queries), sent)):
                driver.replies(frames)

    @pytest.fixture
    def driver(self) -> Driver:
        """All motors have reported their settings."""
        driver = open_driver(self.wiring)
        self.exchange(driver, 100)
        return driver

    def test_limits_rounding_bits_and_timeouts_are_each_joints_own(self) -> None:
        driver = open_driver(self.wiring)
        assert self.end.broadcasts  # as ODrives do
        for joints in self.by_maker:
            own, own_end = open_driver(self.wiring.take(joints)), open_motor_end(self.wiring.take(joints))
            for figures in ("lowest", "highest", "gain_rounding", "exchange_bits"):
                np.testing.assert_array_equal(getattr(driver, figures)[..., joints], getattr(own, figures))
            assert all(each in driver.filters for each in own.filters)
            assert set(self.end.timeout_error[joints]) == {own_end.timeout_error}
            assert set(self.end.timeout_latches[joints]) == {own_end.timeout_latches}

    def test_commands_and_readings_are_each_joints_own(self, driver: Driver) -> None:
        """ODrives send their readings by themselves."""
        command = np.array([[0.01], [0.2], [30.0], [0.1], [0.5]]) * self.joints
        requests = self.end.requests(driver.command(command))
        received = np.full((5, 12), np.nan)
        received[:, requests.motor] = requests.values
        polled = np.union1d(self.robstride, self.damiao)
        np.testing.assert_allclose(received[:, polled], command[:, polled], atol=0.1)
        frames = self.end.reply(slice(None), self.own_report)
        for times in (None, np.arange(len(frames.id))):
            replies = driver.replies(frames._replace(time_us=times))
            np.testing.assert_allclose(replies.values, self.readings[:, replies.motor], atol=0.02)
            assert np.asarray(replies.motor)[replies.error > 0].tolist() == [3]
            assert (replies.temperature_c == 44).all()
            assert np.isnan(replies.current_a).all()
            assert (replies.time_us is None) == (times is None)
        replies = driver.replies(self.end.broadcast(0, self.joints >= 0, self.own_report))
        assert set(np.asarray(replies.motor)) <= set(self.odrive)
        np.testing.assert_allclose(replies.values[0], self.readings[0, replies.motor], atol=1e-6)

    def test_motors_that_are_not_ready_or_not_confirmed_off_are_given_by_joint(self, driver: Driver) -> None:
        started = open_driver(self.wiring)
        assert started.not_ready().startswith("motor FR_hip_joint")
        self.exchange(started, 2)
        assert len(started.query_settings().id) > 0
        assert (driver.not_ready(), len(driver.query_settings().id)) == ("", 0)
        driver.replies(self.end.reply(slice(None), report(self.readings, on=self.joints != 4)))
        assert np.flatnonzero(~driver.not_confirmed_off()).tolist() == [4]

    def test_batches_of_damping_go_out_in_each_makers_own_turn(self, driver: Driver) -> None:
        """An ODrive needs three frames, one in each batch. The others' one frame is in every batch."""
        one, two, three = (set(batch.id.tolist()) for batch in driver.damping(np.ones(12)))
        assert (len(one & two & three), len(one | two | three)) == (8, 8 + 3 * 4)
