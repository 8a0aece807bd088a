"""moteus' register protocol on CAN FD: frames by its documents, faults, time-outs, buses."""

from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from some_motors import hexed, two_motors, with_motors

from footfall import Robot, UserError, run_episode
from footfall.deploy.drivers import moteus
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.moteus import Subframe, subframes
from footfall.deploy.drivers.moteus_driver import TURN
from footfall.deploy.frames import EXTENDED, FD, Frames
from footfall.deploy.log_analysis.candump import write_candump
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Report
from footfall.plant.motors import SimulatedMotors

TWO = two_motors("moteus", "moteus")
PER_RAD = np.array([1000.0, 60.0]) / TURN  # its configured gains, N m/rad and N m s/rad
OTHER = "2404000a005000000170ff230d181400"


def reply(content: str) -> Frames:
    """A reply of the first motor with this content, padded."""
    data, length = moteus.padded(bytes.fromhex(content), 1)
    return Frames(np.array([0]), moteus.from_motor(TWO.motor_id[:1]), data, np.array([length]))


def test_subframes_equal_those_in_the_makers_documents_and_others_are_refused() -> None:
    """A command and a query, and a reply."""
    assert list(subframes(bytes.fromhex("01000a07206000200150ff140400130d"))) == [
        Subframe(0x00, 0x000, 1, "b", (10,)),
        Subframe(0x00, 0x020, 3, "h", (96, 288, -176)),
        Subframe(0x10, 0x000, 4, "h", ()),
        Subframe(0x10, 0x00D, 3, "b", ()),
    ]
    assert list(subframes(bytes.fromhex(OTHER))) == [
        Subframe(0x20, 0x000, 4, "h", (10, 80, 256, -144)),
        Subframe(0x20, 0x00D, 3, "b", (24, 20, 0)),
    ]
    for short_or_foreign in ("01 00", "0e 20 00 00 80 3f", "7f 00", "04 ff"):
        with pytest.raises(ValueError, match="subframe"):
            list(subframes(bytes.fromhex(short_or_foreign)))


class TestFrames:
    def test_a_command_equals_the_command_calculated_by_hand(self) -> None:
        """From 0x7d to id 3, with a reply: 0.25, 0.5 turns (/s), 1.5 N m, half kp, a quarter kd, 100 ms."""
        one = [0.25 * TURN, 0.5 * TURN, 0.5 * PER_RAD[0], 0.25 * PER_RAD[1], 1.5]
        sent = open_driver(TWO).command(np.array([one, np.zeros(5)]).T)
        assert (sent.id.tolist(), sent.length.tolist()) == ([EXTENDED | FD | 0xFD03] * 2, [48, 48])
        assert hexed(sent)[0] == (
            "01 00 0a 0c 06 20 00 00 80 3e 00 00 00 3f 00 00 c0 3f 00 00 00 3f 00 00 80 3e 00 00 c0 7f"
            " 05 27 64 00 02 28 ff ff 01 2b 00 11 00 1f 01 13 0d 50"
        )
        assert not sent.data[:, 48:].any()

    def test_a_reply_equals_the_reply_calculated_by_hand(self) -> None:
        readings = np.array([[0.25 * TURN, -1.0], [-0.5 * TURN, 2.0], [1.5, -3.0]])
        report = Report(readings, np.zeros(2, np.uint64), np.array([True, False]), 20, (12.0, 1.0))
        sent = open_motor_end(TWO).reply(slice(None), report)
        assert sent.id.tolist() == [FD | 0x37D] * 2
        assert hexed(sent)[0] == "21 00 0a 2f 01 00 00 80 3e 00 00 00 bf 00 00 c0 3f 23 0d 18 14 00 50 50"

    def test_gains_are_limited_to_the_drives_own_which_it_needs(self) -> None:
        requests = open_motor_end(TWO).requests(open_driver(TWO).command(np.full((5, 2), 1e4)))
        np.testing.assert_allclose(requests.values[2:4], np.tile(PER_RAD, (2, 1)).T, rtol=1e-6)
        with pytest.raises(UserError, match=r"hip.*drive_gains"):
            open_driver(replace(TWO, drive_gains=np.zeros((2, 2))))

    def test_faults_have_names_and_short_or_other_replies_are_ignored(self) -> None:
        driver = open_driver(TWO)
        for mode, fault, name in (
            ("01", "26", "over-temperature"),
            ("01", "63", "fault 99"),
            ("0b", "00", "that it has timed out"),
            ("0a", "63", ""),  # what limits a running motor is no fault
        ):
            (error,) = driver.replies(reply(f"2100{mode}2f01{'00' * 12}230d1814{fault}")).error.tolist()
            assert (driver.error_name(error) if error else "") == name

        for ignored in ("21 00 0a", OTHER, f"21000a2f010000c07f{'00' * 8}230d181400"):  # short, NaN
            assert not driver.replies(reply(ignored)).values.size


def test_motors_time_out_if_the_host_is_silent_and_stay_off_until_stopped(go1: Robot) -> None:
    """Commands contain a time-out of 100 ms."""
    driver, at_rest, still, on = open_driver(TWO), np.zeros((3, 2)), np.zeros(2), []
    figures = {name: value[:2] for name, value in go1.motor._asdict().items() if value is not None}
    motor = go1.motor._replace(**figures)
    motors = SimulatedMotors(open_motor_end(TWO), motor, 2, {}, step_s=0.001, timeout_s=60.0)
    motors.answer(0, driver.enable(), at_rest)
    for step in range(1, 121):
        motors.torque(step, still, still)
        on.append(bool(motors.enabled.all()))
    assert (on[:100], on[105:]) == ([True] * 100, [False] * 15)
    answer = motors.answer(121, driver.enable(), at_rest)
    assert not motors.enabled.any()
    assert driver.error_name(int(driver.replies(answer).error[0])) == "that it has timed out"
    motors.answer(122, driver.disable(), at_rest)
    motors.answer(123, driver.enable(), at_rest)
    assert motors.enabled.all()


def test_a_log_has_can_fd_frames_in_candumps_format(go1: Robot, tmp_path: Path) -> None:
    robot: Any = with_motors(go1, hip="moteus", knee="moteus")
    run_episode(robot, Hold(robot), short_episode(duration_s=0.1, log=tmp_path / "a.mcap", log_frames=True))
    text = StringIO()
    assert write_candump(tmp_path / "a.mcap", text) == len(text.getvalue().splitlines())
    assert text.getvalue().count("0000FD01##") > 100
    assert " 300#" in text.getvalue()
    assert " 17D##" in text.getvalue()
