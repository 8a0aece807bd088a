"""A robot on a stand: motors queried, enabled, zeroed and watched; motors found on its buses."""

import math
import signal
from contextlib import suppress

import numpy as np
import pytest
from some_motors import with_motors
from watched_simulation import Simulation

from footfall import Robot
from footfall.deploy.bench import PERIOD_US, Bench, disabled_afterwards
from footfall.deploy.clock import LockstepClock
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.scan import FoundMotor, expected, scan
from footfall.deploy.wiring import Wiring


class OnStand(Simulation):
    """A simulated robot that is used in lockstep."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot, motor_timeout_s=None)
        self.clock = LockstepClock(PERIOD_US)

    def scan(self) -> set[FoundMotor]:
        return scan(self.bus, self.wiring, LockstepClock(10_000))

    def bench(self, wiring: Wiring | None = None) -> Bench:
        return Bench(wiring or self.wiring, self.bus, self.clock)


@pytest.fixture(
    params=[{"hip": "DM8006", "knee": "RS03"}, {"hip": "ODrive", "first_id": 4}, {"hip": "moteus"}]
)
def stand(request: pytest.FixtureRequest, go1: Robot) -> OnStand:
    return OnStand(with_motors(go1, **request.param))


class TestBench:
    def test_motors_are_enabled_without_torque_and_disabled_after_an_exception(self, stand: OnStand) -> None:
        bench, torques = stand.bench(), []
        with suppress(RuntimeError), disabled_afterwards(bench):
            assert (bench.query_settings(), bench.enable()) == ("", "")
            assert stand.body.motors_on.all()
            bench.idle(0.2, lambda: torques.append(np.abs(stand.body.truth().motor_torque).max()))
            assert stand.body.motors_on.all()
            raise RuntimeError("in between")
        assert max(torques) < 0.1
        assert not stand.body.motors_on.any()

    def test_watching_shows_readings_and_enables_no_motor(self, stand: OnStand) -> None:
        bench, seen = stand.bench(), []
        assert (bench.query_settings(), bench.settle()) == ("", "")
        bench.watch(0.3, lambda: seen.append(stand.body.motors_on.any()))
        assert not any(seen)
        assert bench.missing() == ""
        positions, states = stand.body.truth().joint_position, bench.states()
        np.testing.assert_allclose([s.position for s in states], positions, atol=0.02)
        assert [s.temperature_c for s in states] == pytest.approx([30.0] * 12)
        assert all(s.error == "" and s.age_s < 0.1 for s in states)
        assert [s.voltage > 0.0 for s in states] == [s.model in ("ODrive", "moteus") for s in states]

    def test_a_zero_is_set_at_the_present_position(self, stand: OnStand) -> None:
        """The robot lies with bent knees; only the knee of one leg is zeroed."""
        bench = stand.bench(stand.wiring.take(np.array([2])))
        assert (bench.query_settings(), bench.settle()) == ("", "")
        assert bench.states()[0].position < -1.5
        assert bench.zero() == ""
        assert abs(bench.states()[0].position) < 0.05
        everyone = stand.bench()
        everyone.query_settings()
        everyone.watch(0.1, lambda: None)
        assert everyone.states()[5].position < -1.5

    @pytest.mark.parametrize(
        ("joints", "lost", "unset"),
        [([2], 1, ""), ([2], 9, "FR_calf_joint (can0, id 3)"), ([2, 5], 99, "FL_calf")],
    )
    def test_a_lost_zero_is_set_or_named(self, go1: Robot, joints: list[int], lost: int, unset: str) -> None:
        """Frames to the last of these motors are lost."""
        stand, left = OnStand(go1), [lost]

        def drop(frames: Frames, _: int) -> Frames:
            zeroing = (frames.data[:, 7] == 0xFE) & (frames.channel == len(joints) - 1) & (left[0] > 0)
            left[0] -= int(zeroing.sum())
            return frames.take(~zeroing)

        stand.bus.outgoing = drop
        bench = stand.bench(stand.wiring.take(np.array(joints)))
        assert bench.settle() == ""
        reason = bench.zero()
        assert reason.startswith(unset)
        assert bool(reason) == bool(unset)

    def test_a_joint_that_keeps_moving_is_named(self, go1: Robot) -> None:
        stand = OnStand(go1)
        bench = stand.bench(stand.wiring.take(np.array([2])))

        def shake() -> int:
            now_us = LockstepClock.next_tick(stand.clock)
            stand.body.data.qvel[8] = 6.0 * (-1) ** (now_us // PERIOD_US)
            return now_us

        stand.clock.next_tick = shake  # type: ignore[method-assign]
        assert bench.settle() == "FR_calf_joint (can0, id 3) moves"

    def test_a_silent_motor_and_an_error_are_named(self, go1: Robot) -> None:
        stand = OnStand(go1)
        stand.body.faults.motors.silent[7], stand.body.faults.motors.error[3] = True, 4
        bench = stand.bench()
        assert bench.enable() == f"no answer from {stand.wiring.label(7)}"
        bench.watch(0.1, lambda: None)
        assert [math.isinf(state.age_s) for state in bench.states()] == [joint == 7 for joint in range(12)]
        assert [state.error for state in bench.states()] == [""] * 3 + ["under-voltage"] + [""] * 8

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP, signal.SIGQUIT])
    @pytest.mark.parametrize("ignored", [False, True])
    def test_a_signal_disables_the_motors(self, go1: Robot, number: int, ignored: bool) -> None:
        """Handlers are restored. A shell script's `command &` starts with SIGINT ignored."""
        stand, original = OnStand(go1), signal.getsignal(number)
        before = signal.SIG_IGN if ignored else original
        bench = stand.bench()
        bench.enable()
        signal.signal(number, before)
        try:
            with pytest.raises(KeyboardInterrupt), disabled_afterwards(bench):
                bench.idle(1.0, lambda: signal.raise_signal(number))
            assert signal.getsignal(number) is before
        finally:
            signal.signal(number, original)
        assert not stand.body.motors_on.any()


class TestScan:
    def test_a_scan_finds_ids_and_enables_no_motor(self, stand: OnStand) -> None:
        makers = {"DM8006": "Damiao", "RS03": "RobStride", "ODrive": "ODrive", "moteus": "moteus"}
        wiring = stand.wiring
        motors = zip(wiring.channel.tolist(), wiring.motor_id.tolist(), wiring.models, strict=True)
        addresses = {FoundMotor(bus, motor, makers.get(model, "MIT mode")) for bus, motor, model in motors}
        assert stand.scan() == addresses == set(expected(stand.wiring))
        assert not stand.body.motors_on.any()

    def test_no_probe_has_an_identifier_of_an_odrive(self, go1: Robot) -> None:
        """An ODrive with id 1 uses 0x020 to 0x03f: the frame that disables MIT motor 0x36 restarts it."""
        stand = OnStand(with_motors(go1, hip="ODrive", knee="ODrive"))
        stand.scan()
        sent = np.concatenate([frames.id for frames in stand.sent])
        assert set(sent[sent < EXTENDED].tolist()) == set(range(0x01, 0x20))

    def test_enabled_motors_are_disabled_and_absent_motors_are_not_found(self, go1: Robot) -> None:
        stand = OnStand(go1)
        stand.bench().enable()
        assert stand.body.motors_on.all()
        stand.body.faults.motors.silent[4] = True
        present = set(expected(stand.wiring)) - {FoundMotor(1, 2, "MIT mode")}
        assert scan(stand.bus, stand.wiring, stand.clock) == present
        assert not stand.body.motors_on.any()
