"""How a robot stood, from a trace that is made up, and the stand-in robot on a bus."""

import threading
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wire
from footfall.plant import serve as serve_module
from footfall.plant import standing
from footfall.plant.robot import PlantConfig
from footfall.plant.serve import main, serve, serving
from footfall.plant.standing import HoldDefaultPose, standing_test
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot


def stood(
    monkeypatch: pytest.MonkeyPatch, robot: Robot, **changes: Any
) -> tuple[standing.StandingResult, Any]:
    """What is made of four samples, and the episode that was asked for. The second half counts as settled."""
    height = robot.description.standing_height_m
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [0.3, 0, 2.0], [0, -0.1, 0], [0, 0, 0]])
    torque = np.zeros((4, 12))
    torque[:, 0], torque[:, 1] = (-20.0, 1.0, -6.0, 3.0), (9.0, 9.0, 2.0, 4.0)
    facts = {
        "time_s": np.arange(4) / 100.0,
        "base_position": np.add([5, 7, height], [[0, 0, 0], [0.3, 0.4, -0.05], [0, 0, 0.2], [0, 0, 0]]),
        "base_quaternion": turns.as_quat(scalar_first=True),
        "foot_contact": np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 1], [1, 0, 0, 1]], dtype=bool),
        "motor_torque": torque,
        "fall_reason": "",
        "fell": False,
        "faults": (),
        "walked_s": 0.04,
    }  # fmt: skip
    asked = []

    def run_episode(robot: Robot, policy: Any, episode: Any) -> Any:
        asked.append((policy, episode))
        return SimpleNamespace(**facts | changes)

    monkeypatch.setattr(standing, "run_episode", run_episode)
    return standing_test(robot, duration_s=2.5, seed=9), asked[0]


@pytest.fixture
def strong(go1: Robot) -> Robot:
    """go1 with motors that stall at more than their current limit allows."""
    return replace(
        go1, motor=go1.motor._replace(peak_torque=np.full(12, 10.0), stall_torque=np.full(12, 40.0))
    )


def test_sinking_tilt_and_way_are_the_most_of_all_samples(
    monkeypatch: pytest.MonkeyPatch, strong: Robot
) -> None:
    found, (_, episode) = stood(monkeypatch, strong)
    assert (found.sank_m, found.tilt_rad, found.moved_m) == pytest.approx((0.05, 0.3, 0.5))
    assert found.stood_s == 0.04
    assert (episode.duration_s, episode.seed) == (2.5, 9)
    assert not np.any(episode.command_source(1.0))


def test_torques_and_contacts_are_those_once_settled(monkeypatch: pytest.MonkeyPatch, strong: Robot) -> None:
    found, _ = stood(monkeypatch, strong)
    assert found.torque_share[:3] == pytest.approx([0.6, 0.4, 0.0])
    assert found.feet_down.tolist() == [1.0, 0.5, 0.0, 1.0]


@pytest.mark.parametrize(
    ("changes", "reason", "is_up"),
    [
        ({}, "", True),
        ({"fall_reason": "it lies down", "fell": True}, "it lies down", False),
        ({"fell": True}, "the simulation diverged", False),
        ({"faults": ("no reply",)}, "", False),
    ],
)
def test_it_stood_if_it_neither_fell_nor_had_a_fault(
    monkeypatch: pytest.MonkeyPatch, strong: Robot, changes: dict, reason: str, is_up: bool
) -> None:
    found, _ = stood(monkeypatch, strong, **changes)
    assert (found.fall_reason, found.stood) == (reason, is_up)


def test_a_run_that_ended_before_it_stood_has_figures_too(
    monkeypatch: pytest.MonkeyPatch, strong: Robot
) -> None:
    widths = {"time_s": (), "base_position": (3,), "base_quaternion": (4,), "motor_torque": (12,)}
    empty = {name: np.zeros((0, *width)) for name, width in widths.items()}
    found, _ = stood(monkeypatch, strong, **empty, foot_contact=np.zeros((0, 4), bool))
    assert (found.sank_m, found.tilt_rad, found.moved_m) == (0.0, 0.0, 0.0)
    assert (found.torque_share.tolist(), found.feet_down.tolist()) == ([0.0] * 12, [0.0] * 4)


def test_it_is_held_by_the_robots_own_gains(go1: Robot) -> None:
    policy = HoldDefaultPose(go1)
    command = policy.act(None)  # type: ignore[arg-type]
    for part, expected in zip(command, (go1.default_pose, 0.0, go1.kp, go1.kd, 0.0), strict=True):
        np.testing.assert_array_equal(part, np.broadcast_to(expected, 12))
    assert policy.stance() is None


# -- the stand-in robot ------------------------------------------------------------------------------


class FakeBus:
    """Gives one batch at the second tick; keeps what is sent."""

    def __init__(self, frames: Frames) -> None:
        self.frames, self.sent, self.asked = frames, [], []

    def receive(self, now_us: int) -> list[Frames]:
        self.asked.append(now_us)
        return [self.frames] if len(self.asked) == 2 else []

    def send(self, frames: Frames, now_us: int) -> None:
        self.sent.append((now_us, frames.id.tolist()))


def test_serving_carries_frames_both_ways_every_millisecond(monkeypatch: pytest.MonkeyPatch) -> None:
    stop, periods, heard = threading.Event(), [], []

    class Clock:
        def __init__(self, period_us: int) -> None:
            periods.append(period_us)
            self.now_us = 0

        def next_tick(self) -> int:
            self.now_us += 1000
            if self.now_us == 4000:
                stop.set()
            return self.now_us

    wires = SimulatedWires(("a",))
    answer = Frames(np.zeros(1, int), np.array([77]), np.zeros((1, 8), np.uint8), np.array([8]))

    class Body:
        def advance(self, now_us: int) -> None:
            for frames in wires.receive(Side.ROBOT, now_us):
                heard.append((now_us, frames.id.tolist()))
                wires.send(Side.ROBOT, answer, now_us)

    bus = FakeBus(answer._replace(id=np.array([5])))
    monkeypatch.setattr(serve_module, "WallClock", Clock)
    serve(Body(), wires, bus, stop)  # type: ignore[arg-type]
    assert periods == [1000]
    assert bus.asked == [1000, 2000, 3000, 4000]
    assert heard == [(3000, [5])]  # a frame takes 0.135 ms
    assert bus.sent == [(4000, [77])]


def test_the_plant_is_as_asked_and_ends_with_the_context(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    class Bus(FakeBus):
        def __init__(self, interface: str, names: tuple[str, ...], filters: Any) -> None:
            super().__init__(Frames(*np.zeros((4, 0), dtype=int)))
            made.append((interface, names))
            self.closed_with = -1

        def close(self) -> None:
            self.closed_with = sum(thread.name == "robot" for thread in threading.enumerate())
            made.append(self.closed_with)

    monkeypatch.setattr(serve_module, "open_interfaces", Bus)
    with serving(
        go1, "vcan", PlantConfig(sample={"encoder_bias": np.full(12, 0.25)}, motor_timeout_s=0.7)
    ) as body:
        np.testing.assert_array_equal(body._motors._timeout_steps, 700)
        np.testing.assert_array_equal(body._motors.encoder_bias, 0.25)
    assert made == [("vcan", wire(go1).buses), 0]  # closed once nobody uses it


def test_by_default_it_is_go1_with_its_own_motors(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = []

    def refuse(robot: Robot, interface: str, config: PlantConfig) -> None:
        taken.append((robot.name, interface, config))
        raise serve_module.UserError("no such bus")

    monkeypatch.setattr(serve_module, "serving", refuse)
    monkeypatch.setattr("sys.argv", ["serve"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert taken == [("go1", "udp_multicast", PlantConfig())]
