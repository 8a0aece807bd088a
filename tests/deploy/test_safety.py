"""The supervisor as a state machine: which signal leads from which mode to which."""

import re
from pathlib import Path

import pytest

from footfall.deploy.safety import (
    CHECKS,
    DAMPED,
    MOVING,
    PROGRESS,
    Implausible,
    Mode,
    SafetyConfig,
    Signals,
    State,
    advance,
)

CONFIG = SafetyConfig()
QUIET = Signals(
    now_s=5.0,
    motor_silence_s=0.002,
    silent_motor="FR_hip_joint (can0, id 1)",
    imu_silence_s=0.002,
    motor_error="",
    tilt_rad=0.1,
    command_finite=True,
    late_steps=0,
    step_s=0.0,
    frames_refused=0,
)


def after(mode: Mode, since_s: float = 4.0, **changes: object) -> State:
    return advance(State(mode, since_s), QUIET._replace(**changes), CONFIG)


class TestOrdinaryRun:
    def test_idle_waits_until_everyone_has_answered(self) -> None:
        assert after(Mode.IDLE, now_s=0.5, motor_silence_s=9e9).mode is Mode.IDLE
        assert after(Mode.IDLE, now_s=0.5, imu_silence_s=9e9).mode is Mode.IDLE
        assert after(Mode.IDLE, now_s=0.5).mode is Mode.STANDING

    def test_standing_leads_to_walking_when_done(self) -> None:
        assert after(Mode.STANDING).mode is Mode.STANDING
        assert after(Mode.STANDING, stand_done=True).mode is Mode.WALKING

    @pytest.mark.parametrize("mode", [Mode.IDLE, Mode.STANDING, Mode.WALKING])
    def test_the_wish_to_end_releases_the_robot(self, mode: Mode) -> None:
        assert after(mode, now_s=0.5, finish=True).mode is Mode.RELEASING

    def test_release_ends_idle_after_damping(self) -> None:
        assert not after(Mode.RELEASING, since_s=5.0 - 0.5 * CONFIG.damping_s).over
        final = after(Mode.RELEASING, since_s=5.0 - CONFIG.damping_s)
        assert final.over
        assert final.mode is Mode.IDLE
        assert not final.faults


FAULTS = [
    ({"motor_silence_s": 0.06}, Mode.ESTOP, "no reply from FR_hip_joint (can0, id 1) for 50 ms"),
    (
        {"imu_silence_s": 0.06, "oldest_of_imu": "quaternion"},
        Mode.ESTOP,
        "no new IMU reading (quaternion) for 50 ms",
    ),
    ({"motor_error": "motor x reports over-current"}, Mode.ESTOP, "over-current"),
    ({"command_finite": False}, Mode.ESTOP, "not finite"),
    ({"policy_error": "the policy failed: ValueError: x"}, Mode.ESTOP, "ValueError"),
    ({"late_steps": 5}, Mode.ESTOP, "5 steps in a row"),
    ({"step_s": 0.11}, Mode.ESTOP, "one step took 110 ms"),
    ({"step_s": float("inf")}, Mode.ESTOP, "the policy ran late: no decision within 70 ms"),
    ({"pause_s": 0.13}, Mode.ESTOP, "the loop paused for 130 ms"),
    (
        {"skipped_share": 0.3},
        Mode.ESTOP,
        "30% of the last second's ticks were left out (skipped_share allows 25%)",
    ),
    ({"implausible": Implausible("x leans", Mode.FALLING)}, Mode.FALLING, "x leans"),
    ({"frames_refused": 3}, Mode.ESTOP, "bus overflow: 3 frames refused"),
    ({"tilt_rad": 1.1}, Mode.FALLING, "tilt of 1.10 rad is past the limit"),
]


class TestFaults:
    @pytest.mark.parametrize("mode", [Mode.STANDING, Mode.WALKING])
    @pytest.mark.parametrize(("signal", "leads_to", "says"), FAULTS)
    def test_leads_to_damping_and_says_why(
        self, mode: Mode, signal: dict[str, object], leads_to: Mode, says: str
    ) -> None:
        state = after(mode, **signal)
        assert state.mode is leads_to
        assert len(state.faults) == 1
        assert says in state.faults[0]
        assert "\n" not in state.faults[0]

    @pytest.mark.parametrize("mode", [Mode.FALLING, Mode.ESTOP])
    def test_is_latched(self, mode: Mode) -> None:
        state = advance(State(mode, 4.9, ("why",)), QUIET, CONFIG)
        assert state == State(mode, 4.9, ("why",))
        final = advance(state, QUIET._replace(now_s=6.0), CONFIG)
        assert final.mode is mode
        assert final.over
        assert final.faults == ("why",)
        assert advance(final, QUIET._replace(now_s=99.0), CONFIG) == final

    def test_a_fault_counts_more_than_the_wish_to_end(self) -> None:
        assert after(Mode.WALKING, tilt_rad=2.0, finish=True).mode is Mode.FALLING

    def test_a_motor_that_never_answers_is_named(self) -> None:
        state = after(Mode.IDLE, now_s=1.0, motor_silence_s=1e9)
        assert state.mode is Mode.ESTOP
        assert "no answer from FR_hip_joint (can0, id 1) within 1 s" in state.faults[0]

    def test_an_imu_that_never_answers_is_named(self) -> None:
        assert "the IMU" in after(Mode.IDLE, now_s=1.0, imu_silence_s=1e9).faults[0]

    @pytest.mark.parametrize(
        "why", [{"first_pose": "x reads 4.48 rad"}, {"motor_error": "x"}, {"tilt_rad": 2.0}]
    )
    def test_no_motor_gets_stiffness_where_standing_would_be_a_fault_at_once(self, why: dict) -> None:
        state = after(Mode.IDLE, now_s=0.5, **why)
        assert state.mode is (Mode.FALLING if "tilt_rad" in why else Mode.ESTOP)

    def test_few_late_steps_are_forgiven(self) -> None:
        assert after(Mode.WALKING, late_steps=CONFIG.late_steps - 1).mode is Mode.WALKING

    def test_faults_of_before_are_kept(self) -> None:
        state = advance(State(Mode.WALKING, 4.0, ("earlier",)), QUIET._replace(tilt_rad=2.0), CONFIG)
        assert state.faults[0] == "earlier"
        assert len(state.faults) == 2
        assert state.since_s == QUIET.now_s

    def test_a_full_queue_stops_a_robot_that_has_not_even_stood_up(self) -> None:
        assert after(Mode.IDLE, now_s=0.5, frames_refused=1).mode is Mode.ESTOP

    def test_of_motors_and_imu_that_never_answer_the_motor_is_named(self) -> None:
        fault = after(Mode.IDLE, now_s=1.0, motor_silence_s=1e8, imu_silence_s=1e9).faults[0]
        assert "no answer from FR_hip_joint" in fault

    @pytest.mark.parametrize("mode", [Mode.RELEASING, Mode.FALLING, Mode.ESTOP])
    @pytest.mark.parametrize("signal", [signal for signal, _, _ in FAULTS])
    def test_a_damped_robot_is_damped_to_the_end(self, mode: Mode, signal: dict[str, object]) -> None:
        assert after(mode, since_s=4.9, **signal) == State(mode, 4.9)


OF_THE_POLICY = ({"command_finite": False}, {"policy_error": "x"}, {"late_steps": 5})
OF_THE_ROBOT = [signal for signal, _, _ in FAULTS if signal not in OF_THE_POLICY[::2]]
OF_THE_ROBOT = [signal for signal in OF_THE_ROBOT if "policy_error" not in signal]


class TestLyingDown:
    def test_a_robot_that_can_lies_down_before_a_run_ends(self) -> None:
        assert after(Mode.STANDING, finish=True, may_lie=True) == State(Mode.LOWERING, QUIET.now_s)

    def test_out_of_a_walk_it_comes_to_a_stand_first(self) -> None:
        ends = {"finish": True, "may_lie": True}
        assert after(Mode.WALKING, **ends) == State(Mode.STOPPING, QUIET.now_s)
        assert after(Mode.STOPPING, **ends) == State(Mode.STOPPING, 4.0)
        assert after(Mode.STOPPING, **ends, stopped=True) == State(Mode.LOWERING, QUIET.now_s)
        assert after(Mode.STOPPING, **ends, at_once=True) == State(Mode.RELEASING, QUIET.now_s)

    def test_not_one_whose_joints_have_no_stiffness_yet(self) -> None:
        assert after(Mode.IDLE, now_s=0.5, finish=True, may_lie=True).mode is Mode.RELEASING
        soft = after(Mode.IDLE, now_s=0.5, policy_error="x", may_lie=True)
        assert soft.mode is Mode.ESTOP

    @pytest.mark.parametrize("mode", MOVING)
    @pytest.mark.parametrize("signal", OF_THE_POLICY)
    def test_it_does_so_after_a_fault_of_the_policy(self, mode: Mode, signal: dict[str, object]) -> None:
        state = after(mode, **signal, may_lie=True)
        assert state.mode is Mode.LOWERING
        assert len(state.faults) == 1
        on_its_way = advance(state, QUIET._replace(now_s=6.0, **signal, may_lie=True), CONFIG)
        assert on_its_way == state  # which is no news, and no reason to stop
        lies = advance(state, QUIET._replace(now_s=7.0, **signal, may_lie=True, lain_down=True), CONFIG)
        assert lies == State(Mode.ESTOP, 7.0, state.faults)

    @pytest.mark.parametrize("mode", [*MOVING, Mode.LOWERING])
    @pytest.mark.parametrize("signal", OF_THE_ROBOT)
    def test_a_fault_of_the_robot_damps_at_once(self, mode: Mode, signal: dict[str, object]) -> None:
        if mode is Mode.LOWERING and "step_s" in signal:
            return  # the policy is not asked any more
        assert after(mode, **signal, may_lie=True).mode in (Mode.ESTOP, Mode.FALLING)

    def test_once_it_lies_the_robot_is_released(self) -> None:
        assert after(Mode.LOWERING, may_lie=True) == State(Mode.LOWERING, 4.0)
        assert after(Mode.LOWERING, may_lie=True, finish=True) == State(Mode.LOWERING, 4.0)
        assert after(Mode.LOWERING, may_lie=True, lain_down=True) == State(Mode.RELEASING, QUIET.now_s)

    def test_who_cannot_wait_ends_it_at_once(self) -> None:
        assert after(Mode.LOWERING, may_lie=True, at_once=True).mode is Mode.RELEASING
        assert after(Mode.WALKING, may_lie=True, finish=True, at_once=True).mode is Mode.RELEASING
        faulty = advance(State(Mode.LOWERING, 4.0, ("why",)), QUIET._replace(at_once=True), CONFIG)
        assert faulty == State(Mode.ESTOP, QUIET.now_s, ("why",))


class TestLimits:
    """A limit itself is still kept to; past it is a fault."""

    @pytest.mark.parametrize(
        ("name", "limit"),
        [
            ("motor_silence_s", CONFIG.silence_timeout_s),
            ("imu_silence_s", CONFIG.silence_timeout_s),
            ("tilt_rad", CONFIG.tilt_limit_rad),
            ("step_s", CONFIG.late_limit_s),
        ],
    )
    def test_of_what_is_measured(self, name: str, limit: float) -> None:
        assert after(Mode.WALKING, **{name: limit}).mode is Mode.WALKING
        assert after(Mode.WALKING, **{name: 1.001 * limit}).mode is not Mode.WALKING

    @pytest.mark.parametrize("name", ["motor_silence_s", "imu_silence_s"])
    def test_of_who_has_answered(self, name: str) -> None:
        silence_s = CONFIG.silence_timeout_s
        assert after(Mode.IDLE, now_s=0.5, **{name: silence_s}).mode is Mode.STANDING
        assert after(Mode.IDLE, now_s=0.5, **{name: 1.001 * silence_s}).mode is Mode.IDLE

    def test_of_the_time_to_start(self) -> None:
        silent = {"motor_silence_s": 1e9}
        assert after(Mode.IDLE, now_s=0.999 * CONFIG.start_timeout_s, **silent).mode is Mode.IDLE
        assert after(Mode.IDLE, now_s=CONFIG.start_timeout_s, **silent).mode is Mode.ESTOP

    @pytest.mark.parametrize(
        ("mode", "following", "changes"),
        [
            (Mode.IDLE, Mode.STANDING, {"now_s": 0.5}),
            (Mode.STANDING, Mode.WALKING, {"stand_done": True}),
            (Mode.WALKING, Mode.RELEASING, {"finish": True}),
        ],
    )
    def test_each_mode_counts_its_time_from_its_beginning(
        self, mode: Mode, following: Mode, changes: dict[str, object]
    ) -> None:
        state = after(mode, **changes)
        assert state == State(following, float(changes.get("now_s", QUIET.now_s)))  # type: ignore[arg-type]


def test_the_picture_in_the_documents_shows_the_ways_that_the_tables_have() -> None:
    page = (Path(__file__).parents[2] / "docs/safety.md").read_text(encoding="utf-8")
    drawn = set(re.findall(r"^    ([A-Z]+) --> ([A-Z]+):", page, re.MULTILINE))
    faults = {(mode, check.leads_to) for check in CHECKS for mode in check.modes}
    # what would end the mode that follows at once keeps a robot out of it
    faults |= {
        (mode, check.leads_to)
        for mode, (_, following) in PROGRESS.items()
        for check in CHECKS
        if following in check.modes
    }
    progress = {(mode, following) for mode, (_, following) in PROGRESS.items()}
    faults -= {(Mode.IDLE, Mode.LOWERING)}  # without stiffness nobody lies down
    end = {(mode, Mode.RELEASING) for mode in Mode if mode not in DAMPED}
    end |= {(Mode.WALKING, Mode.STOPPING), (Mode.STANDING, Mode.LOWERING)}
    assert drawn == faults | progress | end | {(Mode.RELEASING, Mode.IDLE)}
