"""A simulated trial: pushes, recording, falls, and the settings of an episode."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call

import numpy as np
import pytest
from changed_robots import described
from deploy_policies import FailingPolicy, Hold

from footfall.deploy.bus import BusStatistics
from footfall.deploy.config import DeployConfig
from footfall.deploy.modes import Mode
from footfall.deploy.session import SessionResult
from footfall.plant.episode import Episode, Push, Trial, run_episode
from footfall.plant.ground_truth import Truth
from footfall.robots.description import Robot


class FakeBody:
    """Counts its calls; each ground truth differs."""

    def __init__(self) -> None:
        self.model = SimpleNamespace(nq=19)
        self.notes = ("a plant's note",)
        self.pushes: list[tuple[float, ...]] = []
        self.looks = 0
        self.reason: str | None = None
        self.push, self.fall, self.diverged = self.pushes.append, lambda _: self.reason, lambda: False
        self.take_power = lambda: SimpleNamespace(electrical=3.0, mechanical=2.0, positive=2.5)

    def snapshot(self) -> int:
        self.looks += 1
        return self.looks

    def truths(self, snapshots: Sequence[int]) -> Any:
        k = np.array(snapshots, dtype=float)
        return Truth(
            **dict.fromkeys(Truth._fields, np.column_stack([k, k, k]))
            | {
                "base_position": np.column_stack([0.25 * k, 0.0 * k, 9.0 + 0.0 * k]),
                "base_velocity": np.column_stack([k, 2 * k, 3 * k]),
            }
        )


ENDED = {"final_state": "IDLE", "faults": (), "recoveries": (), "missing_in_log": ""}
TIMES = {"walked_s": 1.0, "run_s": 2.0, "wall_s": 3.0, "compute_ms": np.zeros(1), "timing": {}}
OUTCOME = SessionResult(**ENDED, **TIMES, buses=(BusStatistics("can0"),), notes=("a loop's note",))


def trial_of(go1: Robot, watch: Any = None, **episode: Any) -> tuple[Trial, FakeBody, Any]:
    """A trial, and the parts of its robot and control loop that it uses.

    A robot that fell neither stops nor lies down first.
    """
    settings = Episode(command_source=lambda _: np.zeros(3), duration_s=1.0, **episode)
    orders = {"requested_command": np.array([0.1, 0.2, 0.3]), "target": np.array([5.0]), "finish": Mock()}
    walking = {"state": SimpleNamespace(mode=Mode.WALKING), "walking_s": 0.0}
    loop = SimpleNamespace(**orders, **walking, estimate=(np.array([7.0, 8.0, 9.0]), 0.31))
    body = FakeBody()
    return Trial(go1, body, settings, watch), body, loop  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "value"),
    [("seed", -1), ("charge", 1.1), ("charge", np.nan), ("record_rate_hz", 0.0), ("record_rate_hz", np.nan)],
)
def test_settings_out_of_range_are_refused_by_name(go1: Robot, field: str, value: float) -> None:
    with pytest.raises(ValueError, match=field):
        trial_of(go1, **{field: value})


@pytest.mark.parametrize(
    ("time_s", "delta"), [(-1.0, (1, 0, 0)), (np.nan, (1, 0, 0)), (0.1, (1, 0)), (0.1, (np.inf, 0, 0))]
)
def test_a_push_is_three_finite_numbers_at_a_time_of_the_walk(time_s: float, delta: Any) -> None:
    with pytest.raises(ValueError, match="must be"):
        Push(time_s, delta)


def test_a_trial_records_at_the_record_rate_while_the_robot_walks(go1: Robot) -> None:
    watch = Mock()
    trial, body, loop = trial_of(go1, watch, record_rate_hz=40.0)
    assert np.isnan(trial.velocity()).all()
    loop.state.mode = Mode.STANDING
    trial.tick(loop)
    assert body.looks == 0
    loop.state.mode = Mode.WALKING
    for tick in range(51):
        loop.walking_s = tick * 0.002
        trial.tick(loop)
    assert watch.call_args_list == [call(loop, body)] * 52
    trace = trial.trace(OUTCOME)
    np.testing.assert_allclose(trace.time_s, [0.0, 0.026, 0.05, 0.076, 0.1])
    assert trial.velocity().tolist() == [5.0, 10.0, 15.0]
    np.testing.assert_array_equal(trace.base_velocity[:, 0], [1, 2, 3, 4, 5])
    assert (trace.command.tolist(), trace.joint_target.tolist()) == ([[0.1, 0.2, 0.3]] * 5, [[5.0]] * 5)
    np.testing.assert_array_equal(trace.estimated_velocity[-1], [7, 8, 9])
    assert trace.estimated_height.tolist() == [0.31] * 5
    assert (trace.electrical_power[0], trace.mechanical_power[0], trace.positive_power[0]) == (3, 2, 2.5)
    assert trace.record_rate_hz == 40.0
    np.testing.assert_allclose(trace.mean_velocity, [3.0, 6.0, 9.0])
    assert trace.distance_m == pytest.approx(1.0)
    assert trace.notes == ("a loop's note", "a plant's note")
    assert (trace.fell, trace.fall_reason, trace.final_state, trace.faults) == (False, "", "IDLE", ())
    loop.finish.assert_not_called()


@pytest.mark.parametrize("record", [True, False])
def test_every_sample_of_a_long_walk_counts_once(go1: Robot, record: bool) -> None:
    trial, _, loop = trial_of(go1, record_rate_hz=500.0, record=record)
    for tick in range(100):
        loop.walking_s = 0.002 * tick
        trial.tick(loop)
    trace = trial.trace(OUTCOME)
    np.testing.assert_array_equal(trace.base_velocity[:, 0], np.arange(1, 101) if record else [])
    np.testing.assert_allclose(trace.mean_velocity, [50.5, 101.0, 151.5])
    assert trace.distance_m == pytest.approx(99 * 0.25)


def test_pushes_come_once_each_at_the_first_tick_of_their_time(go1: Robot) -> None:
    pushes = (Push(0.03, (3.0, 0.0, 0.0)), Push(0.01, (1.0, 0.0, 0.0)), Push(0.01, (2.0, 0.0, 0.0)))
    trial, body, loop = trial_of(go1, pushes=pushes)
    seen = []
    for now_s in (0.0, 0.008, 0.01, 0.012, 0.028, 0.031, 0.04):
        loop.walking_s = now_s
        trial.tick(loop)
        seen.append([delta[0] for delta in body.pushes])
    assert seen == [[], [], [1, 2], [1, 2], [1, 2], [1, 2, 3], [1, 2, 3]]


def test_a_trial_without_a_record_still_measures_and_detects_falls(go1: Robot) -> None:
    trial, body, loop = trial_of(go1, record=False)
    for tick in range(3):
        loop.walking_s = 0.01 * tick
        trial.tick(loop)
    body.reason = "it lies down"
    loop.walking_s = 0.03
    trial.tick(loop)
    loop.finish.assert_called_once_with(skip_lie_down=True)
    trace = trial.trace(OUTCOME)
    assert trace.distance_m == pytest.approx(0.75)
    assert (trace.fell, trace.fall_reason, trace.final_state) == (True, "it lies down", "FALLING")
    widths = {
        (): ("time_s", "electrical_power", "mechanical_power", "positive_power", "estimated_height"),
        (3,): ("command", "base_position", "base_velocity", "base_angular_velocity", "estimated_velocity"),
        (4,): ("base_quaternion", "foot_contact", "foot_force"),
        (12,): ("joint_position", "joint_velocity", "motor_torque", "joint_target"),
        (19,): ("qpos",),
        (4, 3): ("foot_position", "foot_velocity"),
    }
    for width, names in widths.items():
        for name in names:
            values = getattr(trace, name)
            assert values.shape == (0, *width), name
            assert values.dtype == (bool if name == "foot_contact" else float)
    assert (trace.legs_touch.shape, trace.legs_touch.dtype) == ((0,), bool)


def test_a_fall_that_the_supervisor_noticed_has_its_reason(go1: Robot) -> None:
    trial, *_ = trial_of(go1)
    trace = trial.trace(replace(OUTCOME, final_state="FALLING", faults=("tilt of 1.2 rad", "later")))
    assert (trace.fell, trace.fall_reason) == (True, "tilt of 1.2 rad")
    stopped = trial.trace(replace(OUTCOME, final_state="ESTOP", faults=("no reply",)))
    assert (stopped.fell, stopped.fall_reason) == (False, "")


COMMAND = np.array([0.4, 0.0, 0.1])


@pytest.fixture
def held(go1: Robot) -> Robot:
    """A robot that cannot stand still: held up, it steps in place, is released, and is held at the end."""
    return described(go1, held_start=True)


def test_a_held_robot_does_not_sink_until_it_is_released(held: Robot, go1: Robot) -> None:
    def walked_s(robot: Robot) -> float:
        zeros = np.zeros(12)
        limp = FailingPolicy(robot, 0.0, lambda command: command._replace(kp=zeros, kd=zeros))
        episode = Episode(lambda _: COMMAND, 1.5, config=DeployConfig(in_place_s=0.6))
        return run_episode(robot, limp, episode).walked_s

    assert 0.0 < walked_s(go1) < 0.5
    assert 0.6 < walked_s(held) < 1.0


def test_a_held_robot_steps_in_place_at_first_and_before_the_end(held: Robot) -> None:
    policy, seen = Hold(held), []
    episode = Episode(lambda _: COMMAND, 1.0, config=DeployConfig(in_place_s=0.5, stop_s=0.3))
    trace = run_episode(held, policy, episode, lambda loop, _: seen.append((loop.state.mode, loop.held_up)))
    assert trace.final_state == Mode.IDLE
    commanded_s = [inputs.time_s for inputs in policy.seen if np.any(inputs.command != 0.0)]
    times_s = (commanded_s[0], commanded_s[-1], policy.seen[-1].time_s)
    assert times_s == pytest.approx((0.5, 1.0, 1.3), abs=0.021)
    assert list(dict.fromkeys(seen))[1:] == [
        (Mode.STANDING, True),
        (Mode.WALKING, True),
        (Mode.WALKING, False),
        (Mode.STOPPING, True),
        (Mode.RELEASING, False),
    ]
