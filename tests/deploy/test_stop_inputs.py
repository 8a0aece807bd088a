"""Devices that stop a robot from outside: a CAN frame, a key, and a button on the bus of a walking robot."""

import os
import struct
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import can
import pytest
from changed_robots import described
from deploy_policies import Hold, stand_still
from relaxed_limits import RELAXED
from some_motors import frame

from footfall import JointCommand, PolicyInput, Robot, UserError, load_robot
from footfall.deploy.frames import joined
from footfall.deploy.session import Session, run_on_interface
from footfall.deploy.stop_inputs.frame import StopFrameBus
from footfall.deploy.stop_inputs.key import StopKeyInput
from footfall.deploy.stop_inputs.open import stop_inputs
from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import PlantConfig
from footfall.plant.serve import serving
from footfall.robots.stop_inputs import StopFrame, StopInputs, StopKey

FRAME = StopFrame("can1", 0x7F0, heartbeat_s=0.2)
HEARTBEAT = frame(0x7F0, b"\0", channel=1)


def test_a_frame_stops_by_its_first_byte() -> None:
    for arrives, stops in (
        (frame(0x7F0, b"\1", channel=1), True),
        (frame(0x7F0, b"", channel=1), True),
        (joined([frame(5, b"\2", 1), HEARTBEAT, frame(0x7F0, b"\x80", 1)]), True),
        (frame(0x7F0, b"\0\1\1", channel=1), False),
        (frame(0x7F0, b"\1", channel=0), False),
        (frame(0x7F1, b"\1", channel=1), False),
    ):
        bus = StopFrameBus(Mock(receive=Mock(side_effect=([arrives], [HEARTBEAT]))), FRAME, 1)
        rest = joined(bus.receive(1000))
        assert (bus.stopped is not None) is stops
        stop_frames = (arrives.id == 0x7F0) & (arrives.channel == 1)
        assert rest.id.tolist() == arrives.id[~stop_frames].tolist()  # drivers do not see it
        bus.receive(2000)
        assert (bus.stopped is not None) is stops


@pytest.mark.parametrize("beats", [[], [0, 150_000, 300_000]])
def test_a_missing_or_silent_heartbeat_stops(beats: list[int]) -> None:
    bus = StopFrameBus(Mock(receive=lambda now_us: [HEARTBEAT] if now_us in beats else []), FRAME, 1)
    for now_us in range(0, 1_000_000, 2000):
        bus.receive(now_us)
        if bus.stopped is not None:
            break
    assert (bus.stopped is not None, now_us) == (True, max(beats, default=0) + 202_000)


def test_bad_stop_inputs_are_refused(go1: Robot, own_folder: Path) -> None:
    for bus, identifier in (("can1", 2), ("can0", 0x300)):  # of a motor and of the IMU
        robot = described(go1, stop_inputs=StopInputs(StopFrame(bus, identifier)))
        with pytest.raises(UserError), stop_inputs(robot, wiring_of(robot), None):  # type: ignore[arg-type]
            pass
    StopFrame("can1", 0x7FF)  # the largest identifier of 11 bits
    StopFrame("can1", 0x800, extended=True)
    with pytest.raises(ValueError, match="id"):
        StopFrame("can1", 0x800)
    with pytest.raises(UserError, match="/dev/none"):
        StopKeyInput(StopKey("/dev/none"))
    text = (own_folder / "robot.yaml").read_text()
    (own_folder / "robot.yaml").write_text(text + "stop_inputs: {frame: {bus: can9, id: 2032}}\n")
    with pytest.raises(UserError, match=r"stop_inputs\.frame: .* 'can9'"):
        load_robot(own_folder)


def event(kind: int, code: int, value: int) -> bytes:
    return struct.pack("@llHHi", 0, 0, kind, code, value)


def test_any_key_or_only_the_declared_key_stops_and_so_does_unplugging(tmp_path: Path) -> None:
    """A pipe is in place of an input device; an event is a motion, a key pressed or a key released."""
    path = str(tmp_path / "event0")
    os.mkfifo(path)
    end = os.open(path, os.O_RDWR)
    any_key = StopKeyInput(StopKey(path))
    assert any_key.stopped is None
    os.write(end, event(2, 0, 5) + event(0, 0, 0) + event(1, 57, 0))
    assert any_key.stopped is None
    os.write(end, event(1, 57, 1) + event(1, 57, 0))
    stop = any_key.stopped
    assert "57" in stop.reason
    assert any_key.stopped is stop
    any_key.close()
    space = StopKeyInput(StopKey(path, code=57, damp=True))
    os.write(end, event(1, 30, 1))
    assert space.stopped is None
    os.write(end, event(1, 57, 1))
    assert space.stopped.damp
    space.close()
    unplugged = StopKeyInput(StopKey(path))
    os.close(end)
    assert "is gone" in unplugged.stopped.reason
    unplugged.close()


class Presses(Hold):
    """Holds the default pose; after a while the button is pressed."""

    button: can.BusABC | None

    def act(self, inputs: PolicyInput) -> JointCommand:
        if inputs.time_s > 0.3 and self.button is not None:
            self.button.send(can.Message(arbitration_id=0x7F0, data=[1], is_extended_id=False))
            self.button = None
        return super().act(inputs)


def test_a_button_on_the_bus_lays_a_walking_robot_down(go1: Robot) -> None:
    """The buses are virtual, with a simulated robot at their other end."""
    robot = described(go1, stop_inputs=StopInputs(StopFrame("can1", 0x7F0)))
    config = replace(RELAXED, joint_rate_hz=100.0, stand_s=0.2, pose_rate_rad_s=4.0)
    plant, policy = PlantConfig(motor_timeout_s=RELAXED.motor_timeout_s), Presses(robot)
    with can.Bus(interface="virtual", channel="can1") as policy.button, serving(robot, "virtual", plant):
        outcome = run_on_interface(robot, policy, "virtual", Session(stand_still, 20.0, config=config))
    assert outcome.faults == ("stopped by the stop frame 0x7f0 on can1",)
    assert (outcome.final_state, outcome.walked_s < 20.0) == ("ESTOP", True)
