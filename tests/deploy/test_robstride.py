"""RobStride motors: their frames by the maker's manual, what they are asked at the start."""

from dataclasses import replace

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from reports import report
from two_motors import two_motors

from footfall.deploy.drivers import robstride
from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.wiring import wire
from footfall.plant.episode import run_episode
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.motor_ends.robstride import RobstrideMotorEnd
from footfall.plant.robot import SimulatedRobot
from footfall.robots.description import Robot

TWO = two_motors("RS00", "RS03", motor_id=7)
TURNS = 12.566370614359172
MOST = np.array([[TURNS, TURNS], [33.0, 20.0], [500.0, 5000.0], [5.0, 100.0], [14.0, 60.0]])


def frame(identifier: int, content: str, channel: int = 0) -> Frames:
    data = np.frombuffer(bytes.fromhex(content), np.uint8).reshape(1, 8)
    return Frames(np.array([channel]), np.array([EXTENDED | identifier]), data, np.array([8]))


def hexed(frames: Frames) -> list[tuple[str, str]]:
    return [
        (f"{identifier ^ EXTENDED:08x}", row.tobytes().hex(" ", 2))
        for identifier, row in zip(frames.id.tolist(), frames.data, strict=True)
    ]


@pytest.fixture
def driver() -> RobstrideDriver:
    driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
    for _ in robstride.PARAMETERS:
        answer = end.settings_replies(driver.query_settings())
        assert answer is not None
        assert not driver.replies(answer).values.size
    assert driver.not_ready() == ""
    return driver


class TestFrames:
    def test_a_command_lies_where_the_manual_puts_it(self, driver: RobstrideDriver) -> None:
        """No torque is the middle, 32767.5, to even 0x8000. 30 N m of 60 is 3/4 of 65535, 0xbfff."""
        values = np.array([[-TURNS, TURNS], [33.0, 0.0], [0.0, 5000.0], [5.0, 25.0], [0.0, 30.0]])
        assert hexed(driver.command(values)) == [
            ("01800007", "0000 ffff 0000 ffff"),
            ("01bfff07", "ffff 8000 ffff 4000"),
        ]

    def test_switching_on_and_off(self, driver: RobstrideDriver) -> None:
        assert hexed(driver.enable())[0] == ("0300fd07", "0000 0000 0000 0000")
        assert hexed(driver.disable())[1] == ("0400fd07", "0000 0000 0000 0000")

    def test_a_reply_lies_where_the_manual_puts_it(self, driver: RobstrideDriver) -> None:
        """Mode 2 in bits 22 and 23, motor 7 in bits 8 to 15, to host 0xfd; 40 degrees are 400, 0x0190."""
        replies = driver.replies(frame(0x028007FD, "ffff 0000 ffff 0190"))
        assert np.arange(2)[replies.motor].tolist() == [0]
        np.testing.assert_allclose(replies.values[:, 0], [TURNS, -33.0, 14.0])
        assert (replies.temperature_c.tolist(), replies.error.tolist()) == ([40], [0])

    @pytest.mark.parametrize(
        ("identifier", "says"),
        [
            (0x028107FD, "under-voltage"),
            (0x028407FD, "over-temperature"),
            (0x02A207FD, "over-current and that it is not calibrated"),
        ],
    )
    def test_faults_are_bits_of_the_identifier(
        self, driver: RobstrideDriver, identifier: int, says: str
    ) -> None:
        (error,) = driver.replies(frame(identifier, "8000 8000 8000 0190")).error
        assert driver.error_name(int(error)) == says

    def test_a_fault_of_a_motor_that_went_off_is_told_beside_that(self, driver: RobstrideDriver) -> None:
        driver.replies(frame(0x028007FD, "8000 8000 8000 0190"))
        (error,) = driver.replies(frame(0x020107FD, "8000 8000 8000 0190")).error
        assert driver.error_name(int(error)) == "under-voltage and that it is switched off"

    def test_forgetting_faults_and_setting_a_zero_lie_where_the_manual_puts_them(
        self, driver: RobstrideDriver
    ) -> None:
        """Byte 0 is 1 in both: of a stop (4), which then clears faults, and of type 6."""
        assert hexed(driver.clear())[0] == ("0400fd07", "0100 0000 0000 0000")
        assert hexed(driver.zero())[0] == ("0600fd07", "0100 0000 0000 0000")

    def test_the_rounding_of_gains_is_half_a_code_of_sixteen_bits(self, driver: RobstrideDriver) -> None:
        np.testing.assert_allclose(driver.gain_rounding, np.array([[250.0, 2500.0], [2.5, 50.0]]) / 65535)

    def test_a_motor_that_was_on_and_is_off_has_rebooted(self, driver: RobstrideDriver) -> None:
        ids = [0x020007FD, 0x028007FD, 0x020007FD, 0x028007FD]
        errors = [int(driver.replies(frame(each, "8000 8000 8000 0190")).error[0]) for each in ids]
        assert errors == [0, 0, robstride.WENT_OFF, 0]
        assert driver.not_confirmed_off().sum() == 1  # its last reply says that it is on

    @pytest.mark.parametrize(
        ("word", "says"),
        [
            ("0400 0000", "under-voltage"),
            ("0040 0000", "stall overload"),  # bit 14
            ("0000 0100", "over-current of phase A"),  # bit 16
            ("2800 0000", "over-voltage"),  # bits 3 and 5: the lowest of several
            ("0000 0080", "fault bit 31"),
        ],
    )
    def test_a_report_of_a_fault_is_told_with_the_next_replies(
        self, driver: RobstrideDriver, word: str, says: str
    ) -> None:
        """Type 21 is 0x15; the motor's id is in bits 8 to 15, as in a reply, and the word begins low."""
        assert not driver.replies(frame(0x150007FD, f"{word} 0000 0000")).values.size
        errors = [int(driver.replies(frame(0x028007FD, "8000 8000 8000 0190")).error[0]) for _ in range(2)]
        assert [driver.error_name(error, 0) for error in errors] == [says, says]
        other = driver.replies(frame(0x028007FD, "8000 8000 8000 0190", channel=1))
        assert other.error.tolist() == [0]

    @pytest.mark.parametrize("end", ["report", "clear"])
    def test_it_is_told_until_the_motor_reports_none_or_is_told_to_forget_it(
        self, driver: RobstrideDriver, end: str
    ) -> None:
        driver.replies(frame(0x150007FD, "0400 0000 0000 0000"))
        if end == "clear":
            driver.clear()
        else:
            driver.replies(frame(0x150007FD, "0000 0000 0000 0000"))
        assert driver.replies(frame(0x028007FD, "8000 8000 8000 0190")).error.tolist() == [0]

    def test_a_warning_is_no_fault(self, driver: RobstrideDriver) -> None:
        driver.replies(frame(0x150007FD, "0000 0000 0100 0000"))
        assert driver.replies(frame(0x028007FD, "8000 8000 8000 0190")).error.tolist() == [0]

    @pytest.mark.parametrize(
        ("identifier", "passes"),
        [
            (0x028007FD, True),
            (0x110007FD, True),
            (0x150007FD, True),
            (0x150007FE, False),
            (0x180007FD, False),
        ],
    )
    def test_replies_parameters_and_reports_of_faults_pass_the_filters(
        self, driver: RobstrideDriver, identifier: int, passes: bool
    ) -> None:
        assert any(identifier & each["can_mask"] == each["can_id"] for each in driver.filters) == passes

    @pytest.mark.parametrize("identifier", [0x028008FD, 0x02800701, 0x018007FD, 0x110007FD])
    def test_frames_of_others_are_left_aside(self, driver: RobstrideDriver, identifier: int) -> None:
        assert not driver.replies(frame(identifier, "8000 8000 8000 0190")).values.size

    @given(arrays.arrays(float, (5, 2), elements=st.floats(-2.0, 2.0)))
    def test_a_command_arrives_clamped_and_off_by_half_a_quantum_at_most(self, share: np.ndarray) -> None:
        driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
        requests = end.requests(driver.command(share * MOST))
        lowest = np.where(np.arange(5)[:, None] // 2 == 1, 0.0, -1.0) * MOST
        quantum = (MOST - lowest) / 65535
        error = np.abs(requests.values - np.clip(share * MOST, lowest, MOST))
        assert requests.kind is None
        assert np.all(error <= 0.5 * quantum * (1 + 1e-9))

    @pytest.mark.parametrize("code", [4, robstride.REPORTED + 2])
    def test_a_simulated_motor_tells_an_error_in_its_reply_or_in_a_report(
        self, driver: RobstrideDriver, code: int
    ) -> None:
        error = np.array([0, code], np.uint64)
        replies = driver.replies(
            RobstrideMotorEnd(TWO).reply(slice(None), report(np.zeros((3, 2)), error, 33))
        )
        assert np.arange(2)[replies.motor].tolist() == [0, 1]
        assert replies.error.tolist() == [0, code]

    @given(arrays.arrays(float, (3, 2), elements=st.floats(-2.0, 2.0)))
    def test_so_does_a_reply(self, share: np.ndarray) -> None:
        driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
        most = MOST[[0, 1, 4]]
        replies = driver.replies(end.reply(slice(None), report(share * most, 0, 33)))
        error = np.abs(replies.values - np.clip(share, -1.0, 1.0) * most)
        assert np.all(error <= most / 65535 * (1 + 1e-9))
        assert replies.temperature_c.tolist() == [33, 33]

    @pytest.mark.parametrize("bad", [np.nan, np.inf])
    def test_what_is_not_finite_is_refused(self, driver: RobstrideDriver, bad: float) -> None:
        values = np.zeros((5, 2))
        values[4, 1] = bad
        with pytest.raises(ValueError, match="not finite"):
            driver.command(values)

    def test_a_motor_knows_what_is_asked_of_it(self, driver: RobstrideDriver) -> None:
        end = RobstrideMotorEnd(TWO)
        assert end.requests(driver.enable()).kind.tolist() == [Request.ENABLE] * 2  # type: ignore[union-attr]
        assert end.requests(driver.disable()).kind.tolist() == [Request.DISABLE] * 2  # type: ignore[union-attr]


class TestParameters:
    def test_a_question_and_its_answer(self) -> None:
        assert hexed(RobstrideDriver(TWO).query_settings())[0] == ("1100fd07", "0570 0000 0000 0000")
        answer = RobstrideMotorEnd(TWO).settings_replies(frame(0x1100FD07, "2870 0000 0000 0000"))
        assert answer is not None
        assert hexed(answer) == [("110007fd", "2870 0000 d007 0000")]  # 2000

    @pytest.mark.parametrize(
        ("parameter", "value", "says"),
        [
            (robstride.RUN_MODE, 5, "is in run mode 5: parameter 0x7005 must be 0, operation mode"),
        ],
    )
    def test_a_motor_that_is_set_wrongly_is_not_switched_on(
        self, parameter: int, value: int, says: str
    ) -> None:
        driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
        end.parameters[1][parameter] = value
        for _ in range(3):
            if (answer := end.settings_replies(driver.query_settings())) is not None:
                driver.replies(answer)
        assert driver.not_ready() == f"motor knee (can1, id 7) {says}"

    @pytest.mark.parametrize(("told", "kept"), [(0, 2000), (4_000_000_000, 2000), (2001, 2000), (40, 40)])
    def test_a_time_out_that_is_off_or_too_long_is_set_and_read_back(self, told: int, kept: int) -> None:
        """20000 is a second."""
        driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
        end.parameters[1][robstride.TIME_OUT] = told
        for _ in range(3):
            if (answer := end.settings_replies(driver.query_settings())) is not None:
                driver.replies(answer)
        assert driver.not_ready() == ""
        assert end.parameters[1][robstride.TIME_OUT] == kept

    def test_a_time_out_lies_where_the_manual_puts_it(self) -> None:
        driver = RobstrideDriver(TWO)
        for told in ("0570 0000 0000 0000", "2870 0000 0000 0000"):
            driver.replies(frame(0x110007FD, told, channel=1))
        assert hexed(driver.query_settings())[1:] == [
            ("1200fd07", "2870 0000 d007 0000"),  # 2000
            ("1100fd07", "2870 0000 0000 0000"),
        ]

    def test_a_motor_that_does_not_take_it_is_not_switched_on(self) -> None:
        driver, end = RobstrideDriver(TWO), RobstrideMotorEnd(TWO)
        for _ in range(4):
            end.parameters[1][robstride.TIME_OUT] = 20_000
            asked = driver.query_settings()
            if (
                answer := end.settings_replies(asked.take(asked.id >> 24 & 0x1F == robstride.READ))
            ) is not None:
                driver.replies(answer)
        problem = "has a communication time-out of 1 s, and does not take one of 0.1 s"
        assert driver.not_ready() == f"motor knee (can1, id 7) {problem}"


def with_motors(robot: Robot, **protocols: str) -> Robot:
    motors = {
        name: replace(motor, protocol=protocols.get(name, motor.protocol))
        for name, motor in robot.description.motors.items()
    }
    return replace(robot, description=replace(robot.description, motors=motors))


class TestRobots:
    @pytest.mark.parametrize(
        "protocols", [{"hip": "RS06", "knee": "RS03"}, {"hip": "DM8009", "knee": "RS03"}]
    )
    def test_a_robot_of_these_motors_and_one_that_mixes_stand(
        self, go1: Robot, protocols: dict[str, str]
    ) -> None:
        trace = run_episode(with_motors(go1, **protocols), Hold(go1), short_episode())
        assert trace.faults == ()
        assert trace.final_state == "IDLE"
        np.testing.assert_allclose(trace.joint_position[-1], go1.default_pose, atol=0.05)

    def test_a_motor_that_reboots_says_so(self, go1: Robot) -> None:
        robot = with_motors(go1, hip="RS06", knee="RS03")

        def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
            if loop.walking and 0.3 < loop.walking_s < 0.3021:
                body.reboot(np.array([8]))

        trace = run_episode(robot, Hold(robot), short_episode(), watch)
        assert trace.faults == (f"motor {wire(robot).place(8)} reports that it is switched off",)
        assert trace.walked_s < 0.32
