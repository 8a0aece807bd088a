"""The table of faults."""

import json
from typing import Any

import fault_rows
import fault_runs
import fault_subjects
import healthy_runs
import pytest
from changed_robots import described
from fault_kinds import KINDS
from fault_kinds.kind import IMPLAUSIBLE_S
from fault_subjects import FaultTask, HealthyTask, Subject

from footfall.plant.episode import Push
from footfall.policies.registry import zoo_names
from footfall.robots.description import Robot


@pytest.fixture(autouse=True)
def quickly_standing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Faults in a walk come half a second earlier than in the published table."""
    monkeypatch.setattr(fault_runs, "STAND_S", 0.3)


def test_every_kind_has_its_own_name_and_a_short_limit_or_a_reason() -> None:
    titles = [fault_runs.title_of(kind) for kind in KINDS]
    assert len(set(titles)) == len(titles) >= 60
    slow = [kind for kind in KINDS if kind.within_s is None or kind.within_s > IMPLAUSIBLE_S]
    assert [fault_runs.title_of(kind) for kind in slow if not kind.reason] == []


@pytest.mark.parametrize(
    ("title", "final_state", "message", "longest_s"),
    [
        ("quaternion frames lost", "ESTOP", "no new IMU reading (quaternion)", 0.055),
        ("ids of two motors swapped", "ESTOP", "", 0.1),
        ("turned upside down", "FALLING", "tilt", 0.1),
        ("one encoder off by a turn (at the start)", "ESTOP", "1 turn of the joint", 0.02),
    ],
)
def test_a_run_reports_faults_their_times_and_sent_commands(
    title: str, final_state: str, message: str, longest_s: float
) -> None:
    run = fault_runs.run_fault(FaultTask("go1", "go1-flat", title, 5))
    assert message in run["fault"]
    assert (run["detected"], run["final_state"], run["fell"]) == (True, final_state, False)
    assert 0.0 < run["seconds"] <= longest_s
    assert (run["stiff"], run["outside_rad"]) == ("start" not in title, 0.0)
    assert run["torque_over"] < fault_rows.ROUNDING
    assert run["rate_share"] < 1.01


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("robot on its side", "tilt of 1.57 rad exceeds the limit of 1.05 rad, by the IMU"),
        ("IMU tilted by 15 degrees", "the IMU: at the start its acceleration differs from its quaternion"),
        ("acceleration in units of g", "gravity by 90%"),
        ("acceleration frames lost", "no answer from the IMU (acceleration) within 1 s"),
        ("gyro off by 2 rad/s", "at rest for 0.05 s before it gets stiffness: the IMU's gyro reads 2.0"),
    ],
)
def test_a_faulty_imu_or_a_wrong_posture_prevents_stiffness(kind: str, message: str) -> None:
    """The acceleration of a robot at rest is 9.81 m/s^2: a reading of 1 is off by 90 %."""
    run = fault_runs.run_fault(FaultTask("go1", "go1-flat", f"{kind} (at the start)", 0))
    assert message in run["fault"]
    assert not run["stiff"]


def test_random_draws_depend_on_the_kinds_name_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """The joint with the wrong encoder is drawn; a table of one row draws the same."""
    task = FaultTask("go1", "go1-flat", "one encoder off by a turn (at the start)", 2)
    run = fault_runs.run_fault(task)
    monkeypatch.setattr(fault_runs, "KINDS", (fault_runs.kind_of(task.title),))
    assert fault_runs.run_fault(task) == run
    draws = {fault_runs.draws_of(seed, title).random() for seed in (0, 1) for title in ("one", "other")}
    assert len(draws) == 4


def test_runs_use_the_robots_own_limits(go1: Robot) -> None:
    safety = {"tilt_limit_rad": 0.7, "sensors": {"drift_rad": 0.01}}
    config = fault_runs.config_of(described(go1, safety=safety))
    assert (config.safety.tilt_limit_rad, config.safety.sensors.drift_rad) == (0.7, 0.01)
    assert (config.stand_s, config.safety.damping_s) == (fault_runs.STAND_S, fault_runs.DAMPING_S)


def test_every_learned_policy_that_walks_is_tried() -> None:
    walking = {name for name in zoo_names() if not name.endswith("-getup")}
    assert walking - {each.policy for each in fault_subjects.SUBJECTS} == set()


def test_an_undetectable_fault_ends_in_order() -> None:
    run = fault_runs.run_fault(FaultTask("go1", "go1-flat", "foreign frames on the bus", 5))
    assert (run["detected"], run["seconds"], run["final_state"]) == (False, None, "IDLE")


class TestAHealthyRun:
    """In a run without a fault every alarm is false, unless the robot was falling."""

    TASK = HealthyTask("go1", "go1-flat", "pushed", 0)

    def run(self, monkeypatch: pytest.MonkeyPatch, go1: Robot, push_m_s: float, **safety: Any) -> Any:
        """A run that walks for a second, with a push after 0.3 s."""
        monkeypatch.setattr(healthy_runs, "robot_of", lambda _: described(go1, safety=safety))
        monkeypatch.setattr(healthy_runs, "EPISODE_S", 1.0)
        monkeypatch.setattr(healthy_runs, "_drawn_push", lambda *_: Push(0.3, (0.0, push_m_s / 2, 0.0)))
        return healthy_runs.run_healthy(self.TASK)

    def test_a_robot_that_walks_on_is_not_falling(self, monkeypatch: pytest.MonkeyPatch, go1: Robot) -> None:
        """Every walk tilts by more than 2 degrees."""
        run = self.run(monkeypatch, go1, 1.0, tilt_limit_rad=0.03)
        assert "tilt of 0.03 rad" in run["alarm"]
        assert (run["fell"], run["fell_s"]) == (False, None)
        assert 0.0 < run["fault_s"] < 1.0

    def test_a_robot_that_is_thrown_over_is_falling(
        self, monkeypatch: pytest.MonkeyPatch, go1: Robot
    ) -> None:
        run = self.run(monkeypatch, go1, 8.0)
        assert "tilt of 1.0" in run["fault"]
        assert (run["alarm"], run["fell"]) == ("", True)
        assert 0.3 < run["fault_s"] < run["fell_s"] < run["fault_s"] + 0.5  # 60 degrees, then 70

    def test_an_alarm_before_a_fall_is_false(self, monkeypatch: pytest.MonkeyPatch, go1: Robot) -> None:
        """The alarm comes in the first steps, the push after 0.3 s."""
        monkeypatch.setattr(healthy_runs, "FALL_S", 0.1)
        run = self.run(monkeypatch, go1, 8.0, tilt_limit_rad=0.02)
        assert run["fault_s"] + 0.1 < 0.3 < run["fell_s"]
        assert "tilt of 0.02 rad" in run["alarm"]
        assert not run["fell"]


def test_rows_have_the_share_in_time_and_the_failures() -> None:
    run = {"robot": "go1", "policy": "go1-flat", "kind": "IMU silent", "seed": 0, "fault": "x"}
    run |= {"detected": True, "seconds": 0.05, "final_state": "ESTOP", "fell": False}
    run |= {"torque_over": 0.0, "outside_rad": 0.0, "rate_share": 0.5, "stiff": True}
    (row,) = fault_rows.rows([run, {**run, "seconds": 0.06}])
    assert (row["runs"], row["detected"], row["in_time"]) == (2, 2, 1)
    assert (row["median_s"], row["longest_s"], row["limit_s"]) == (0.055, 0.06, 0.055)
    assert not row["as_expected"]
    for changes, expected in (
        ({}, True),
        ({"torque_over": 0.05}, False),
        ({"stiff_when_damped": True}, False),
    ):
        (row,) = fault_rows.rows([run | changes] * 3)
        assert row["as_expected"] is expected
    assert len(fault_rows.rows([run, {**run, "ground": "rough", "policy": "go1-rough"}])) == 2
    (row,) = fault_rows.rows([{**run, "fell": True, "final_state": "IDLE"}])
    assert (row["idle_after_a_fall"], row["as_expected"]) == (1, False)
    [published] = json.loads(fault_rows.table([row], []))["rows"]
    assert (published["as_expected"], published["reason"]) == (False, "missed")


def test_a_robot_that_gets_up_is_damped_after_a_fault() -> None:
    run = fault_runs.run_fault(FaultTask("go1", "go1-flat", "one motor silent, getting up", 1))
    assert run["detected"]
    assert "no reply from" in run["fault"]
    assert run["seconds"] < 0.06
    assert (run["final_state"], run["stiff"], run["stiff_when_damped"]) == ("ESTOP", True, False)


def test_on_rough_ground_the_ground_is_the_scenarios(go1: Robot) -> None:
    rough = Subject("go1", "go1-rough-blind", "rough")
    low, high = (fault_subjects.ground_of(rough, seed) for seed in (0, 3))
    assert fault_subjects.ground_of(Subject("go1", "go1-flat"), 0) is None
    assert low is not None
    assert high is not None
    assert abs(low.heights).max() < 0.5 * abs(high.heights).max()
    run = fault_runs.run_fault(FaultTask("go1", "go1-rough", "IMU silent", 3, "rough"))
    assert (run["detected"], run["ground"]) == (True, "rough")
