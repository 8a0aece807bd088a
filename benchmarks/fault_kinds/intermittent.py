"""Intermittent faults, shorter than the window of a check."""

from collections.abc import Callable
from itertools import cycle

import numpy as np

from fault_kinds.body import strength
from fault_kinds.kind import FaultKind
from fault_kinds.replies import temperature
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.frames import Frames, joined
from footfall.plant.frame_changes import Batches, dropped, flipped, from_imu
from footfall.plant.imu_ends import IMU_PERIOD_S
from footfall.plant.injection import FaultInjector, Injection

TICK_S = 0.002  # period of the loop in these runs
RESIDUAL = 1e-9  # share of its torque that a motor without torque keeps; not 0, so that it can be undone


def each_tick(act: Callable[[int], None]) -> Callable[[Batches, int], Batches]:
    """Call `act` at each tick with the number of ticks since the fault; frames pass unchanged."""
    ticks = [0]

    def incoming(batches: Batches, _: int) -> Batches:
        act(ticks[0])
        ticks[0] += 1
        return batches

    return incoming


def _intermittent(
    faulty_s: float, every_s: float, switch: Callable[[FaultInjector, bool], None]
) -> Injection:
    """A fault that lasts `faulty_s` and comes back every `every_s`."""

    def inject(injector: FaultInjector) -> None:
        def act(tick: int) -> None:
            since_s = tick * TICK_S % every_s
            if since_s < TICK_S / 2:
                switch(injector, True)
            elif abs(since_s - faulty_s) < TICK_S / 2:
                switch(injector, False)

        injector.bus.incoming = each_tick(act)

    return inject


def _without_torque(injector: FaultInjector, faulty: bool) -> None:
    strength(RESIDUAL if faulty else 1.0 / RESIDUAL)(injector)


def _motor_silent(injector: FaultInjector, faulty: bool) -> None:
    injector.body.faults.motors.silent[injector.joint] = faulty


def _imu_silent(injector: FaultInjector, faulty: bool) -> None:
    injector.body.faults.imu_silent = faulty


def _imu_frozen(frozen_s: float, every_s: float) -> Injection:
    """The reading is constant for `frozen_s` of every `every_s`; its counters go on."""

    def inject(injector: FaultInjector) -> None:
        kept: list[Inertial] = []
        readings = [0]

        def freeze(reading: Inertial) -> Inertial:
            since_s = readings[0] * IMU_PERIOD_S % every_s
            readings[0] += 1
            if since_s < IMU_PERIOD_S / 2:
                kept[:] = [reading]
            return kept[0] if since_s < frozen_s else reading

        injector.on_imu(freeze)

    return inject


def imu_replayed(length: int = 100) -> Injection:
    """The last `length` readings of the IMU are repeated, with their counters."""

    def inject(injector: FaultInjector) -> None:
        kept: list[Frames] = []
        arrived = [0]

        def replay(batches: Batches, _: int) -> Batches:
            out = []
            for frames in batches:
                replayed = frames
                if from_imu(frames):
                    kept.append(frames) if len(kept) < length else None
                    replayed = frames._replace(data=kept[arrived[0] % length].data)
                    arrived[0] += 1
                out.append(replayed)
            return out

        injector.bus.incoming = replay

    return inject


def imu_replayed_with_new_counters(injector: FaultInjector) -> None:
    """The values of 200 ms are repeated, with counters that go on."""
    kept: list[Inertial] = []
    readings = [0]

    def replay(reading: Inertial) -> Inertial:
        if len(kept) < 100:
            kept.append(reading)
        readings[0] += 1
        return kept[(readings[0] - 1) % len(kept)]

    injector.on_imu(replay)


def imu_reordered(injector: FaultInjector) -> None:
    """Readings of the IMU arrive in swapped pairs."""
    waiting: list[Frames] = []

    def swap(batches: Batches, _: int) -> Batches:
        out = []
        for frames in batches:
            if not from_imu(frames):
                out.append(frames)
            elif not waiting:
                waiting.append(frames)
            else:
                out += [frames, waiting.pop()]
        return out

    injector.bus.incoming = swap


def _of_joint(injector: FaultInjector, frames: Frames) -> np.ndarray:
    """Mask of the frames that go to the faulty motor, (k,)."""
    wiring = injector.wiring
    mask: np.ndarray = (frames.channel == injector.channel) & (frames.id == wiring.motor_id[injector.joint])
    return mask


def half_of_commands_lost(injector: FaultInjector) -> None:
    """Half of the commands to one motor are lost."""

    def outgoing(frames: Frames, _: int) -> Frames:
        lost = _of_joint(injector, frames) & (injector.rng.random(len(frames.id)) < 0.5)
        return frames.take(~lost)

    injector.bus.outgoing = outgoing


def repeats_first_command(injector: FaultInjector) -> None:
    """A motor that obeys only the first command after the fault, and still answers."""
    kept: list[np.ndarray] = []

    def outgoing(frames: Frames, _: int) -> Frames:
        rows = np.flatnonzero(_of_joint(injector, frames))
        if not len(rows):
            return frames
        data = frames.data.copy()
        kept.append(data[rows[0]].copy()) if not kept else None
        data[rows] = kept[0]
        return frames._replace(data=data)

    injector.bus.outgoing = outgoing


def commands_flipped(share: float) -> Injection:
    """A share of the commands to all motors has flipped bits."""

    def inject(injector: FaultInjector) -> None:
        flip = flipped(share, injector.rng)
        injector.bus.outgoing = lambda frames, _: flip(frames)

    return inject


def commands_dropped(share: float) -> Injection:
    """A share of the commands to all motors is lost."""

    def inject(injector: FaultInjector) -> None:
        drop = dropped(share, injector.rng)
        injector.bus.outgoing = lambda frames, _: drop(frames)

    return inject


def second_host(injector: FaultInjector) -> None:
    """Another program on the same buses, which holds the default pose: half of the joints at each tick."""
    robot, wiring = injector.robot, injector.wiring
    n = len(robot.joint_names)
    values = np.zeros((5, n))
    values[0], values[2], values[3] = robot.default_pose, robot.kp, robot.kd
    other = Frames(wiring.channel, wiring.motor_id, mit.Codec(wiring.models).encode(values), np.full(n, 8))
    halves = cycle([other.take(np.arange(start, n, 2)) for start in (0, 1)])
    first = bool(injector.rng.random() < 0.5)
    injector.bus.outgoing = lambda frames, _: joined(
        [next(halves), frames] if first else [frames, next(halves)]
    )


def bus_lost_intermittently(injector: FaultInjector) -> None:
    """Replies of one bus are lost for 40 of 80 ms, as by a loose plug."""
    tick = [0]

    def incoming(batches: Batches, _: int) -> Batches:
        tick[0] += 1
        lost = tick[0] * TICK_S % 0.08 < 0.04
        return [frames.take(frames.channel != injector.channel) if lost else frames for frames in batches]

    injector.bus.incoming = incoming


LOOP = "its counters run back when the 200 ms start again"
LOOPED = "values repeat when the 200 ms start again, and are recognised within another 200 ms"
SHARE = "one lost frame is no fault: only the share of lost frames counts"
SMALL = "the effect is small while little or constant torque is commanded"
WARM = "noticed once it is colder than all other motors by `colder_c`"
INTERMITTENT = (
    FaultKind("IMU replays 200 ms with their counters", imu_replayed(), 0.35, LOOP, main=True),
    FaultKind("IMU replays 200 ms under new counters", imu_replayed_with_new_counters, 0.7, LOOPED),
    FaultKind("IMU's readings in the wrong order", imu_reordered, 0.6, SHARE),
    FaultKind("IMU silent 40 of 80 ms", _intermittent(0.04, 0.08, _imu_silent), 0.6, SHARE, main=True),
    FaultKind("IMU frozen 30 of 60 ms", _imu_frozen(0.03, 0.06), 1.0, SHARE, main=True),
    FaultKind("motor silent 40 of 80 ms", _intermittent(0.04, 0.08, _motor_silent), 0.6, SHARE, main=True),
    FaultKind("a bus's replies lost 40 of 80 ms", bus_lost_intermittently, 0.6, SHARE),
    FaultKind(
        "motor without torque 30 of 200 ms", _intermittent(0.03, 0.2, _without_torque), None, SMALL, main=True
    ),
    FaultKind("half of one motor's commands lost", half_of_commands_lost, 0.6, SHARE, main=True),
    FaultKind("half of all commands lost", commands_dropped(0.5), 0.6, SHARE),
    FaultKind("motor keeps an old command", repeats_first_command, None, SMALL, main=True, observed_s=5.0),
    FaultKind(
        "bits flipped in 5 % of the commands", commands_flipped(0.05), None, SHARE, main=True, observed_s=4.0
    ),
    FaultKind("a second host holds the default pose", second_host, main=True),
    FaultKind("temperature sensor reads 0", temperature(0), 0.6, WARM, main=True),
)
