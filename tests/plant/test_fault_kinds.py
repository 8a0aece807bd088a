"""The table of faults and the audit of commands that go with it."""

import json
from dataclasses import replace
from typing import Any

import fault_table
import numpy as np
import pytest
from fault_kinds import KINDS
from fault_kinds.kind import IMPLAUSIBLE_S
from scipy.spatial.transform import Rotation

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.wiring import wire
from footfall.plant.audit import Audit
from footfall.plant.episode import Push
from footfall.plant.injection import mounted
from footfall.robots.description import Robot, available_robots


def test_every_kind_has_a_name_of_its_own_and_a_limit_or_a_reason() -> None:
    titles = [fault_table._title(kind) for kind in KINDS]
    assert len(set(titles)) == len(titles) >= 60
    assert [kind.name for kind in KINDS if kind.within_s is None and not kind.reason] == []


def test_who_may_take_longer_than_100_ms_has_a_reason() -> None:
    assert IMPLAUSIBLE_S == 0.1
    slow = [kind for kind in KINDS if kind.within_s is not None and kind.within_s > IMPLAUSIBLE_S]
    assert len(slow) > 10
    assert [fault_table._title(kind) for kind in slow if not kind.reason] == []


@pytest.mark.parametrize(
    ("title", "final_state", "says", "longest_s"),
    [
        ("quaternion frames lost", "ESTOP", "no new IMU reading (quaternion)", 0.055),
        ("ids of two motors swapped", "ESTOP", "", 0.1),
        ("turned upside down", "FALLING", "tilt", 0.1),
        ("one encoder off by a turn (at the start)", "ESTOP", "1 turn of the joint", 0.02),
    ],
)
def test_a_run_tells_what_was_noticed_when_and_what_went_out(
    title: str, final_state: str, says: str, longest_s: float
) -> None:
    run = fault_table.run_fault(("go1", "go1-flat", title, 5))
    assert run["detected"]
    assert says in run["fault"]
    assert run["final_state"] == final_state
    assert 0.0 < run["seconds"] <= longest_s
    assert run["stiff"] == ("start" not in title)
    assert not run["fell"]
    assert run["torque_over"] < fault_table.ROUNDING
    assert run["outside_rad"] == 0.0
    assert run["rate_share"] < 1.01


@pytest.mark.parametrize(
    ("kind", "says"),
    [
        ("IMU on its side, all its parts alike", "tilt of 1.5"),
        ("robot on its side", "tilt of 1.57 rad is past the limit of 1.05 rad, by the IMU"),
        ("robot upside down", "tilt of 3.1"),
        ("IMU askew by 15 degrees", "the IMU: before the start its acceleration is off its quaternion"),
        ("acceleration in units of g", "gravity by 90%"),
        ("acceleration a fifth too high", "gravity by 20%"),
        ("acceleration reads nothing but zero", "gravity by 100%"),
        ("acceleration frames lost", "no answer from the IMU (acceleration) within 1 s"),
        ("gyro off by 2 rad/s", "still for 0.05 s before it gets stiffness: the IMU's gyro reads 2.0"),
    ],
)
def test_an_imu_that_is_no_good_and_a_robot_that_lies_wrong_never_get_stiffness(kind: str, says: str) -> None:
    """A robot at rest feels 9.81 m/s^2: a fifth more is off by 20 %, 1 instead of 9.81 by 90 %."""
    run = fault_table.run_fault(("go1", "go1-flat", f"{kind} (at the start)", 0))
    assert says in run["fault"]
    assert not run["stiff"]


class TestARun:
    """What it depends on."""

    def test_draws_by_its_kinds_name_whatever_stands_beside_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """The joint whose encoder is off is drawn: the same of the seed in a table of one row."""
        task = ("go1", "go1-flat", "one encoder off by a turn (at the start)", 2)
        run = fault_table.run_fault(task)
        monkeypatch.setattr(fault_table, "KINDS", (fault_table._kind(task[2]),))
        assert fault_table.run_fault(task) == run
        draws = {fault_table._draws(seed, title).random() for seed in (0, 1) for title in ("one", "other")}
        assert len(draws) == 4

    def test_has_a_policy_of_its_own(self) -> None:
        """`step` goes on from where it was: the run before would be seen in the next."""
        assert fault_table._policy("g1", "step") is not fault_table._policy("g1", "step")

    def test_goes_by_the_robots_own_limits(self, go1: Robot) -> None:
        safety = {"tilt_limit_rad": 0.7, "sensors": {"drift_rad": 0.01}}
        own = replace(go1, description=replace(go1.description, safety=safety))
        config = fault_table._config(own)
        assert (config.safety.tilt_limit_rad, config.safety.sensors.drift_rad) == (0.7, 0.01)
        assert (config.stand_s, config.safety.damping_s) == (fault_table.STAND_S, fault_table.DAMPING_S)


def test_every_robot_that_ships_is_tried_with_a_learned_policy_and_a_hand_written_one() -> None:
    of = {
        robot: [policy for other, policy in fault_table.SUBJECTS if other == robot]
        for robot in available_robots()
    }
    assert all(len(policies) == 2 for policies in of.values()), of
    assert [pair for pair, whole in fault_table.SUBJECTS.items() if whole] == [
        ("go1", "go1-flat"),
        ("go1", "mpc"),
    ]


@pytest.mark.parametrize(
    ("title", "says"),
    [
        ("IMU askew by 30 degrees, all its parts alike (at the start)", "the base is tilted by 0.5"),
        ("IMU comes loose and leans by 0.2 rad/s (at the start)", "the base turned by 0.05 rad other than"),
    ],
)
def test_an_imu_that_is_true_of_another_place_is_known_by_the_legs_that_stand(title: str, says: str) -> None:
    """30 degrees are 0.52 rad. Before the robot walks, and nothing else contradicts such an IMU."""
    run = fault_table.run_fault(("go1", "go1-flat", title, 1))
    assert says in run["fault"]
    assert (run["final_state"], run["fell"]) == ("ESTOP", False)
    assert run["seconds"] < 0.5


def test_a_fault_that_nobody_can_notice_ends_in_order() -> None:
    run = fault_table.run_fault(("go1", "go1-flat", "foreign frames on the bus", 5))
    assert not run["detected"]
    assert run["seconds"] is None
    assert run["final_state"] == "IDLE"


class TestAHealthyRun:
    """A fault in it is a false alarm, unless the robot was falling."""

    TASK = ("go1", "go1-flat", False, 0)

    def run(self, monkeypatch: pytest.MonkeyPatch, go1: Robot, push_m_s: float, **safety: Any) -> Any:
        """A second of walking; after 0.3 s of it a push."""
        limited = replace(go1, description=replace(go1.description, safety=safety))
        monkeypatch.setattr(fault_table, "_robot", lambda _: limited)
        monkeypatch.setattr(fault_table, "EPISODE_S", 1.0)
        monkeypatch.setattr(fault_table, "_drawn_push", lambda *_: Push(0.3, (0.0, push_m_s / 2, 0.0)))
        return fault_table.run_healthy(self.TASK)

    def test_a_robot_that_would_have_walked_on_was_not_falling(
        self, monkeypatch: pytest.MonkeyPatch, go1: Robot
    ) -> None:
        """Every walk tilts by more than 2 degrees."""
        run = self.run(monkeypatch, go1, 1.0, tilt_limit_rad=0.03)
        assert "tilt of 0.03 rad" in run["alarm"]
        assert (run["fell"], run["fell_s"]) == (False, None)
        assert 0.0 < run["fault_s"] < 1.0

    def test_a_robot_that_is_thrown_over_was(self, monkeypatch: pytest.MonkeyPatch, go1: Robot) -> None:
        run = self.run(monkeypatch, go1, 8.0)
        assert "tilt of 1.0" in run["fault"]
        assert (run["alarm"], run["fell"]) == ("", True)
        assert 0.3 < run["fault_s"] < run["fell_s"] < run["fault_s"] + 0.5  # 60 degrees, then 70

    def test_a_fall_that_comes_later_excuses_nothing(
        self, monkeypatch: pytest.MonkeyPatch, go1: Robot
    ) -> None:
        """The alarm comes in the first steps, the push after 0.3 s."""
        monkeypatch.setattr(fault_table, "FALL_S", 0.1)
        run = self.run(monkeypatch, go1, 8.0, tilt_limit_rad=0.02)
        assert run["fault_s"] + 0.1 < 0.3 < run["fell_s"]
        assert "tilt of 0.02 rad" in run["alarm"]
        assert not run["fell"]

    def test_one_that_fell_without_a_fault_has_none(
        self, monkeypatch: pytest.MonkeyPatch, go1: Robot
    ) -> None:
        run = self.run(monkeypatch, go1, 8.0, tilt_limit_rad=1.5, sensors={"sunk": 1.0})
        assert (run["fell"], run["fault"], run["fault_s"], run["alarm"]) == (True, "", None, "")
        assert 0.3 < run["fell_s"] < 1.0


class TestAudit:
    """A controller that sends what it should not is caught."""

    @pytest.fixture
    def audit(self, go1: Robot) -> Audit:
        return Audit(go1, wire(go1), 0.002)

    def look(
        self, go1: Robot, audit: Audit, position: np.ndarray, kp: Any, velocity: np.ndarray | None = None
    ) -> None:
        """The robot is in its default pose, at rest unless said otherwise."""
        values = np.zeros((5, 12))
        values[0], values[2] = position, kp
        moves = np.zeros(12) if velocity is None else velocity
        audit.look(open_driver(wire(go1)).command(values), go1.default_pose, moves)

    def test_torque_beyond_a_motor_is_told_as_a_share_of_its_peak(self, go1: Robot, audit: Audit) -> None:
        off = go1.default_pose.copy()
        off[0] += 0.5
        kp = 2.5 * go1.motor.peak_torque[0] / 0.5
        self.look(go1, audit, off, kp)  # asks for 2.5 times the peak
        assert audit.torque_over == pytest.approx(1.5, abs=0.02)
        assert audit.stiff
        self.look(go1, audit, go1.default_pose, kp)
        assert audit.torque_over == pytest.approx(1.5, abs=0.02)  # the worst of all

    def test_a_motor_at_its_no_load_speed_can_only_brake(self, go1: Robot, audit: Audit) -> None:
        """A tenth of its peak is all too much there, in the direction of its motion."""
        spinning, off = np.zeros(12), go1.default_pose.copy()
        spinning[4] = -(go1.motor.no_load_speed * np.ones(12))[4]
        kp = 0.1 * go1.motor.peak_torque[4] / 0.5
        off[4] += 0.5
        self.look(go1, audit, off, kp, spinning)
        assert audit.torque_over == pytest.approx(0.0, abs=1e-9)
        off[4] -= 1.0
        self.look(go1, audit, off, kp, spinning)
        assert audit.torque_over == pytest.approx(0.1, abs=0.005)

    @pytest.mark.parametrize(("end", "by"), [(1, 0.25), (0, -0.25)])
    def test_a_target_outside_the_soft_limits_is_told_in_radians(
        self, go1: Robot, audit: Audit, end: int, by: float
    ) -> None:
        off = go1.default_pose.copy()
        off[2] = go1.soft_limits[end][2] + by
        self.look(go1, audit, off, 1.0)
        assert audit.outside_rad == pytest.approx(0.25, abs=1e-3)

    def test_a_target_of_a_joint_without_stiffness_is_none(self, go1: Robot, audit: Audit) -> None:
        """All but the first are limp, and told to be far away."""
        far, kp = go1.default_pose + 3.0 * (np.arange(12) > 0), 1.0 * (np.arange(12) == 0)
        self.look(go1, audit, go1.default_pose, kp)
        self.look(go1, audit, far, kp)
        assert audit.stiff
        assert (audit.outside_rad, audit.rate_share) == (0.0, 0.0)

    @pytest.mark.parametrize("jump_rad", [0.06, -0.06])
    def test_a_target_that_jumps_is_told_over_the_robots_rate(
        self, go1: Robot, audit: Audit, jump_rad: float
    ) -> None:
        self.look(go1, audit, go1.default_pose, 1.0)
        self.look(go1, audit, go1.default_pose + jump_rad, 1.0)
        self.look(go1, audit, go1.default_pose + jump_rad, 1.0)
        rate = go1.description.target_rate_rad_s
        assert audit.rate_share == pytest.approx(0.06 / 0.002 / rate, rel=0.02)

    def test_a_target_after_damping_is_the_first(self, go1: Robot, audit: Audit) -> None:
        for position, kp in ((0.0, 1.0), (0.0, 0.0), (0.3, 1.0)):
            self.look(go1, audit, go1.default_pose + position, kp)
        assert audit.rate_share == 0.0

    def test_damping_has_no_target(self, go1: Robot, audit: Audit) -> None:
        self.look(go1, audit, go1.default_pose + 9.0, 0.0)
        assert not audit.stiff
        assert audit.outside_rad == 0.0


class TestLooseImu:
    """What an IMU reads that turns about an axis of the body's."""

    SPIN, ANGLE, RATE, DT_S = np.array([0.4, -0.3, 0.7]), 0.5, 0.2, 1e-6

    def read(self, time_s: float, axis: int) -> Inertial:
        """At a time, on a body that spins evenly, where the acceleration is 9.81 m/s^2 up and 2 ahead."""
        body = Rotation.from_euler("ZYX", [1.0, -0.4, 0.2]) * Rotation.from_rotvec(self.SPIN * time_s)
        felt = body.inv().apply([2.0, 0.0, 9.81])
        there = Inertial(self.SPIN.tolist(), felt.tolist(), body.as_quat(scalar_first=True).tolist())
        return mounted(there, axis, self.ANGLE + self.RATE * time_s, self.RATE)

    def turn(self, reading: Inertial) -> Rotation:
        return Rotation.from_quat(reading.quaternion, scalar_first=True)

    @pytest.mark.parametrize("axis", [0, 1, 2])
    def test_all_its_parts_agree(self, axis: int) -> None:
        """Its gyro says how its orientation changes; gravity by its orientation is where it was."""
        now, then = (self.read(time_s, axis) for time_s in (0.3, 0.3 + self.DT_S))
        changed = (self.turn(now).inv() * self.turn(then)).as_rotvec() / self.DT_S
        np.testing.assert_allclose(now.gyro, changed, atol=1e-6)
        np.testing.assert_allclose(self.turn(now).apply(now.acceleration), [2.0, 0.0, 9.81], atol=1e-9)

    def test_it_leans_by_its_angle_in_the_body(self) -> None:
        straight, leaning = (mounted(Inertial([0] * 3, [0] * 3, [1, 0, 0, 0]), 1, a) for a in (0.0, 0.5))
        np.testing.assert_allclose(self.turn(straight).as_rotvec(), [0.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(self.turn(leaning).as_rotvec(), [0.0, 0.5, 0.0], atol=1e-12)


def test_rows_say_which_share_was_in_time_and_what_went_wrong() -> None:
    run = {"robot": "go1", "policy": "go1-flat", "kind": "IMU silent", "seed": 0, "fault": "x"}
    run |= {"detected": True, "seconds": 0.05, "final_state": "ESTOP", "fell": False}
    run |= {"torque_over": 0.0, "outside_rad": 0.0, "rate_share": 0.5, "stiff": True}
    (row,) = fault_table.rows([run, {**run, "seconds": 0.06}])
    assert (row["runs"], row["detected"], row["in_time"]) == (2, 2, 1)
    assert (row["median_s"], row["longest_s"], row["limit_s"]) == (0.055, 0.06, 0.055)
    assert not row["as_expected"]
    (row,) = fault_table.rows([run] * 3)
    assert row["as_expected"]
    (row,) = fault_table.rows([{**run, "torque_over": 0.05}])
    assert not row["as_expected"]
    (row,) = fault_table.rows([{**run, "fell": True, "final_state": "IDLE"}])
    assert (row["idle_after_a_fall"], row["as_expected"]) == (1, False)
    [published] = json.loads(fault_table.table([row], []))["rows"]
    assert (published["as_expected"], published["reason"]) == (False, "missed")
