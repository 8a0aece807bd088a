"""ODrive axes: their frames by the maker's manual, the joint law on the host, queries at the start."""

import struct
from dataclasses import replace

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from some_motors import MAKERS, frame, hexed, report, two_motors, with_motors

from footfall import JointCommand, Robot, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import odrive
from footfall.deploy.drivers.odrive_driver import OdriveDriver
from footfall.deploy.frames import Frames, joined
from footfall.deploy.loop import ControlLoop
from footfall.deploy.safety_config import SafetyConfig
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.motor_ends.odrive import OdriveMotorEnd
from footfall.plant.robot import SimulatedRobot

TURN = 6.283185307179586
TWO = two_motors("ODrive", "ODrive", gear_ratio=(1.0, 8.0))
HIP, KNEE = "motor hip (can0, id 3)", "motor knee (can1, id 3)"


def pair(identifier: int, first: float, second: float, channel: int = 0) -> Frames:
    return frame(identifier, struct.pack("<ff", first, second), channel)


def heartbeat(state: int, error: int = 0, channel: int = 0) -> Frames:
    return frame(0x061, struct.pack("<IBBBB", error, state, 0, 1, 0), channel)


def rows(frames: Frames) -> list[tuple[int, str]]:
    """The identifier and content of each frame."""
    return list(zip(frames.id.tolist(), hexed(frames), strict=True))


def answer_all(driver: OdriveDriver) -> None:
    """Both axes report that they are enabled, at position zero."""
    for channel in (0, 1):
        for frames in (pair(0x069, 0, 0, channel), pair(0x07C, 0, 0, channel), heartbeat(8, channel=channel)):
            driver.replies(frames)


@pytest.fixture
def driver() -> OdriveDriver:
    """Both axes have reported all settings, are enabled, at position zero."""
    driver = OdriveDriver(TWO)
    driver.enable()
    answer_all(driver)
    assert (driver.not_ready(), driver.not_enabled()) == ("", "")
    return driver


class TestFrames:
    def test_frames_of_enable_disable_and_mode_are_the_manuals(self) -> None:
        """Node 3 is 0x060; state 8 is the closed loop, 1 off; mode 1 is torque, 1 passes it through."""
        for order, identifier, content in (
            ("query_settings", 0x06B, "01 00 00 00 01 00 00 00"),
            ("enable", 0x067, "08 00 00 00"),
            ("disable", 0x067, "01 00 00 00"),
            ("clear", 0x078, ""),
            ("zero", 0x079, "00 00 00 00"),
        ):
            assert rows(getattr(OdriveDriver(TWO), order)())[0] == (identifier, content)

    def test_a_torque_is_a_float_at_the_rotor(self, driver: OdriveDriver) -> None:
        """2.5 N m is 0x40200000; behind a gear of 8 it takes 0.3125, 0x3ea00000."""
        values = np.zeros((5, 2))
        values[4] = 2.5
        assert rows(driver.command(values)) == [(0x06E, "00 00 20 40"), (0x06E, "00 00 a0 3e")]

    def test_damping_is_velocity_control_at_rest(self, driver: OdriveDriver) -> None:
        """Behind a gear of 8, 3 N m s/rad are 3 * 2 pi / 64 = 0.29452 N m/(turn/s), 0x3e96cbe4."""
        assert [rows(batch)[1] for batch in driver.damping(np.full(2, 3.0))] == [
            (0x06D, "00 00 00 00 00 00 00 00"),
            (0x07B, "e4 cb 96 3e 00 00 00 00"),
            (0x06B, "02 00 00 00 01 00 00 00"),
        ]

    @pytest.mark.filterwarnings("error")
    def test_readings_are_finite_of_own_nodes_and_the_estimated_torque(self, driver: OdriveDriver) -> None:
        """The first number of a torque's frame is its target, and a torque is no reading by itself."""
        assert not driver.replies(pair(0x07C, 9.0, 0.5, 1)).values.size
        assert driver.replies(pair(0x069, 0.0, 0.0, 1)).values[2, 0] == 4.0
        others = [pair(0x089, 1, 1), pair(0x069 | 1 << 31, 1, 1), frame(0x069, b"\0" * 7)]
        assert not driver.replies(joined(others)).values.size
        for bits in ((0x7F800001, 0), (0x7F800000, 0xFF800000), (0x7FC00000, 0)):  # signalling NaN, inf, NaN
            assert not driver.replies(frame(0x069, struct.pack("<II", *bits))).values.size
        driver.replies(pair(0x07C, 0.0, float("inf")))
        assert driver.replies(pair(0x069, 0.0, 0.0)).values[2, 0] == 0.0

    def test_supply_and_temperature_are_nan_until_reported(self, driver: OdriveDriver) -> None:
        """33 f5 42 41 was recorded from an axis on 12 V. The hotter of two temperatures counts."""
        before = driver.replies(pair(0x069, 0.0, 0.0))
        assert np.isnan([before.voltage[0], before.temperature_c[0]]).all()
        driver.replies(joined([frame(0x077, "33f542410000c03f"), pair(0x075, 40.0, 55.0)]))
        after = driver.replies(pair(0x069, 0.0, 0.0))
        found = after.voltage[0], after.current_a[0], after.temperature_c[0]
        assert found == (pytest.approx(12.184863), 1.5, 55.0)

    def test_errors_are_bits_of_the_heartbeat(self, driver: OdriveDriver) -> None:
        for bits, reason in (
            (0x200, "under-voltage"),
            (0x01000000, "timeout"),
            (0x4000, "over-temperature of its power stage"),
            (0x80000000, "error bit 31"),
            (0x6000, "over-temperature of its motor"),  # the lowest of several
            (0, "disabled"),  # it has rebooted
        ):
            driver.replies(heartbeat(1, bits))
            (error,) = driver.replies(pair(0x069, 0.0, 0.0)).error
            assert reason in driver.error_name(int(error))
            driver.replies(heartbeat(8))
            assert driver.replies(pair(0x069, 0.0, 0.0)).error.tolist() == [0]


class TestReadings:
    def test_stiffness_and_damping_act_on_the_latest_reading(self, driver: OdriveDriver) -> None:
        """The hip is at a quarter of a turn, 1.5708 rad, at 1 rad/s; the knee at zero, behind a gear of 8."""
        driver.replies(pair(0x069, 0.25, 1.0 / TURN))
        law = JointCommand(position=2.0, velocity=0.5, kp=10.0, kd=2.0, torque=0.25)  # type: ignore[arg-type]
        hip, knee = driver.command(np.tile(law, (2, 1)).T).data[:, :4].copy().view("<f4")[:, 0]
        assert hip == pytest.approx(10.0 * (2.0 - TURN / 4) + 2.0 * (0.5 - 1.0) + 0.25, rel=1e-6)
        assert knee == pytest.approx((10.0 * 2.0 + 2.0 * 0.5 + 0.25) / 8.0, rel=1e-6)

    def test_positions_without_torques_are_at_fault(self, driver: OdriveDriver) -> None:
        codes = [int(driver.replies(pair(0x069, 0.0, 0.0)).error[0]) for _ in range(26)]
        assert codes[:25] == [0] * 25
        assert driver.error_name(codes[25]) == "no torque (set torques_msg_rate_ms)"


class TestStart:
    def test_the_first_axis_that_is_not_ready_or_not_enabled_is_named(self) -> None:
        driver = OdriveDriver(TWO)
        for frames, missing in (
            (pair(0x069, 0, 0), f"{KNEE} sends no position"),
            (pair(0x069, 0, 0, 1), f"{HIP} sends no torque"),
            (joined([pair(0x07C, 0, 0), pair(0x07C, 0, 0, 1)]), f"{HIP} sends no heartbeat"),
            (heartbeat(1), f"{KNEE} sends no heartbeat"),
        ):
            driver.replies(frames)
            assert driver.not_ready().startswith(missing)
        driver.replies(heartbeat(1, channel=1))
        assert driver.not_ready() == ""
        assert driver.not_enabled().startswith(HIP)
        driver.replies(joined([heartbeat(8), heartbeat(8, channel=1)]))
        assert driver.not_enabled() == ""
        driver.replies(heartbeat(1, channel=1))
        assert driver.not_enabled().startswith(KNEE)
        assert driver.not_confirmed_off().tolist() == [True, False]

    def test_a_watchdog_is_read_and_has_limits(self) -> None:
        """Queries read the knee's endpoints 0x19a, a switch of one byte, and 0x199, little-endian."""
        for enabled, timeout_s, reason in (
            (1, 0.1, ""),
            (1, 0.02, ""),
            (1, 0.1 * (1 + 1e-7), ""),  # by a float's rounding
            (1, 0.11, "watchdog of 0.11 s"),
            (0, 0.1, "watchdog disabled"),
            (1, 0.0, "watchdog of 0 s"),
        ):
            driver = OdriveDriver(replace(TWO, watchdog_endpoints=np.array([[0, 0], [0x19A, 0x199]])))
            answer_all(driver)
            assert "watchdog" in driver.not_ready()
            assert rows(driver.query_settings())[2:] == [(0x064, "00 9a 01 00")]
            assert not driver.replies(frame(0x065, bytes([0, 0x9A, 1, 0, enabled]), 1)).values.size
            assert rows(driver.query_settings())[2:] == [(0x064, "00 99 01 00")]
            driver.replies(frame(0x065, bytes([0, 0x99, 1, 0]) + struct.pack("<f", timeout_s), 1))
            assert reason in driver.not_ready() if reason else driver.not_ready() == ""
            assert len(driver.query_settings().id) == 2  # nothing is left to be read


class TestMotorEnd:
    def test_a_torque_command_needs_torque_mode_and_damping_velocity_mode(self, driver: OdriveDriver) -> None:
        end = OdriveMotorEnd(TWO)
        assert not end.requests(driver.command(np.ones((5, 2)))).values.size
        end.requests(driver.query_settings())
        assert end.requests(driver.command(np.ones((5, 2)))).values.shape == (5, 2)
        rest, gain, mode = driver.damping(np.full(2, 3.0))
        np.testing.assert_array_equal(end.requests(rest).values, np.zeros((5, 2)))  # the torque is gone
        assert end.requests(gain).values.shape == end.requests(mode).values.shape == (5, 0)
        braked = end.requests(rest)
        np.testing.assert_allclose(braked.values, [[0] * 2, [0] * 2, [0] * 2, [3] * 2, [0] * 2])
        assert np.asarray(braked.kind).tolist() == [Request.COMMAND] * 2

    def test_an_error_is_the_manuals_bit(self, driver: OdriveDriver) -> None:
        """0x200 is under-voltage, 0x01000000 an expired watchdog; only the hip reports it."""
        end, rest = OdriveMotorEnd(TWO), np.zeros((3, 2))
        for error, bits in ((0, 0), (1, 1), (10, 0x200), (odrive.WATCHDOG, 0x01000000), (32, 0x80000000)):
            state = report(rest, np.array([error, 0]), 41)
            received = joined(
                [*filter(None, (end.broadcast(1000 * ms, rest[0] == 0, state) for ms in range(100)))]
            )
            driver.replies(received)
            beats = received.take(received.id & 0x1F == odrive.HEARTBEAT)
            words = beats.data[:, :4].copy().view("<u4")[:, 0]
            assert dict(zip(beats.channel.tolist(), words.tolist(), strict=True)) == {0: bits, 1: 0}
            assert driver.replies(pair(0x069, 0.0, 0.0)).error.tolist() == [error]


def test_axes_damp_by_themselves_when_the_host_receives_nothing(go1: Robot) -> None:
    """The joint law runs on the host, whose readings become old: the axes have to damp by themselves."""
    robot, braked = with_motors(go1, **MAKERS["ODrive"]), list[float]()

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and loop.walking_s > 0.05:
            loop._bus.receive = None  # type: ignore[assignment, method-assign]
        if loop.state.faults:
            body.advance(loop.now_us)
            truth = body.truth()
            braked.append(float(np.sum(truth.motor_torque * truth.joint_velocity)))

    config = DeployConfig(stand_s=0.2, safety=SafetyConfig(damping_s=0.1))
    (fault,) = run_episode(robot, Hold(robot), short_episode(duration_s=0.2, config=config), watch).faults
    assert "loop" in fault
    assert min(braked[20:]) < -1.0  # W
