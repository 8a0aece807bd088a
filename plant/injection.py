"""Fault injection: changes frames in transit, the policy's decisions, and parts of the robot during a run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.command_source import CommandSource, Request, Status, Stop
from footfall.deploy.drivers import imu, mit
from footfall.deploy.drivers.polled import motor_lookup
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.deploy.wrapped_bus import WrappedBus
from footfall.plant.frame_changes import Batches, Incoming, from_imu, late
from footfall.plant.robot import SimulatedRobot
from footfall.policies.contract import Contract
from footfall.policies.policy import Policy, PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses

Outgoing = Callable[[Frames, int], Frames]  # from sent frames and time, us, to the frames on the bus


class InjectingBus(WrappedBus):
    """A bus that can change frames to and from the controller."""

    def __init__(self, inner: Bus) -> None:
        super().__init__(inner)
        self.incoming: Incoming | None = None
        self.outgoing: Outgoing | None = None
        self.watch: Callable[[Frames], None] | None = None  # called with all frames that the controller sends

    def send(self, frames: Frames, now_us: int) -> int:
        if self.watch is not None:
            self.watch(frames)
        if self.outgoing is not None:
            frames = self.outgoing(frames, now_us)
        return super().send(frames, now_us) if len(frames.id) else 0

    def receive(self, now_us: int) -> Batches:
        batches = super().receive(now_us)
        return batches if self.incoming is None else self.incoming(batches, now_us)


class InjectingPolicy:
    """A policy whose decisions can be replaced."""

    def __init__(self, inner: Policy) -> None:
        self._inner = inner
        self.name, self.rate_hz, self.needs_estimate = inner.name, inner.rate_hz, inner.needs_estimate
        self.change_decision: Callable[[JointCommand], JointCommand] | None = None
        self.replace_stance: Callable[[], np.ndarray | None] | None = None

    @property
    def contract(self) -> Contract | None:
        return self._inner.contract

    @property
    def notes(self) -> Sequence[str]:
        return self._inner.notes

    def reset(self, inputs: PolicyInput) -> None:
        self._inner.reset(inputs)

    def act(self, inputs: PolicyInput) -> JointCommand:
        decision = self._inner.act(inputs)
        return decision if self.change_decision is None else self.change_decision(decision)

    def stance(self) -> np.ndarray | None:
        return self._inner.stance() if self.replace_stance is None else self.replace_stance()


@dataclass
class InjectingCommandSource:
    """The command source of a run: a velocity, which can be replaced, or another source."""

    value: np.ndarray  # (3,)
    replacement: Callable[[], np.ndarray] | None = None
    other: CommandSource | None = None
    stopped: Stop | None = None

    def poll(self, status: Status) -> Request:
        if self.other is not None:
            return self.other.poll(status)
        return Request(self.value if self.replacement is None else self.replacement(), autonomous=True)


@dataclass
class FaultInjector:
    """Injects faults into a run, at the bus, the policy, the command source or the robot."""

    robot: Robot
    wiring: Wiring
    body: SimulatedRobot
    bus: InjectingBus
    policy: InjectingPolicy
    command_source: InjectingCommandSource
    rng: np.random.Generator
    joint: int = field(init=False)  # of the faulty motor, random
    channel: int = field(init=False)  # its bus

    def __post_init__(self) -> None:
        self.joint = int(self.rng.integers(len(self.robot.joint_names)))
        self.channel = int(self.wiring.channel[self.joint])
        self._lookup = motor_lookup(self.wiring)

    def on_replies(self, change: Callable[[Frames, np.ndarray], Frames]) -> None:
        """Change motor replies: `change` gets a batch and its joints (k,), -1 for unknown."""

        def changed(frames: Frames) -> Frames:
            return change(frames, self._lookup[frames.channel, frames.data[:, 0]])

        self.bus.incoming = lambda batches, _: [
            frames if from_imu(frames) else changed(frames) for frames in batches
        ]

    def on_values(self, change: Callable[[np.ndarray, np.ndarray], None]) -> None:
        """Change the values that motors report.

        `change` gets values (3, n) and temperatures (n,) in joint order and modifies them. All motors must
        be in MIT mode.
        """
        n, codec = len(self.robot.joint_names), mit.Codec(self.wiring.models)

        def corrupt(frames: Frames, joint: np.ndarray) -> Frames:
            values, temperature = np.zeros((3, n)), np.zeros(n, np.uint64)
            reply = codec.decode_replies(frames.data, joint)
            values[:, joint], temperature[joint] = reply.values, reply.temperature_c
            change(values, temperature)
            head = self.wiring.motor_id.astype(np.uint64)[joint] << np.uint64(56)
            tail = temperature[joint] << np.uint64(8) | reply.error.astype(np.uint64)
            return frames._replace(data=codec.encode_replies(joint, head, values[:, joint], tail))

        self.on_replies(corrupt)

    def on_imu(self, change: Callable[[imu.Inertial], imu.Inertial]) -> None:
        """Change the IMU's reading; its counters continue."""

        def corrupt(frames: Frames) -> Frames:
            gyro, count = imu.decode_gyro(frames.data[0].tobytes())
            acceleration = imu.decode_acceleration(frames.data[1].tobytes())
            quaternion = imu.decode_quaternion(frames.data[2].tobytes())
            assert quaternion is not None
            reading = change(imu.Inertial(gyro, acceleration, quaternion))
            return frames._replace(data=imu.encode(reading, count))

        self.on_imu_frames(corrupt)

    def on_imu_frames(self, change: Callable[[Frames], Frames]) -> None:
        """Change the three frames of an IMU reading."""
        self.bus.incoming = lambda batches, _: [
            change(frames) if from_imu(frames) else frames for frames in batches
        ]

    def on_all(self, change: Callable[[Frames], Frames]) -> None:
        """Change all arriving batches."""
        self.bus.incoming = lambda batches, _: [change(frames) for frames in batches]

    def late(self, by_us: int, selects: Callable[[Frames], bool] = lambda _: True) -> None:
        """Delay some batches."""
        self.bus.incoming = late(by_us, selects)

    def falls_behind(self, share: float, selects: Callable[[Frames], bool]) -> None:
        """Put some batches into a growing queue, from which the reader takes too few.

        `share` is the growth of the batches' age per time. The batches keep their arrival times.
        """
        queued: list[tuple[int, Frames]] = []
        began: list[int] = []

        def hold(batches: Batches, now_us: int) -> Batches:
            began.append(now_us) if not began else None
            queued.extend((now_us, frames) for frames in batches if selects(frames))
            read_until = now_us - share * (now_us - began[0])
            due = [frames for at, frames in queued if at <= read_until]
            queued[:] = [(at, frames) for at, frames in queued if at > read_until]
            return [*due, *(frames for frames in batches if not selects(frames))]

        self.bus.incoming = hold

    def brake(self, joint: int, damping: float) -> None:
        """Set the damping of a joint, N m s/rad."""
        _, qvel = joint_addresses(self.body.model, self.robot)
        self.body.model.dof_damping[qvel[joint]] = damping

    def turn_over(self, quaternion: Sequence[float], height_m: float) -> None:
        """Set the orientation of the base, raised by a height. The quaternion may have any length."""
        model = self.body.model
        free = int(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
        at = int(model.jnt_qposadr[free])
        self.body.data.qpos[at + 2] += height_m
        self.body.data.qpos[at + 3 : at + 7] = np.array(quaternion) / np.linalg.norm(quaternion)


Injection = Callable[[FaultInjector], None]
