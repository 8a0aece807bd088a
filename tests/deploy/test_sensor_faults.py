"""Readings that contradict each other are found and named, and those of a healthy robot never do."""

from collections.abc import Callable

import numpy as np
import pytest

from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import imu, mit, mit_driver
from footfall.deploy.frames import Frames, joined
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import DAMPED, Mode
from footfall.deploy.wiring import wire
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import load_randomisation
from footfall.domain_rand.sample import draw
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot

AT_S = 0.5  # of walking, when a fault begins
NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)
Inject = Callable[[SimulatedRobot, Robot], None]
OnFrames = Callable[[Frames], Frames]

# -- faults ------------------------------------------------------------------------------------------


def on_imu(change: Callable[[imu.Inertial], imu.Inertial]) -> Inject:
    """The IMU reads something else; its counters go on."""

    def corrupt(frames: Frames) -> Frames:
        if frames.id[0] != imu.GYRO_ID:
            return frames
        gyro, count = imu.decode_gyro(frames.data[0].tobytes())
        acceleration = imu.decode_acceleration(frames.data[1].tobytes())
        quaternion = imu.decode_quaternion(frames.data[2].tobytes())
        assert quaternion is not None
        return frames._replace(data=imu.encode(change(imu.Inertial(gyro, acceleration, quaternion)), count))

    return lambda body, _: setattr(body.faults, "on_wire", corrupt)


def frozen(*parts: str) -> Inject:
    kept: list[imu.Inertial] = []

    def freeze(reading: imu.Inertial) -> imu.Inertial:
        kept.append(reading)
        return reading._replace(**{part: getattr(kept[0], part) for part in parts})

    return on_imu(freeze)


def turned(degrees: float) -> Callable[[imu.Inertial], imu.Inertial]:
    """A quaternion that is rolled by an angle: as of an IMU that came loose."""
    half = np.deg2rad(degrees) / 2
    c, s = np.cos(half), np.sin(half)

    def turn(reading: imu.Inertial) -> imu.Inertial:
        w, x, y, z = reading.quaternion
        return reading._replace(quaternion=[w * c - x * s, w * s + x * c, y * c + z * s, z * c - y * s])

    return turn


def on_imu_frame(identifier: int, change: OnFrames) -> Inject:
    def corrupt(frames: Frames) -> Frames:
        if frames.id[0] != imu.GYRO_ID:
            return frames
        row = np.flatnonzero(frames.id == identifier)
        rest = frames.take(frames.id != identifier)
        changed = change(frames.take(row))
        return joined([rest, changed])

    return lambda body, _: setattr(body.faults, "on_wire", corrupt)


def lost(frames: Frames) -> Frames:
    return frames.take(np.zeros(0, dtype=int))


def zeros(frames: Frames) -> Frames:
    return frames._replace(data=np.zeros_like(frames.data))


def cut(frames: Frames) -> Frames:
    data = frames.data.copy()
    data[:, 2:] = 0
    return frames._replace(data=data, length=np.full(len(data), 2))


def on_motors(change: Callable[[np.ndarray, np.ndarray], None]) -> Inject:
    """Motors report something else: values (3, 12) and temperatures (12,) are changed in place."""

    def inject(body: SimulatedRobot, robot: Robot) -> None:
        wiring = wire(robot)
        codec = mit.Codec(wiring.models)

        def corrupt(frames: Frames) -> Frames:
            joint = np.array(
                [
                    np.flatnonzero((wiring.channel == channel) & (wiring.motor_id == motor))[0]
                    for channel, motor in zip(frames.channel, frames.data[:, 0], strict=True)
                    if channel < len(wiring.buses)
                ]
            )
            values, temperature = np.zeros((3, 12)), np.zeros(12, np.uint64)
            reply = codec.decode_replies(frames.data, joint)
            values[:, joint], temperature[joint] = reply.values, reply.temperature_c
            change(values, temperature)
            head = wiring.motor_id.astype(np.uint64)[joint] << np.uint64(56)
            tail = temperature[joint] << np.uint64(8)
            return frames._replace(data=codec.encode_replies(joint, head, values[:, joint], tail))

        body.faults.on_wire = lambda frames: frames if frames.id[0] >= imu.GYRO_ID else corrupt(frames)

    return inject


POSITION, TORQUE = 0, 2  # rows of what motors say


def stops(part: int, joint: int) -> Inject:
    """One of a joint's position, velocity and torque, by its row, stays what it was."""
    kept: list[float] = []

    def freeze(values: np.ndarray, _: np.ndarray) -> None:
        if values[:, joint].any():
            kept.append(values[part, joint])
            values[part, joint] = kept[0]

    return on_motors(freeze)


def position_jumps(joint: int, by: float) -> Inject:
    def shift(values: np.ndarray, _: np.ndarray) -> None:
        values[0, joint] += by

    return on_motors(shift)


def velocity_stops(joint: int) -> Inject:
    kept: list[float] = []

    def freeze(values: np.ndarray, _: np.ndarray) -> None:
        if values[:, joint].any():
            kept.append(values[1, joint])
            values[1, joint] = kept[0]

    return on_motors(freeze)


def heats(joint: int) -> Inject:
    return on_motors(lambda _, temperature: temperature.__setitem__(joint, 90))


def swapped_ids(body: SimulatedRobot, robot: Robot) -> None:
    """Motors 1 and 2 of the first bus answer under each other's id."""
    other = {1: 2, 2: 1}

    def swap(frames: Frames) -> Frames:
        if frames.id[0] >= imu.GYRO_ID:
            return frames
        data, identifier = frames.data.copy(), frames.id.copy()
        for row in np.flatnonzero((frames.channel == 0) & (data[:, 0] < 3)):
            data[row, 0] = other[int(data[row, 0])]
            identifier[row] = mit_driver.REPLY_ID + int(data[row, 0])
        return frames._replace(data=data, id=identifier)

    body.faults.on_wire = swap


def sticks(joint: int) -> Inject:
    return lambda body, _: body.faults.motors.stuck.__setitem__(joint, True)


def reboots(*joints: int) -> Inject:
    return lambda body, _: body.reboot(np.array(joints))


def pulls_the_other_way(joint: int) -> Inject:
    def inject(body: SimulatedRobot, _: Robot) -> None:
        motor = body._motors._motor
        body._motors._motor = motor._replace(strength=np.where(np.arange(12) == joint, -1.0, motor.strength))

    return inject


FAULTS = {
    "acceleration lost": (on_imu_frame(0x301, lost), "no new IMU reading (acceleration)", 0.06),
    "quaternion lost": (on_imu_frame(0x302, lost), "no new IMU reading (quaternion)", 0.06),
    "quaternion of zeros": (on_imu_frame(0x302, zeros), "no new IMU reading (quaternion)", 0.06),
    "quaternion cut": (on_imu_frame(0x302, cut), "no new IMU reading (quaternion)", 0.06),
    "gyro cut": (on_imu_frame(0x300, cut), "no new IMU reading (gyro)", 0.06),
    "IMU stuck": (frozen(*imu.Inertial._fields), "the IMU: its ", 0.1),
    "acceleration stuck": (frozen("acceleration"), "the IMU: its acceleration has repeated itself", 0.1),
    "quaternion stuck": (frozen("quaternion"), "the IMU: its quaternion", 0.1),
    "gyro turned round": (
        on_imu(lambda reading: reading._replace(gyro=[-5.0 * rate for rate in reading.gyro])),
        "the IMU: its quaternion turned by",
        0.6,
    ),
    "IMU came loose": (on_imu(turned(30.0)), "the IMU: its quaternion turned by", 0.05),
    "encoder stuck": (stops(POSITION, 4), "FL_thigh_joint (can1, id 2): its position ", 0.3),
    "hip's encoder stuck": (stops(POSITION, 3), "FL_hip_joint (can1, id 1): its position ", 1.2),
    "velocity stuck": (velocity_stops(4), "FL_thigh_joint (can1, id 2): its ", 0.4),
    "torque stuck": (stops(TORQUE, 5), "FL_calf_joint (can1, id 3): the motor repeats one torque", 0.3),
    "acceleration upside down": (
        on_imu(lambda reading: reading._replace(acceleration=[-a for a in reading.acceleration])),
        "the IMU: on average its acceleration is off gravity by",
        0.6,
    ),
    "encoder jumps": (position_jumps(10, 0.3), "RL_thigh_joint (can3, id 2): its position changed", 0.05),
    "encoder loses a turn": (position_jumps(7, -6.28), "RR_thigh_joint (can2, id 2): reads", 0.05),
    "ids swapped": (swapped_ids, "FR_hip_joint (can0, id 1): ", 0.05),
    # Position, velocity and torque repeat themselves: which is noticed first depends on the leg's step.
    "one reply over and over": (
        sticks(5),
        "FL_calf_joint (can1, id 3): the motor repeats one torque"
        " | FL_calf_joint (can1, id 3): its position or velocity repeats itself"
        " | FL_calf_joint (can1, id 3): it repeats one reading",
        0.2,
    ),
    # A rebooted motor reports no torque, which is one torque over and over.
    "motor rebooted": (
        reboots(2),
        "FR_calf_joint (can0, id 3): the motor repeats one torque"
        " | FR_calf_joint (can0, id 3): the motor has reported no torque",
        0.3,
    ),
    "all motors rebooted": (
        reboots(*range(12)),
        ": the motor repeats one torque | : the motor has reported no torque",
        0.2,
    ),
    "motor pulls the other way": (
        pulls_the_other_way(8),
        "RR_calf_joint (can2, id 3): the motor pulls the other way",
        0.4,
    ),
    "motor hot": (heats(6), "RR_hip_joint (can2, id 1): the motor is at 90 degrees", 0.03),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_in_a_walk_is_named_in_time_and_damps(go1: Robot, name: str) -> None:
    inject, says, within_s = FAULTS[name]
    walked: list[float] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking:
            if loop.walking_s >= AT_S and not walked:
                inject(body, go1)
            walked.append(loop.walking_s) if loop.walking_s >= AT_S else None
        elif loop.state.mode in DAMPED:
            damped.append(loop.now_us)

    damped: list[int] = []
    trace = run_episode(go1, load_policy("go1-flat", go1), walk(), watch)
    assert trace.final_state == "ESTOP", trace.faults
    assert len(trace.faults) == 1
    assert any(message in trace.faults[0] for message in says.split(" | "))
    assert walked[-1] - AT_S <= within_s
    assert len(damped) > 200


def walk(**changes: object) -> Episode:
    settings = {
        "command_source": lambda _: np.array([0.6, 0.2, -0.5]),
        "duration_s": 2.0,
        "config": DeployConfig(stand_s=0.6),
        "record": False,
        **changes,
    }
    return Episode(**settings)  # type: ignore[arg-type]


@pytest.mark.parametrize("degrees", [15.0, -20.0])
def test_an_imu_that_is_mounted_askew_is_seen_before_the_robot_walks(go1: Robot, degrees: float) -> None:
    modes: set[Mode] = set()

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        modes.add(loop.state.mode)
        if body.faults.on_wire is None:
            on_imu(turned(degrees))(body, go1)

    trace = run_episode(go1, load_policy("stand", go1), walk(config=DeployConfig(stand_s=1.0)), watch)
    assert "the IMU: " in trace.faults[0]
    assert Mode.WALKING not in modes


@pytest.mark.parametrize("seed", [3, 4])
@pytest.mark.parametrize("policy", ["go1-flat", "trot"])
def test_a_pushed_robot_that_differs_from_the_nominal_one_raises_no_alarm(
    go1: Robot, policy: str, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    sample = draw(load_randomisation(), lambda count: rng.uniform(size=count), 12, 13)
    sample["action_delay_s"] = np.array(0.004)
    pushes = (Push(0.4, (0.5, 0.5, 0.0)), Push(1.4, (-0.5, 0.5, 0.0)))
    episode = walk(seed=seed, duration_s=2.5, noise=NOISE, sample=sample, pushes=pushes)
    trace = run_episode(go1, load_policy(policy, go1), episode)
    assert trace.faults == ()


def test_a_joint_rate_as_low_as_the_policys_raises_no_alarm(go1: Robot) -> None:
    """A motor settles between two commands there: what they asked for at first is long gone."""
    config = DeployConfig(stand_s=0.6, joint_rate_hz=50)
    trace = run_episode(go1, load_policy("go1-flat", go1), walk(config=config, noise=NOISE))
    assert trace.faults == ()


def test_a_robot_that_stands_still_raises_no_alarm(go1: Robot) -> None:
    """Its readings repeat themselves for as long as it stands."""
    trace = run_episode(
        go1, load_policy("stand", go1), walk(command_source=lambda _: np.zeros(3), duration_s=2.0)
    )
    assert trace.faults == ()
