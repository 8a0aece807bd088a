"""Devices that stop a robot from outside: a CAN frame and a key, up to a run on virtual buses."""

import os
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import can
import pytest
from changed_robots import described
from deploy_policies import Hold, stand_still
from relaxed_limits import RELAXED
from some_motors import frame

from footfall import JointCommand, PolicyInput, Robot, UserError, load_robot
from footfall.deploy.frames import Frames, joined
from footfall.deploy.session import Session, run_on_interface
from footfall.deploy.stop_inputs.frame import StopFrameBus
from footfall.deploy.stop_inputs.key import StopKeyInput
from footfall.deploy.stop_inputs.open import stop_inputs
from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import PlantConfig
from footfall.plant.serve import serving
from footfall.robots.stop_inputs import StopFrame, StopInputs, StopKey

FRAME = StopFrame("can1", 0x7F0, heartbeat_s=0.2)


def bus_that_hands_out(batches: Callable[[int], list[Frames]]) -> StopFrameBus:
    inner: Any = SimpleNamespace(receive=batches)
    return StopFrameBus(inner, FRAME, 1)


@pytest.mark.parametrize(
    ("arrives", "stops"),
    [
        (frame(0x7F0, b"\1", channel=1), True),
        (frame(0x7F0, b"", channel=1), True),
        (joined([frame(5, b"\2", 1), frame(0x7F0, b"\0", 1), frame(0x7F0, b"\x80", 1)]), True),
        (frame(0x7F0, b"\0\1\1", channel=1), False),
        (frame(0x7F0, b"\1", channel=0), False),
        (frame(0x7F1, b"\1", channel=1), False),
    ],
)
def test_a_frame_stops_by_its_first_byte(arrives: Frames, stops: bool) -> None:
    bus = bus_that_hands_out(lambda now_us: [arrives if now_us == 1000 else frame(0x7F0, b"\0", channel=1)])
    rest = joined(bus.receive(1000))
    assert (bus.stopped is not None) is stops
    stop_frames = (arrives.id == 0x7F0) & (arrives.channel == 1)
    assert rest.id.tolist() == arrives.id[~stop_frames].tolist()  # drivers do not see it
    bus.receive(2000)
    assert (bus.stopped is not None) is stops


@pytest.mark.parametrize(("beats", "silent_from_us"), [([], 0), ([0, 150_000, 300_000], 300_000)])
def test_a_missing_or_silent_heartbeat_stops(beats: list[int], silent_from_us: int) -> None:
    bus = bus_that_hands_out(lambda now_us: [frame(0x7F0, b"\0", channel=1)] if now_us in beats else [])
    for now_us in range(0, 1_000_000, 2000):
        bus.receive(now_us)
        if bus.stopped is not None:
            break
    assert (bus.stopped is not None, now_us) == (True, silent_from_us + 202_000)


def test_bad_stop_inputs_are_refused(go1: Robot, own_folder: Path) -> None:
    for bus, identifier in (("can1", 2), ("can0", 0x300)):  # of a motor and of the IMU
        robot = described(go1, stop_inputs=StopInputs(StopFrame(bus, identifier)))
        with pytest.raises(UserError), stop_inputs(robot, wiring_of(robot), None):  # type: ignore[arg-type]
            pass
    StopFrame("can1", 0x7FF)
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


@pytest.fixture
def device(tmp_path: Path) -> Iterator[tuple[str, int]]:
    """A pipe in place of an input device, and its other end."""
    path = tmp_path / "event0"
    os.mkfifo(path)
    end = os.open(path, os.O_RDWR)
    yield str(path), end
    os.close(end)


class TestKey:
    def test_any_key_stops_or_only_the_declared_key(self, device: tuple[str, int]) -> None:
        path, end = device
        any_key = StopKeyInput(StopKey(path))
        assert any_key.stopped is None
        os.write(end, event(2, 0, 5) + event(0, 0, 0) + event(1, 57, 0))  # moved, and a key released
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

    def test_unplugging_the_device_stops_the_robot(self, tmp_path: Path) -> None:
        path = tmp_path / "event0"
        os.mkfifo(path)
        key = StopKeyInput(StopKey(str(path)))
        assert "is gone" in key.stopped.reason
        key.close()


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
