"""The supervisor as a state machine: which signal leads from which mode to which; its rules as documented."""

import math
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from footfall.deploy.command_source import Stop
from footfall.deploy.modes import DAMPED, MOVING, Mode
from footfall.deploy.rules import rules, table
from footfall.deploy.safety import PROGRESS, SafetyConfig, State, advance
from footfall.deploy.safety_checks import CHECKS, SIGNAL_CHECKS
from footfall.deploy.sensor_checks.table import BODY_CHECKS, JOINT_CHECKS
from footfall.deploy.signals import Implausible, ImuSignals, MotorSignals, Signals

PAGE = (Path(__file__).parents[2] / "docs/safety.md").read_text(encoding="utf-8")
CONFIG = SafetyConfig()
FAULTLESS = Signals(5.0, MotorSignals(0.002, "FR_hip_joint (can0, id 1)"), ImuSignals(0.002, 0.1, "gyro"))
N, C, S, W, P = Mode.IDLE, Mode.CHECKING, Mode.STANDING, Mode.WALKING, Mode.STOPPING
L, R, U, E, F = Mode.LOWERING, Mode.RELEASING, Mode.RECOVERING, Mode.ESTOP, Mode.FALLING
LATE = {"motors.silence_s": 0.062, "time.pause_s": 0.06}


def changed(changes: dict[str, Any]) -> Signals:
    """Faultless signals with some replaced, by 'field' or 'group.field'."""
    signals = FAULTLESS
    for path, value in changes.items():
        group, _, name = path.rpartition(".")
        change = {group: getattr(signals, group)._replace(**{name: value})} if group else {name: value}
        signals = signals._replace(**change)
    return signals


def following(state: State, changes: dict[str, Any]) -> State:
    """The state a tick after a state, with faultless signals except these."""
    return advance(state, changed(changes), CONFIG)


def after(mode: Mode, changes: dict[str, Any], since_s: float = 4.0) -> State:
    """The state a tick after a mode, with faultless signals except these."""
    return following(State(mode, since_s), changes)


# For each signal the next mode of a robot that can lie down, in IDLE, CHECKING, STANDING, WALKING, STOPPING,
# LOWERING and RECOVERING: the mode stays (-), or changes to ESTOP (E), FALLING (F) or LOWERING (L). In IDLE
# the robot is ready to stand, so a fault of STANDING counts, too.
TABLE: list[tuple[dict[str, Any], str, str]] = [
    ({"motors.silence_s": 0.06}, "no reply from FR_hip_joint (can0, id 1) for 50 ms", "-EEEEEE"),
    ({"imu.silence_s": 0.06}, "no new IMU reading (gyro) for 50 ms", "-EEEEEE"),
    (LATE | {"policy.step_s": 0.06}, "the policy ran late", "-EEEEEE"),
    (LATE, "the loop paused for 60 ms", "-EEEEEE"),
    ({"motors.silence_s": 0.09, "time.pause_s": 0.01, "policy.step_s": 0.01}, "no reply from", "-EEEEEE"),
    ({"motors.error": "motor x reports y"}, "motor x reports y", "EEEEEEE"),
    ({"imu.tilt_rad": 1.06}, "tilt of 1.06 rad exceeds", "FFFFFF-"),
    ({"time.pause_s": 0.13}, "the loop paused for 130 ms", "EEEEEEE"),
    ({"time.skipped_share": 0.26}, "26% of the last second's ticks", "EEEEEEE"),
    ({"bus.fault": "bus can2 is bus-off"}, "bus can2 is bus-off", "EEEEEEE"),
    ({"bus.frames_refused": 3}, "bus overflow: 3 frames refused", "EEEEEEE"),
    ({"start.first_pose": "x reads 4.48 rad"}, "x reads 4.48 rad", "E------"),
    ({"start.not_ready": "motor x is off"}, "", "-------"),
    ({"implausible": Implausible("x is hot", E)}, "x is hot", "EEEEEEE"),
    ({"implausible": Implausible("x misses commands", L)}, "x misses commands", "E-LLL-E"),
    ({"implausible": Implausible("x has sunk", F)}, "x has sunk", "FFFFFF-"),
    ({"wiring.fault": "plugs are exchanged", "wiring.due": True}, "plugs are exchanged", "EE-----"),
    ({"stop": Stop("stopped by x", damp=True)}, "stopped by x", "EEEEEEE"),
    ({"stop": Stop("stopped by x")}, "stopped by x", "EELLLLE"),
    ({"battery": "the battery is empty"}, "the battery is empty", "EELLL-E"),
    ({"policy.step_s": 0.11}, "one step took 110 ms", "E-EEE-E"),
    ({"policy.step_s": math.inf}, "no decision within 70 ms", "E-EEE-E"),
    ({"policy.late_steps": 5}, "5 steps in a row", "E-LLL-E"),
    ({"policy.error": "the policy failed: x"}, "the policy failed: x", "E-LLL-E"),
    ({"recovery.tried_s": 6.0, "start.not_ready": "motor x is off"}, "not standing 6 s after", "------F"),
    ({"policy.command_finite": False}, "is not finite", "E-LLL-E"),
]
FAULT_MODES = {"E": E, "F": F, "L": L}
STARTED = {"now_s": 0.5}  # before `start_timeout_s`


def columns(row: str) -> list[tuple[Mode, str]]:
    """The modes of a row of the table, with their initials."""
    return list(zip((N, C, S, W, P, L, U), row, strict=True))


class TestTable:
    @pytest.mark.parametrize(("changes", "fault", "row"), TABLE)
    def test_each_signal_leads_to_its_mode(self, changes: dict[str, Any], fault: str, row: str) -> None:
        """A robot that can lie down does so after a fault of its policy; one that cannot is damped."""
        for mode, initial in columns(row):
            signals, leads_to = changes | (STARTED if mode is N else {}), FAULT_MODES.get(initial, mode)
            assert after(mode, signals).mode is (E if leads_to is L and mode is not L else leads_to), mode
            state = after(mode, signals | {"end.may_lie": True})
            assert (state.mode, len(state.faults)) == (leads_to, initial != "-"), mode
            assert all(fault in each and "\n" not in each for each in state.faults)
        for mode in DAMPED:  # latched until the damping ends
            assert after(mode, changes, since_s=4.9) == State(mode, 4.9)

    def test_the_table_has_a_row_for_every_rule_except_the_time_to_start(self) -> None:
        """In every mode in which a rule counts, its row leads to a fault."""
        for check in CHECKS[1:]:
            rows = [row for changes, _, row in TABLE if check.find(changed(changes), CONFIG)]
            assert rows, check.quantity
            for row in rows:
                faulty = {mode for mode, initial in columns(row) if initial != "-"}
                assert faulty >= set(check.modes), check.quantity

    def test_a_fault_of_the_policy_changes_nothing_while_lying_down(self) -> None:
        changes = {"policy.error": "x", "end.may_lie": True}
        state = after(W, changes)
        assert following(state, changes | {"now_s": 6.0}) == state
        lies = following(state, changes | {"now_s": 7.0, "posture_done": True})
        assert lies == State(E, 7.0, state.faults)

    def test_a_stop_during_lying_down_is_latched_and_does_not_interrupt(self) -> None:
        stopped = {"stop": Stop("stopped by x"), "end.may_lie": True}
        state = after(L, stopped)
        assert state == following(state, stopped) == State(L, 4.0, ("stopped by x",))
        assert following(state, stopped | {"posture_done": True}) == State(E, 5.0, ("stopped by x",))

    def test_a_fault_is_latched_precedes_a_request_to_end_and_follows_older_faults(self) -> None:
        for mode in (F, E):
            state, final = State(mode, 4.9, ("why",)), State(mode, 6.0, ("why",), over=True)
            assert following(state, {}) == state
            assert following(state, {"now_s": 6.0}) == following(final, {"now_s": 99.0}) == final
        state = following(State(W, 4.0, ("earlier",)), {"imu.tilt_rad": 2.0, "end.finish": True})
        assert (state.mode, state.since_s, state.faults[0], len(state.faults)) == (F, 5.0, "earlier", 2)


class TestStart:
    def test_a_silent_part_is_named_after_the_start_timeout(self) -> None:
        rows: list[tuple[dict[str, Any], str]] = [
            ({"motors.silence_s": 1e9}, "no answer from FR_hip_joint (can0, id 1) within 1 s"),
            ({"imu.silence_s": 1e9}, "no answer from the IMU (gyro) within 1 s"),
            ({"motors.silence_s": 1e8, "imu.silence_s": 1e9}, "no answer from FR_hip_joint"),
            ({"start.not_ready": "motor x is off"}, "motor x is off"),
        ]
        for changes, fault in rows:
            assert after(N, changes | {"now_s": 0.999 * CONFIG.start_timeout_s}).mode is N
            state = after(N, changes | {"now_s": CONFIG.start_timeout_s})
            assert (state.mode, fault in state.faults[0]) == (E, True)

    def test_a_robot_that_is_ready_stands_up_unless_a_bus_has_a_fault(self) -> None:
        """The fault of a bus precedes silent motors, or its reason would be missing."""
        assert after(N, STARTED) == State(S, 0.5)
        for fault in ({"bus.fault": "bus can2 is bus-off"}, {"bus.frames_refused": 3}):
            assert after(N, STARTED | {"motors.silence_s": 9e9} | fault).mode is E


# Each request in each mode, and the mode to which it leads a robot that can lie down.
REQUESTS: list[tuple[Mode, dict[str, Any], Mode]] = [
    (S, {}, S), (S, {"posture_done": True}, W), (P, {}, P), (P, {"end.stopped": True}, L), (L, {}, L),
    (L, {"posture_done": True}, R), (L, {"end.skip_lie_down": True}, R),
    (N, {"end.finish": True} | STARTED, R), (S, {"end.finish": True}, L), (W, {"end.finish": True}, P),
    (P, {"end.finish": True}, P), (L, {"end.finish": True}, L),
    (W, {"end.finish": True, "end.skip_lie_down": True}, R),
    (P, {"end.finish": True, "end.skip_lie_down": True}, R),
    (N, {"end.finish": True, "end.may_lie": False} | STARTED, R),
    (S, {"end.finish": True, "end.may_lie": False}, R),
    (W, {"end.finish": True, "end.may_lie": False}, R),
    (W, {"end.finish": True, "end.may_lie": False, "end.caught": True}, P),
    (P, {"end.stopped": True, "end.may_lie": False, "end.caught": True}, R),
]  # fmt: skip


class TestProgress:
    @pytest.mark.parametrize(("mode", "changes", "leads_to"), REQUESTS)
    def test_each_mode_leads_to_the_next(self, mode: Mode, changes: dict[str, Any], leads_to: Mode) -> None:
        since_s = 4.0 if leads_to is mode else changes.get("now_s", 5.0)
        assert after(mode, {"end.may_lie": True} | changes) == State(leads_to, since_s)

    def test_lying_down_after_a_fault_keeps_it_and_release_ends_idle_after_damping(self) -> None:
        assert following(State(L, 4.0, ("why",)), {"end.skip_lie_down": True}) == State(E, 5.0, ("why",))
        assert not after(R, {}, since_s=5.0 - 0.5 * CONFIG.damping_s).over
        assert after(R, {}, since_s=5.0 - CONFIG.damping_s) == State(N, 5.0, over=True)


LIES = {"recovery.allowed": True, "recovery.ready": True, "imu.tilt_rad": 2.0}  # still, with consent
FELL, LIMITS = State(F, 4.0, ("fell",)), CONFIG.recovery


class TestGettingUp:
    def test_a_robot_that_lies_still_gets_up_with_consent_once_it_was_damped(self) -> None:
        fallen = FELL._replace(tries=1)
        assert following(fallen, LIES) == State(U, 5.0, ("fell",), tries=2)
        for changes in ({"now_s": 3.9 + CONFIG.damping_s}, {"recovery.ready": False}):
            assert following(fallen, LIES | changes) == fallen

    def test_without_consent_or_tries_the_robot_stays_down(self) -> None:
        assert following(FELL, LIES | {"recovery.allowed": False}) == State(F, 5.0, ("fell",), over=True)
        assert following(FELL._replace(tries=LIMITS.tries), LIES).over

    def test_a_robot_that_never_rests_or_has_a_fault_stays_down_with_a_second_fault(self) -> None:
        state = following(FELL, LIES | {"recovery.ready": False, "now_s": 4.0 + LIMITS.wait_s})
        assert (state.mode, state.over, len(state.faults)) == (F, True, 2)
        assert following(FELL, LIES | {"motors.error": "x"}) == State(E, 5.0, ("fell", "x"))

    def test_standing_up_clears_the_fault_and_walking_clears_the_tries(self) -> None:
        up = State(U, 4.0, ("fell",), tries=2)
        assert following(up, {"recovery.stands": True}) == State(S, 5.0, tries=2)
        walks = following(State(S, 4.0, tries=2), {"posture_done": True})
        assert walks == State(W, 5.0, tries=2)
        for walked_s, tries in ((0.9 * LIMITS.same_fall_s, 2), (1.1 * LIMITS.same_fall_s, 0)):
            assert following(walks, {"imu.tilt_rad": 2.0, "now_s": 5.0 + walked_s}).tries == tries

    def test_the_end_of_the_run_leaves_the_robot_down(self) -> None:
        up = State(U, 4.0, ("fell",), tries=1)
        assert following(up, {"end.finish": True}) == up._replace(mode=F, since_s=5.0)


def test_a_limit_itself_passes_and_the_guard_waits_for_the_longer_limit() -> None:
    for name, limit in (
        ("motors.silence_s", CONFIG.silence_timeout_s), ("imu.silence_s", CONFIG.silence_timeout_s),
        ("imu.tilt_rad", CONFIG.tilt_limit_rad), ("policy.step_s", CONFIG.late_limit_s),
        ("time.pause_s", CONFIG.pause_limit_s), ("time.skipped_share", CONFIG.skipped_share),
    ):  # fmt: skip
        assert [after(W, {name: share * limit}).mode is W for share in (1.0, 1.001)] == [True, False]
        if "silence" in name:
            assert [after(N, STARTED | {name: share * limit}).mode for share in (1.0, 1.001)] == [S, N]

    for late_s, pause_s in ((0.03, 0.05), (0.05, 0.03)):
        config = SafetyConfig(late_limit_s=late_s, pause_limit_s=pause_s, guard_share=1.2)
        assert config.guard_after_s == 0.06


class TestDocumentation:
    def test_the_page_has_the_rules_and_each_rule_its_own_text_and_consequence(self) -> None:
        shown = PAGE.partition("<!-- rules -->\n")[2].partition("<!-- /rules -->")[0].strip()
        assert shown == table(), "python -m footfall.deploy.rules prints it anew"
        all_rules = {rule.quantity: rule for rule in rules()}
        assert len(all_rules) == len(rules()) > len(SIGNAL_CHECKS) + len(JOINT_CHECKS) + len(BODY_CHECKS)
        assert {check.leads_to for check in (*CHECKS, *JOINT_CHECKS, *BODY_CHECKS)} == {E, F, L}
        assert all(rule.limit and rule.consequence for rule in rules())
        limit = "`speed_share` 1.5 × `no_load_speed_rad_s`"
        velocity = (limit, "`safety.sensors`, `motors` in robot.yaml", "ESTOP")
        assert all_rules["a joint's velocity"][1:] == velocity
        settings = {name.partition(".")[0] for check in CHECKS for name in check.limits}
        assert settings <= {field.name for field in fields(SafetyConfig)}

    def test_the_diagram_has_the_transitions_of_the_tables(self) -> None:
        drawn = set(re.findall(r"^    ([A-Z]+) --> ([A-Z]+):", PAGE, re.MULTILINE))
        progress = {(mode, following) for mode, (_, following) in PROGRESS.items()}
        # a fault that would end the next mode at once also prevents the change to that mode
        before = progress | {(N, C), (S, C)}
        faults = {(mode, check.leads_to) for check in CHECKS for mode in check.modes}
        faults |= {(mode, check.leads_to) for mode, to in before for check in CHECKS if to in check.modes}
        faults |= {(F, E)}  # the same, for a robot that may get up
        faults -= {(N, L), (U, L)}  # a robot without stiffness, or on its back, does not lie down
        faults -= {(L, L)}  # a stop is latched while it continues to lie down
        progress |= {(N, C), (S, C), (C, W)}  # with a wiring check
        progress |= {(F, U)}  # with consent
        end = {(mode, R) for mode in Mode if mode not in (*DAMPED, U)} | {(W, P), (S, L), (C, L), (U, F)}
        assert drawn == faults | progress | end | {(R, N)}
        assert set(MOVING) == {S, W, P}
