"""Malformed CAN frames to both ends of each maker's protocol. Not a benchmark itself: see fuzz.py.

One batch goes to the joint layer. Its next command is decoded as a motor decodes it, and checked against the
robot's limits with formulas that are independent of the joint layer's. Another batch goes to the motors.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from fuzz_tally import Tally

from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver, open_imu
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import EXTENDED, Frames, joined
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.wiring import Wiring, wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import MotorEnd, Report
from footfall.plant.motors import SimulatedMotors
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot, load_robot

ROBOT = "go1"
MODELS = ("", "DM4310", "RS02", "ODrive")  # of motors; "" stands for the robot's own
BATCH = 64  # frames between two commands, at least
TICK_S, STEP_S = 0.002, 0.001  # periods of the loop and of the motors
STEPS_A_TICK = round(TICK_S / STEP_S)
START_TIMEOUT_S = 1.0  # for a driver to read its motors' settings and to enable them
TORQUE_ROUNDING = 0.04  # share of peak torque: largest quantisation error of a frame, as in the fault table
TARGET_ROUNDING_RAD = 0.0004  # one quantum of a 16-bit position over 12.5 rad in both directions


def fuzz_frames(cases: range) -> Tally:
    """Fuzz the robot's motors and other makers', with known settings or settings still to be queried."""
    tally = Tally()
    variants = [(model, known) for model in MODELS for known in (False, True)]
    batches = range(cases.start // BATCH // len(variants), -(-cases.stop // BATCH // len(variants)))
    for model, known in variants:
        fuzz_motors_of(model, known, batches, tally)
    return tally


def fuzz_motors_of(model: str, known: bool, batches: range, tally: Tally) -> None:
    """Batches of frames for one kind of motor."""
    robot = load_robot(ROBOT)
    wiring = wiring_of(robot)
    wiring = replace(wiring, models=(model,) * len(wiring.models)) if model else wiring
    driver, end = open_driver(wiring), open_motor_end(wiring)
    joints = JointLayer(robot, driver, open_imu(wiring), TICK_S)
    motors = SimulatedMotors(end, robot.motor, len(wiring.models), {}, STEP_S)
    if known:
        start(robot, driver, joints, motors)
    joints.begin_at(robot.default_pose)
    wires, decoder = Wires(wiring, driver, end), open_motor_end(wiring)
    decoder.requests(driver.query_settings())  # as the decoder of motors that receive only commands
    label = f"{model or 'own motors'}, {'known' if known else 'queried'}"
    for batch in batches:
        rng = np.random.default_rng(batch)
        to_host, to_motors = (wires.batches(rng, from_motors) for from_motors in (True, False))
        work = partial(command_after, to_host, rng, robot, joints, decoder)
        tally.attempt(f"joint layer, {label}", batch, work)
        tally.attempt(f"motors, {label}", batch, partial(move, motors, batch, to_motors))


def start(robot: Robot, driver: Driver, joints: JointLayer, motors: SimulatedMotors) -> None:
    """Query all settings and enable all motors, as the loop does at its start."""
    readings = np.zeros((3, len(motors.enabled)))
    readings[0] = robot.default_pose
    for tick in range(round(START_TIMEOUT_S / TICK_S)):
        frames = driver.query_settings() if driver.not_ready() else driver.enable()
        step = STEPS_A_TICK * tick
        replies = [motors.answer(step, frames, readings)]
        if motors.broadcasts:
            replies += [motors.broadcast(1000 * (step + k), readings) for k in range(STEPS_A_TICK)]
        joints.absorb([batch for batch in replies if batch is not None], round(1e6 * tick * TICK_S))
        if not driver.not_ready() and not driver.not_enabled() and motors.enabled.all():
            return
    raise AssertionError(
        f"after {START_TIMEOUT_S:g} s: {driver.not_ready() or driver.not_enabled() or 'a motor is off'}"
    )


class Wires:
    """Makes random frames, and valid ones with flipped bits, in new or in reused arrays of identifiers."""

    def __init__(self, wiring: Wiring, driver: Driver, end: MotorEnd) -> None:
        n = len(wiring.models)
        commands = [
            driver.command(np.ones((5, n))),
            driver.enable(),
            driver.disable(),
            driver.query_settings(),
        ]
        connected, zeros, on = np.ones(n, bool), np.zeros((3, n)), np.ones(n, bool)
        error = np.zeros(n, np.uint64)
        replies = end.reply(slice(None), Report(zeros, error, on))
        broadcasts = [end.broadcast(1000 * k, connected, Report(zeros, error, on)) for k in range(100)]
        from_motors = [replies, *(frames for frames in broadcasts if frames is not None)]
        settings = end.settings_replies(driver.query_settings())
        from_motors += [] if settings is None else [settings]
        inertial = Frames(
            np.full(3, wiring.imu_channel), np.array(imu.IDS), np.zeros((3, 8), np.uint8), np.full(3, 8)
        )
        self._buses = len(wiring.buses)
        self._good = {True: joined([*from_motors, inertial]), False: joined(commands)}
        # A simulated bus, and some real ones, hand out the same arrays of ids again and again.
        typical = from_motors[:1] if len(replies.id) else from_motors[1:2]
        self._typical = {True: [*typical, inertial, joined([*typical, inertial])], False: commands[:3]}

    def batches(self, rng: np.random.Generator, from_motors: bool) -> list[Frames]:
        """Input of one end: a batch of `BATCH` frames, or batches in reused arrays with at least as many."""
        if rng.random() < 0.5:
            return [self._frames(rng, from_motors)]
        found: list[Frames] = []
        while sum(len(frames.id) for frames in found) < BATCH:
            found.append(with_other_data(self._typical[from_motors], rng))
        return found

    def _frames(self, rng: np.random.Generator, from_motors: bool) -> Frames:
        good = self._good[from_motors]
        rows = rng.integers(len(good.id), size=BATCH)
        channel, identifier, data, length = (np.array(part[rows]) for part in good[:4])
        random = rng.random(BATCH) < 0.5
        data[random] = rng.integers(256, size=(int(random.sum()), 8), dtype=np.uint8)
        data[~random] = flipped(data[~random], 0.1, rng)
        foreign = rng.random(BATCH) < 0.1
        identifier[foreign] = rng.integers(1 << 11, size=int(foreign.sum()))
        extended = rng.random(BATCH) < 0.02
        identifier[extended] = rng.integers(1 << 29, size=int(extended.sum())) | EXTENDED
        other_length = rng.random(BATCH) < 0.1
        length[other_length] = rng.integers(9, size=int(other_length.sum()))
        data[np.arange(8) >= length[:, None]] = 0
        other_bus = rng.random(BATCH) < 0.05
        channel[other_bus] = rng.integers(self._buses, size=int(other_bus.sum()))
        return Frames(channel, identifier, data, length)


def with_other_data(typical: Sequence[Frames], rng: np.random.Generator) -> Frames:
    """One of the batches, with its own arrays of ids, and with none, few or many data bits flipped."""
    frames = typical[int(rng.integers(len(typical)))]
    return frames._replace(data=flipped(frames.data, rng.choice([0.0, 0.01, 0.5]), rng))


def flipped(data: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Bytes (k, 8); in a share of the rows one bit is flipped."""
    bit = np.uint8(1) << rng.integers(8, size=data.shape, dtype=np.uint8)
    return data ^ (bit * (rng.random(data.shape) < share)).astype(np.uint8)


def command_after(
    batches: list[Frames], rng: np.random.Generator, robot: Robot, joints: JointLayer, decoder: MotorEnd
) -> None:
    """Let the joint layer absorb frames, then send a random command; raise if its frames are unsafe."""
    joints.absorb(batches, int(rng.integers(10**9)))
    before, (position, velocity, _) = joints.target.copy(), joints.joints.copy()
    command = rng.normal(size=(5, len(before))) * 10.0 ** rng.uniform(-2, 3, size=(5, 1))
    motor, values, kind = decoder.requests(joints.command(JointCommand(*command)))
    sent = np.full((5, len(before)), np.nan)
    sent[:, motor] = values
    target = np.where(sent[2] > 0.0, sent[0], joints.target)  # a frame without stiffness has no target
    lower, upper = robot.soft_limits
    step = robot.description.target_rate_rad_s * TICK_S
    outside = np.maximum(lower - target, target - upper)
    problems = {
        "not a command": kind is not None,
        "not finite": not np.isfinite(sent).all(),
        "outside the soft limits": bool((outside > TARGET_ROUNDING_RAD).any()),
        "a jump of a target": bool((np.abs(target - before) > step + TARGET_ROUNDING_RAD).any()),
    }
    if np.isfinite(joints.joints).all():
        problems["too much torque"] = bool((excess(sent, position, velocity, robot) > TORQUE_ROUNDING).any())
    if found := [name for name, occurs in problems.items() if occurs]:
        raise AssertionError(f"unsafe command: {', '.join(found)}")


def excess(sent: np.ndarray, position: np.ndarray, velocity: np.ndarray, robot: Robot) -> np.ndarray:
    """Torque of a command (5, n) beyond what motors can deliver, as a share of their peak, (n,).

    An accelerating motor delivers what the torque-speed line leaves of its peak, a braking one all of it.
    """
    motor = robot.motor
    target, target_velocity, kp, kd, torque = sent
    torque_nm = kp * (target - position) + kd * (target_velocity - velocity) + torque
    available = motor.stall_torque * (1.0 - np.abs(velocity) / motor.no_load_speed)
    accelerates = torque_nm * velocity > 0.0
    possible = np.where(accelerates, np.clip(available, 0.0, motor.peak_torque), motor.peak_torque)
    return (np.abs(torque_nm) - possible) / motor.peak_torque


def move(motors: SimulatedMotors, step: int, batches: list[Frames]) -> None:
    """Let motors receive frames and move; raise if their torque is not finite."""
    n = len(motors.enabled)
    for frames in batches:
        motors.answer(step, frames, np.zeros((3, n)))
    torque = motors.torque(step, np.zeros(n), np.zeros(n))
    if not np.isfinite(torque).all():
        raise AssertionError("torque is not finite")
