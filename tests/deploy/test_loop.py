"""The control loop tick by tick: who is handed what, and what counts as late."""

from dataclasses import replace

import numpy as np
import pytest
from deploy_policies import Hold, stand_still

from footfall.deploy import loop as loop_module
from footfall.deploy.clock import LockstepClock
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.loop import CommandSource, ControlLoop
from footfall.deploy.postures import Ending
from footfall.deploy.safety import Implausible, Mode, State
from footfall.deploy.wiring import wire
from footfall.plant.bus import SimulatedBus
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

TICK_US = 2000


class Pretence(LockstepClock):
    """Ticks that follow at once, and count as wall-clock time."""

    realtime = True  # type: ignore[assignment]


def new_loop(
    robot: Robot,
    policy: Policy,
    realtime: bool = False,
    estimator: object = None,
    command_source: CommandSource = stand_still,
    pose: np.ndarray | None = None,
    estimator_rate_hz: float = 250.0,
) -> ControlLoop:
    """A loop on a simulated robot that stands in a pose, the default one if none is given."""
    wiring = wire(robot)
    wires = SimulatedWires(wiring.buses)
    body = SimulatedRobot(robot, wiring, wires)
    if pose is not None:
        body.data.qpos[7:] = pose
    bus = SimulatedBus(wires, body)
    clock = (Pretence if realtime else LockstepClock)(TICK_US)
    config = DeployConfig(stand_s=0.1, pose_rate_rad_s=100.0, estimator_rate_hz=estimator_rate_hz)
    return ControlLoop(
        robot, policy, wiring, open_driver(wiring), bus, clock, config, command_source, estimator
    )  # type: ignore[arg-type]


def run_for(loop: ControlLoop, walking_s: float) -> None:
    """Tick until the robot has walked for so long, or walks no more."""
    while loop.tick() and not (loop.walking and loop.walking_s >= walking_s - 1e-9):
        if loop.state.faults:
            return


class Stopwatch:
    """Stands in for the loop's `time`: it moves on only when it is told to."""

    now_s = 0.0

    def perf_counter(self) -> float:
        return self.now_s


class Dawdle(Hold):
    """Every so many steps it takes longer than its period of 20 ms."""

    def __init__(self, robot: Robot, watch: Stopwatch, pattern: str) -> None:
        super().__init__(robot)
        self._watch, self._pattern = watch, pattern

    def act(self, inputs: PolicyInput) -> JointCommand:
        late = self._pattern[len(self.seen) % len(self._pattern)] == "L"
        self._watch.now_s += 0.021 if late else 0.019
        return super().act(inputs)


class TestLateness:
    @pytest.mark.parametrize(
        ("pattern", "faults"),
        [("L.", 0), ("LLLL.", 0), ("LLLLL", 1)],
        ids=["late, on time, late", "four late, one on time", "five late"],
    )
    def test_only_late_steps_in_a_row_count(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, pattern: str, faults: int
    ) -> None:
        watch = Stopwatch()
        monkeypatch.setattr(loop_module, "time", watch)
        loop = new_loop(go1, Dawdle(go1, watch, pattern), realtime=True)
        run_for(loop, 0.3)
        assert len(loop.state.faults) == faults

    @pytest.mark.parametrize(("realtime", "faults"), [(True, 1), (False, 0)])
    def test_one_step_that_takes_far_too_long_is_enough_on_the_wall_clock(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch, realtime: bool, faults: int
    ) -> None:
        class Stuck(Hold):
            def act(self, inputs: PolicyInput) -> JointCommand:
                watch.now_s += 0.101 if len(self.seen) == 3 else 0.001
                return super().act(inputs)

        watch = Stopwatch()
        monkeypatch.setattr(loop_module, "time", watch)
        loop = new_loop(go1, Stuck(go1), realtime)
        run_for(loop, 0.3)
        assert len(loop.state.faults) == faults
        assert not faults or loop.state.faults[0].endswith("one step took 101 ms")

    def test_nothing_is_late_in_lockstep(self, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
        watch = Stopwatch()
        monkeypatch.setattr(loop_module, "time", watch)
        loop = new_loop(go1, Dawdle(go1, watch, "L"))
        run_for(loop, 0.3)
        assert loop.state.faults == ()


def test_a_policy_does_not_make_up_for_ticks_that_were_left_out(go1: Robot) -> None:
    """44 ms are missing: what was due in them is decided once, and the next step is in its time."""
    policy = Hold(go1)
    loop = new_loop(go1, policy)
    run_for(loop, 0.1)
    loop._clock._tick += 22  # type: ignore[attr-defined]
    run_for(loop, 0.22)
    assert loop.state.faults == ()
    steps_ms = np.array([round(1e3 * seen.time_s) for seen in policy.seen])
    late = int(np.argmax(np.diff(steps_ms))) + 1
    assert steps_ms[late - 1 : late + 3].tolist() == [100, 146, 160, 180]


def test_durations_are_told_in_their_units(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of 19 ms and, every third, 21 ms; they are nearly all of their ticks."""
    watch = Stopwatch()
    monkeypatch.setattr(loop_module, "time", watch)
    loop = new_loop(go1, Dawdle(go1, watch, "..L"))
    run_for(loop, 0.1)
    np.testing.assert_allclose(loop.timing.policy_ms.values(), [19.0, 19.0, 21.0, 19.0, 19.0, 21.0])
    ticks_us = loop.timing.tick_us.values()
    np.testing.assert_allclose(ticks_us[ticks_us > 0.0], [19e3, 19e3, 21e3, 19e3, 19e3, 21e3])


class TestEstimate:
    def test_the_estimator_gets_the_policys_contact_plan_once_it_has_begun(self, go1: Robot) -> None:
        plan = np.array([1.0, 0.0, 0.0, 1.0])

        class Planned(Hold):
            needs_estimate = True

            def stance(self) -> np.ndarray:  # type: ignore[override]
                return plan if self.resets else 0.0 * plan  # before its reset: of an episode before

        class Note:
            """Keeps what it is handed, and estimates the number of its updates."""

            def __init__(self) -> None:
                self.plans: list[object] = []
                self.resets = 0
                self.started: list[int] = []
                self.steps_s: list[float] = []

            def reset(self, sensed: Sensed) -> None:
                self.resets += 1

            def start(self) -> None:
                self.started.append(len(self.plans))

            def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple:
                self.plans.append(stance)
                self.steps_s.append(dt_s)
                return np.array([len(self.plans), 0.0, 0.0]), 0.25

        policy, note = Planned(go1), Note()
        loop = new_loop(go1, policy, estimator=note, estimator_rate_hz=30.0)
        while loop.state.mode is not Mode.WALKING:
            standing = len(note.plans)
            loop.tick()
        run_for(loop, 0.1)
        assert note.resets == 1
        assert note.started == [standing]  # the pose is zero where the policy takes over
        assert standing == 2  # of 0.1 s
        assert all(stance is None for stance in note.plans[: standing + 1])
        assert all(stance is plan for stance in note.plans[standing + 1 :])
        np.testing.assert_allclose(note.steps_s[:2], 0.034, atol=1e-9)  # 1/30 s, at the next tick
        assert [seen.base_velocity[0] for seen in policy.seen] == [
            3,
            4,
            5,
            6,
            7,
            8,
        ]  # one at each policy step
        np.testing.assert_allclose(note.steps_s[3:], 0.02, atol=1e-9)
        assert policy.seen[-1].base_height == 0.25

    def test_it_is_updated_at_its_rate_whatever_the_policys(self, go1: Robot) -> None:
        """Every 4 ms of ticks of 2 ms; each 20 ms is a policy step, too."""

        class Note:
            def __init__(self) -> None:
                self.steps_s: list[float] = []

            def reset(self, sensed: Sensed) -> None: ...

            def start(self) -> None: ...

            def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple:
                self.steps_s.append(dt_s)
                return np.zeros(3), 0.25

        note = Note()
        run_for(new_loop(go1, Hold(go1), estimator=note), 0.1)
        assert len(note.steps_s) > 45
        np.testing.assert_allclose(note.steps_s, 0.004, atol=1e-9)


def test_what_is_found_of_the_body_counts_also_where_readings_are_due_to_be_added(
    go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop, found = new_loop(go1, Hold(go1)), Implausible("the IMU is askew", Mode.ESTOP)
    for due in (False, True):
        monkeypatch.setattr(loop._checks.monitor, "look_at_body", lambda: True)
        monkeypatch.setattr(loop._checks.monitor, "due", lambda _, due=due: due)
        monkeypatch.setattr(loop._checks, "of_body", lambda: found)
        assert loop._contradiction(0) is found


def test_ticks_that_are_left_out_count_less_and_less(go1: Robot) -> None:
    """Of a pause of 60 ms 58 ms, of the last second; of 2 ms none; of two seconds one counts."""
    loop = new_loop(go1, Hold(go1))
    assert loop._skipped(TICK_US) == 0.0
    assert loop._skipped(60_000) == pytest.approx(0.058)
    assert loop._skipped(TICK_US) == pytest.approx(0.058 * 0.998)
    assert loop._skipped(0) == pytest.approx(0.058 * 0.998)
    assert loop._skipped(2_000_000) == pytest.approx(0.999)


def test_how_a_robot_is_found_that_shall_lie_down(go1: Robot) -> None:
    """One that stands up has all feet on the ground, whatever is wrong."""
    loop = new_loop(go1, Hold(go1))
    for faults, stopped in ((), Ending.STOPPED), (("the policy failed",), Ending.WALKING):
        loop.state = State(Mode.LOWERING, 1.0, faults)
        assert loop._ending(Mode.STANDING) is Ending.STANDING
        assert (loop._ending(Mode.WALKING), loop._ending(Mode.STOPPING)) == (stopped, stopped)


@pytest.mark.parametrize(("damping_s", "ticks"), [(0.5, 252), (0.501, 253), (0.019, 12)])
def test_damping_takes_its_time_and_two_ticks(go1: Robot, damping_s: float, ticks: int) -> None:
    loop = new_loop(go1, Hold(go1))
    loop._config = replace(loop._config, safety=replace(loop._config.safety, damping_s=damping_s))
    assert loop.damping_ticks == ticks


class TestStanding:
    def test_targets_lead_smoothly_from_where_the_robot_is_to_the_default_pose(self, go1: Robot) -> None:
        crouched = go1.default_pose + np.tile([0.0, 0.3, -0.5], 4)
        loop = new_loop(go1, Hold(go1), pose=crouched)
        targets = []
        while loop.state.mode is not Mode.WALKING:
            loop.tick()
            if loop.state.mode is Mode.STANDING:
                targets.append(loop.target)
        np.testing.assert_allclose(targets[0], crouched, atol=0.02)
        np.testing.assert_allclose(targets[-1], go1.default_pose, atol=1e-6)
        thighs = np.array(targets)[:, 1::3]
        assert (np.diff(thighs, axis=0) <= 0.0).all()  # up, and never down again
        np.testing.assert_allclose(thighs[17], (targets[0] + targets[-1])[1::3] / 2, atol=0.02)  # half-way
        begun = (thighs[9] - thighs[0]) / (thighs[-1] - thighs[0])  # a quarter of the time, 0.7 * 0.1 s
        np.testing.assert_allclose(begun, 0.5 - 0.5 * np.cos(np.pi * 0.018 / 0.07), atol=0.01)

    def test_a_wish_to_end_before_it_walks_is_granted(self, go1: Robot) -> None:
        loop = new_loop(go1, Hold(go1))
        for _ in range(10):
            loop.tick()
        loop.finish()
        while loop.tick():
            assert loop.state.mode is not Mode.WALKING
        assert loop.state.mode is Mode.IDLE
        assert loop.walked_s == 0.0


def test_the_command_is_a_function_of_the_time_since_walking_began(go1: Robot) -> None:
    policy = Hold(go1)
    loop = new_loop(go1, policy, command_source=lambda time_s: np.array([time_s, 0.0, 0.0]))
    run_for(loop, 0.1)
    asked = [inputs.command[0] for inputs in policy.seen]
    np.testing.assert_allclose(asked, 0.02 * np.arange(len(asked)), atol=1e-9)
    assert loop.walking_s == pytest.approx(0.1)
    loop.finish()
    while loop.tick():
        pass
    assert loop.walked_s == pytest.approx(0.102)  # until the tick after
