"""RobStride motors: their frames by the maker's manual, and queries at the start."""

import numpy as np
import pytest
from some_motors import frame as plain_frame
from some_motors import read_settings, two_motors

from footfall.deploy.drivers.robstride import RobstrideDriver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.plant.motor_ends.motor_end import Request
from footfall.plant.motor_ends.robstride import RobstrideMotorEnd

TWO = two_motors("RS00", "RS03", motor_id=7)
TURNS = 12.566370614359172


def frame(identifier: int, content: str) -> Frames:
    return plain_frame(EXTENDED | identifier, content)


def hexed(frames: Frames) -> list[tuple[str, str]]:
    rows = zip((frames.id ^ EXTENDED).tolist(), frames.data, strict=True)
    return [(f"{identifier:08x}", row.tobytes().hex(" ", 2)) for identifier, row in rows]


@pytest.fixture
def driver() -> RobstrideDriver:
    driver = RobstrideDriver(TWO)
    read_settings(driver, RobstrideMotorEnd(TWO))
    return driver


class TestFrames:
    def test_a_command_is_encoded_as_in_the_manual(self, driver: RobstrideDriver) -> None:
        """Zero torque is the middle, 32767.5, rounded to 0x8000; 30 N m of 60 are 3/4 of 65535, 0xbfff."""
        values = np.array([[-TURNS, TURNS], [33.0, 0.0], [0.0, 5000.0], [5.0, 25.0], [0.0, 30.0]])
        expected = [("01800007", "0000 ffff 0000 ffff"), ("01bfff07", "ffff 8000 ffff 4000")]
        assert hexed(driver.command(values)) == expected

    def test_a_reply_is_decoded_as_in_the_manual(self, driver: RobstrideDriver) -> None:
        """Bits 22 and 23 are mode 2, bits 8 to 15 motor 7; the host is 0xfd. 40 degrees are 400, 0x0190."""
        replies = driver.replies(frame(0x028007FD, "ffff 0000 ffff 0190"))
        assert np.arange(2)[replies.motor].tolist() == [0]
        np.testing.assert_allclose(replies.values[:, 0], [TURNS, -33.0, 14.0])
        assert (replies.temperature_c.tolist(), replies.error.tolist()) == ([40], [0])

    def test_faults_in_the_id(self, driver: RobstrideDriver) -> None:
        for identifier, message in (
            (0x028107FD, "under-voltage"),
            (0x028407FD, "over-temperature"),
            (0x02A207FD, "over-current and that it is not calibrated"),
            (0x020107FD, "under-voltage and that it is disabled"),  # it was enabled before
        ):
            (error,) = driver.replies(frame(identifier, "8000 8000 8000 0190")).error
            assert driver.error_name(int(error)) == message

    def test_enable_disable_clear_and_zero_are_the_manuals_frames(self, driver: RobstrideDriver) -> None:
        """Byte 0 is 1 in a stop (type 4) that clears faults and in type 6."""
        for order, identifier, first in (
            ("enable", "0300fd07", "0000"),
            ("disable", "0400fd07", "0000"),
            ("clear", "0400fd07", "0100"),
            ("zero", "0600fd07", "0100"),
        ):
            assert hexed(getattr(driver, order)()) == [(identifier, f"{first} 0000 0000 0000")] * 2

    def test_a_fault_lasts_until_it_is_cleared_and_a_warning_is_no_fault(
        self, driver: RobstrideDriver
    ) -> None:
        reply, cleared = frame(0x028007FD, "8000 8000 8000 0190"), frame(0x150007FD, "0000 0000 0000 0000")
        for clear in (driver.clear, lambda: driver.replies(cleared)):
            driver.replies(frame(0x150007FD, "0400 0000 0000 0000"))
            assert driver.replies(reply).error[0]
            clear()
            assert driver.replies(reply).error.tolist() == [0]
        driver.replies(frame(0x150007FD, "0000 0000 0100 0000"))
        assert driver.replies(reply).error.tolist() == [0]

    def test_replies_pass_the_filters(self, driver: RobstrideDriver) -> None:
        identifiers = (0x028007FD, 0x110007FD, 0x150007FD, 0x150007FE, 0x180007FD)
        passes = [any(i & f["can_mask"] == f["can_id"] for f in driver.filters) for i in identifiers]
        assert passes == [True] * 3 + [False] * 2


def test_simulated_motors_answer_a_query_and_keep_their_faults_when_stopped(driver: RobstrideDriver) -> None:
    assert hexed(RobstrideDriver(TWO).query_settings())[0] == ("1100fd07", "0570 0000 0000 0000")
    end = RobstrideMotorEnd(TWO)
    answer = end.settings_replies(frame(0x1100FD07, "2870 0000 0000 0000"))
    assert hexed(answer) == [("110007fd", "2870 0000 d007 0000")]  # 2000
    for frames, kind in ((driver.disable(), Request.DISABLE), (driver.clear(), Request.CLEAR)):
        assert set(end.requests(frames).kind.tolist()) == {kind}
