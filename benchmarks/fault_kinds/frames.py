"""Faults of the frames of motors and buses."""

from collections.abc import Callable

import numpy as np

from footfall.deploy.frames import Frames
from footfall.plant.frame_changes import Batches, dropped, flipped, from_imu, nothing
from footfall.plant.injection import FaultInjector, Injection


def silent(all_motors: bool) -> Injection:
    def inject(injector: FaultInjector) -> None:
        injector.body.faults.motors.silent[slice(None) if all_motors else injector.joint] = True

    return inject


def bus_dead(injector: FaultInjector) -> None:
    """No frame passes a bus in either direction."""
    injector.on_all(lambda frames: frames.take(frames.channel != injector.channel))
    injector.bus.outgoing = lambda frames, _: frames.take(frames.channel != injector.channel)


def all_dead(injector: FaultInjector) -> None:
    injector.on_all(nothing)
    injector.bus.outgoing = lambda frames, _: nothing(frames)


def commands_lost(injector: FaultInjector) -> None:
    injector.bus.outgoing = lambda frames, _: nothing(frames)


def commands_lost_to_one(injector: FaultInjector) -> None:
    keep = np.arange(len(injector.robot.joint_names)) != injector.joint
    injector.bus.outgoing = lambda frames, _: frames.take(keep) if len(frames.id) == len(keep) else frames


def corrupted(
    change: Callable[[FaultInjector], Callable[[Frames], Frames]],
) -> Injection:
    def inject(injector: FaultInjector) -> None:
        corrupt = change(injector)
        injector.on_replies(lambda frames, _: corrupt(frames))

    return inject


def stuck(injector: FaultInjector) -> None:
    injector.body.faults.motors.stuck[injector.joint] = True


def wrong_sender(injector: FaultInjector) -> None:
    def corrupt(frames: Frames, joint: np.ndarray) -> Frames:
        data = frames.data.copy()
        data[joint == injector.joint, 0] = 0x7E
        return frames._replace(data=data)

    injector.on_replies(corrupt)


def doubled(batches: Batches, _: int) -> Batches:
    return [*batches, *batches]


def delivered_twice(injector: FaultInjector) -> None:
    injector.bus.incoming = doubled


def foreign(injector: FaultInjector) -> None:
    """Frames of a foreign sender on the bus."""
    others = Frames(
        np.full(8, injector.channel), np.arange(0x500, 0x508), np.full((8, 8), 0xA5, np.uint8), np.full(8, 8)
    )
    injector.bus.incoming = lambda batches, _: [others, *batches, others]


def queueing(injector: FaultInjector) -> None:
    injector.falls_behind(0.5, lambda frames: not from_imu(frames))


def frames_lost(share: float) -> Injection:
    return lambda injector: injector.on_all(dropped(share, injector.rng))


def bits_flipped(share: float) -> Injection:
    return lambda injector: injector.on_all(flipped(share, injector.rng))


def all_late(milliseconds: int) -> Injection:
    return lambda injector: injector.late(1000 * milliseconds)
