"""RobStride motors: their frames by the maker's manual, what they are asked at the start."""

import numpy as np
import pytest
from some_motors import frame as plain_frame
from some_motors import introduce, two_motors

from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.motor_ends.robstride import RobstrideMotorEnd

TWO = two_motors("RS00", "RS03", motor_id=7)
TURNS = 12.566370614359172


def frame(identifier: int, content: str, channel: int = 0) -> Frames:
    return plain_frame(EXTENDED | identifier, content, channel)


def hexed(frames: Frames) -> list[tuple[str, str]]:
    rows = zip((frames.id ^ EXTENDED).tolist(), frames.data, strict=True)
    return [(f"{identifier:08x}", row.tobytes().hex(" ", 2)) for identifier, row in rows]


@pytest.fixture
def driver() -> RobstrideDriver:
    driver = RobstrideDriver(TWO)
    introduce(driver, RobstrideMotorEnd(TWO))
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
    def test_faults_are_bits_of_the_id(self, driver: RobstrideDriver, identifier: int, says: str) -> None:
        (error,) = driver.replies(frame(identifier, "8000 8000 8000 0190")).error
        assert driver.error_name(int(error)) == says

    def test_a_fault_of_a_motor_that_went_off_is_told_beside_that(self, driver: RobstrideDriver) -> None:
        driver.replies(frame(0x028007FD, "8000 8000 8000 0190"))
        (error,) = driver.replies(frame(0x020107FD, "8000 8000 8000 0190")).error
        assert driver.error_name(int(error)) == "under-voltage and that it is disabled"

    def test_clearing_faults_and_setting_a_zero_are_the_manuals_frames(self, driver: RobstrideDriver) -> None:
        """Byte 0 is 1 in both: of a stop (4), which then clears faults, and of type 6."""
        assert hexed(driver.clear())[0] == ("0400fd07", "0100 0000 0000 0000")
        assert hexed(driver.zero())[0] == ("0600fd07", "0100 0000 0000 0000")

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
    def test_a_fault_comes_with_next_replies(self, driver: RobstrideDriver, word: str, says: str) -> None:
        """Type 21 is 0x15; the motor's id is in bits 8 to 15, as in a reply, and the word begins low."""
        assert not driver.replies(frame(0x150007FD, f"{word} 0000 0000")).values.size
        errors = [int(driver.replies(frame(0x028007FD, "8000 8000 8000 0190")).error[0]) for _ in range(2)]
        assert [driver.error_name(error, 0) for error in errors] == [says, says]
        other = driver.replies(frame(0x028007FD, "8000 8000 8000 0190", channel=1))
        assert other.error.tolist() == [0]

    @pytest.mark.parametrize("end", ["report", "clear"])
    def test_it_lasts_until_the_motor_clears_it(self, driver: RobstrideDriver, end: str) -> None:
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
    def test_replies_pass_the_filters(self, driver: RobstrideDriver, identifier: int, passes: bool) -> None:
        assert any(identifier & each["can_mask"] == each["can_id"] for each in driver.filters) == passes

    @pytest.mark.parametrize("identifier", [0x028008FD, 0x02800701, 0x018007FD, 0x110007FD])
    def test_frames_of_others_are_left_aside(self, driver: RobstrideDriver, identifier: int) -> None:
        assert not driver.replies(frame(identifier, "8000 8000 8000 0190")).values.size


class TestParameters:
    def test_a_question_and_its_answer(self) -> None:
        assert hexed(RobstrideDriver(TWO).query_settings())[0] == ("1100fd07", "0570 0000 0000 0000")
        answer = RobstrideMotorEnd(TWO).settings_replies(frame(0x1100FD07, "2870 0000 0000 0000"))
        assert answer is not None
        assert hexed(answer) == [("110007fd", "2870 0000 d007 0000")]  # 2000

    def test_a_time_out_lies_where_the_manual_puts_it(self) -> None:
        driver = RobstrideDriver(TWO)
        for told in ("0570 0000 0000 0000", "2870 0000 0000 0000"):
            driver.replies(frame(0x110007FD, told, channel=1))
        assert hexed(driver.query_settings())[1:] == [
            ("1200fd07", "2870 0000 d007 0000"),  # 2000
            ("1100fd07", "2870 0000 0000 0000"),
        ]


def test_simulated_motors_keep_their_faults_when_they_are_stopped(driver: RobstrideDriver) -> None:
    end = RobstrideMotorEnd(TWO)
    for frames, kind in ((driver.disable(), Request.DISABLE), (driver.clear(), Request.CLEAR)):
        requests = end.requests(frames)
        assert requests.kind is not None
        assert set(requests.kind.tolist()) == {kind}
