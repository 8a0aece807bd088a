"""A simulated trial: pushes, recording, falls, and the settings of an episode."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from footfall.deploy.bus import BusStatistics
from footfall.deploy.modes import Mode
from footfall.deploy.session import SessionResult
from footfall.plant.episode import Episode, Push, Trial
from footfall.robots.description import Robot


class FakeBody:
    """Counts its calls; each ground truth differs."""

    def __init__(self) -> None:
        self.model = SimpleNamespace(nq=19)
        self.notes = ("a plant's note",)
        self.pushes: list[tuple[float, ...]] = []
        self.looks = 0
        self.reason: str | None = None
        self.lost = False

    def truth(self) -> Any:
        self.looks += 1
        k = float(self.looks)
        names = (
            "base_quaternion",
            "base_angular_velocity",
            "joint_position",
            "joint_velocity",
            "motor_torque",
        )
        rest = dict.fromkeys((*names, "foot_position", "foot_velocity", "foot_force", "qpos"), np.full(3, k))
        rest["foot_position"] = np.full((1, 3), k)
        values = {
            "base_position": np.array([0.25 * k, 0.0, 9.0]),
            "base_velocity": np.array([k, 2 * k, 3 * k]),
            "foot_contact": np.array([True]),
            "legs_touch": k > 1,
            **rest,
        }
        return SimpleNamespace(**values, _asdict=lambda: values)

    def take_power(self) -> Any:
        return SimpleNamespace(electrical=3.0, mechanical=2.0, positive=2.5)

    def push(self, delta: tuple[float, float, float]) -> None:
        self.pushes.append(delta)

    def fall(self) -> str | None:
        return self.reason

    def diverged(self) -> bool:
        return self.lost


class FakeLoop:
    """The part of a control loop that a trial uses."""

    def __init__(self) -> None:
        self.state = SimpleNamespace(mode=Mode.WALKING)
        self.walking_s = 0.0
        self.estimate = np.array([7.0, 8.0, 9.0]), 0.31
        self.requested_command = np.array([0.1, 0.2, 0.3])
        self.target = np.array([5.0])
        self.finished = 0

    def finish(self, skip_lie_down: bool) -> None:
        assert skip_lie_down  # a robot that fell neither stops nor lies down first
        self.finished += 1


OUTCOME = SessionResult(
    final_state="IDLE",
    faults=(),
    walked_s=1.0,
    run_s=2.0,
    wall_s=3.0,
    compute_ms=np.zeros(1),
    timing={},
    buses=(BusStatistics("can0"),),
    notes=("a loop's note",),
    recoveries=(),
    missing_in_log="",
)


def trial_of(go1: Robot, watch: Any = None, **episode: Any) -> tuple[Trial, FakeBody, FakeLoop]:
    body = FakeBody()
    settings = Episode(command_source=lambda _: np.zeros(3), duration_s=1.0, **episode)
    return Trial(go1, body, settings, watch), body, FakeLoop()  # type: ignore[arg-type]


class TestTrial:
    def test_a_trial_records_at_the_record_rate_while_the_robot_walks(self, go1: Robot) -> None:
        watched = []
        trial, body, loop = trial_of(
            go1, lambda loop, body: watched.append((loop, body)), record_rate_hz=40.0
        )
        assert np.isnan(trial.velocity()).all()
        loop.state.mode = Mode.STANDING
        trial.tick(loop)  # type: ignore[arg-type]
        assert body.looks == 0
        loop.state.mode = Mode.WALKING
        for tick in range(51):
            loop.walking_s = tick * 0.002
            trial.tick(loop)  # type: ignore[arg-type]
        assert watched == [(loop, body)] * 52
        trace = trial.trace(OUTCOME)
        np.testing.assert_allclose(trace.time_s, [0.0, 0.026, 0.05, 0.076, 0.1])
        assert trial.velocity().tolist() == [5.0, 10.0, 15.0]
        np.testing.assert_array_equal(trace.base_velocity[:, 0], [1, 2, 3, 4, 5])
        np.testing.assert_array_equal(trace.command, np.tile([0.1, 0.2, 0.3], (5, 1)))
        np.testing.assert_array_equal(trace.joint_target, np.full((5, 1), 5.0))
        np.testing.assert_array_equal(trace.estimated_velocity[-1], [7, 8, 9])
        assert trace.estimated_height.tolist() == [0.31] * 5
        assert (trace.electrical_power[0], trace.mechanical_power[0], trace.positive_power[0]) == (3, 2, 2.5)
        assert trace.record_rate_hz == 40.0
        np.testing.assert_allclose(trace.mean_velocity, [3.0, 6.0, 9.0])
        assert trace.distance_m == pytest.approx(1.0)
        assert trace.notes == ("a loop's note", "a plant's note")
        assert (trace.fell, trace.fall_reason, trace.final_state, trace.faults) == (False, "", "IDLE", ())
        assert loop.finished == 0

    def test_pushes_come_once_each_at_the_first_tick_of_their_time(self, go1: Robot) -> None:
        pushes = (Push(0.03, (3.0, 0.0, 0.0)), Push(0.01, (1.0, 0.0, 0.0)), Push(0.01, (2.0, 0.0, 0.0)))
        trial, body, loop = trial_of(go1, pushes=pushes)
        seen = []
        for now_s in (0.0, 0.008, 0.01, 0.012, 0.028, 0.031, 0.04):
            loop.walking_s = now_s
            trial.tick(loop)  # type: ignore[arg-type]
            seen.append([delta[0] for delta in body.pushes])
        assert seen == [[], [], [1, 2], [1, 2], [1, 2], [1, 2, 3], [1, 2, 3]]

    def test_a_trial_without_a_record_still_measures_and_detects_falls(self, go1: Robot) -> None:
        trial, body, loop = trial_of(go1, record=False)
        for tick in range(3):
            loop.walking_s = 0.01 * tick
            trial.tick(loop)  # type: ignore[arg-type]
        body.reason = "it lies down"
        loop.walking_s = 0.03
        trial.tick(loop)  # type: ignore[arg-type]
        assert loop.finished == 1
        trace = trial.trace(OUTCOME)
        assert trace.distance_m == pytest.approx(0.75)
        assert (trace.fell, trace.fall_reason, trace.final_state) == (True, "it lies down", "FALLING")
        widths = {
            "time_s": (), "command": (3,), "base_position": (3,), "base_quaternion": (4,),
            "base_velocity": (3,), "base_angular_velocity": (3,), "joint_position": (12,),
            "joint_velocity": (12,), "motor_torque": (12,), "joint_target": (12,), "foot_position": (4, 3),
            "foot_velocity": (4, 3), "foot_contact": (4,), "foot_force": (4,), "qpos": (19,),
            "estimated_velocity": (3,), "estimated_height": (), "electrical_power": (),
            "mechanical_power": (), "positive_power": (), "legs_touch": (),
        }  # fmt: skip
        for name, width in widths.items():
            assert getattr(trace, name).shape == (0, *width), name
            assert getattr(trace, name).dtype == (bool if name in ("foot_contact", "legs_touch") else float)

    def test_a_fall_that_the_supervisor_noticed_has_its_reason(self, go1: Robot) -> None:
        trial, *_ = trial_of(go1)
        trace = trial.trace(replace(OUTCOME, final_state="FALLING", faults=("tilt of 1.2 rad", "later")))
        assert (trace.fell, trace.fall_reason) == (True, "tilt of 1.2 rad")
        stopped = trial.trace(replace(OUTCOME, final_state="ESTOP", faults=("no reply",)))
        assert (stopped.fell, stopped.fall_reason) == (False, "")
