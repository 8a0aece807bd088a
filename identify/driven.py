"""A leg's recording as prescribed motion: smooth paths, delayed commands, and the forces of the bodies."""

import mujoco
import numpy as np

from footfall.identify.leg import FixedLeg
from footfall.identify.recording import Recording
from footfall.identify.windows import first_window_s
from footfall.robots.actuator import JointCommand, friction_torque, lag_over, lagged, motor_torque
from footfall.robots.driven_motion import DrivenMotion

SMOOTHED_S = 0.015  # readings within this time on either side are used for a local cubic
MIN_POINTS = 3  # minimum number of these readings on either side
MARGIN_S = 0.06  # at either end: the longest delay plus half of a cubic's window
SETTLED_S = 0.1  # time after which the motors' state does not depend on the start of the recording


def driven_motion(
    leg: FixedLeg,
    recording: Recording,
    encoder_bias: np.ndarray,
    delay_s: np.ndarray,
    window_s: float,
    block_s: float,
) -> DrivenMotion:
    """The motion of a leg, without the learned part of its joint law.

    A delay is rounded down to whole physics steps. The remainder shifts the joint's readings, as in
    `simulate`.

    Args:
        leg: leg with its bodies and joint law.
        recording: recording of the whole robot.
        encoder_bias: encoder bias of each joint, rad, (n,).
        delay_s: delay of each joint from a command's tick to the reading of its effect, (n,).
        window_s: length of the windows that may begin at `starts`.
        block_s: length of a block; the blocks are the windows of `windows.cut`.
    """
    step_s = float(leg.model.opt.timestep)
    grid = np.arange(recording.time_s[0] + MARGIN_S, recording.time_s[-1] - MARGIN_S, step_s)
    delay_steps = np.floor(np.asarray(delay_s) / step_s)
    remainder_s = delay_s - delay_steps * step_s
    path = np.stack(
        [
            _smooth(
                recording.read_s[:, joint], recording.position[:, joint], grid + remainder, recording.period_s
            )
            for joint, remainder in zip(leg.joints, remainder_s.tolist(), strict=True)
        ],
        axis=2,
    )
    command = np.empty((len(grid), 5, leg.count))
    for column, joint in enumerate(leg.joints):
        sent = np.searchsorted(recording.time_s, grid - delay_steps[column] * step_s + 1e-9, side="right") - 1
        command[:, :, column] = recording.command[sent.clip(0)][:, :, joint]
    position, velocity, acceleration = path
    inertia, bias = _inertia_and_bias(leg, position - encoder_bias, velocity)
    torque, before = _law_torque(leg, command, position, velocity, step_s)
    needed = np.einsum("tij,tj->ti", inertia, acceleration) + bias
    starts, block = _starts(recording, grid, window_s, block_s)
    return DrivenMotion(
        step_s=step_s,
        command=command,
        position=position,
        velocity=velocity,
        acceleration=acceleration,
        inertia=inertia,
        bias=bias,
        torque=torque,
        before=before,
        missing=needed - torque - friction_torque(velocity, leg.motor, torque),
        starts=starts,
        block=block,
    )


def _starts(
    recording: Recording, grid: np.ndarray, window_s: float, block_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """Steps at which windows may begin, (S,), and the block of each window; -1 if it extends over two."""
    step_s = grid[1] - grid[0]
    length = round(window_s / step_s)
    starts = np.arange(round(SETTLED_S / step_s), len(grid) - length - 1)
    block = np.floor((grid - first_window_s(recording)) / block_s).astype(int)
    first, last = block[starts], block[starts + length]
    return starts, np.where(first == last, first, -1)


def _smooth(read_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, period_s: float) -> np.ndarray:
    """Value, first and second derivative, (3, T), from local cubics through readings."""
    half = max(MIN_POINTS, round(SMOOTHED_S / period_s))
    nearest = np.searchsorted(read_s, at_s).clip(half, len(read_s) - half - 1)
    rows = nearest[:, None] + np.arange(-half, half + 1)
    width = half * period_s
    terms = ((read_s[rows] - at_s[:, None]) / width)[..., None] ** np.arange(4)  # (T, points, 4)
    normal = np.einsum("tpi,tpj->tij", terms, terms)
    rhs = np.einsum("tpi,tp->ti", terms, values[rows])
    coefficients: np.ndarray = np.linalg.solve(normal, rhs[..., None])[..., 0]
    return coefficients[:, :3].T / np.array([[1.0], [width], [0.5 * width**2]])


def _inertia_and_bias(
    leg: FixedLeg, position: np.ndarray, velocity: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Inertia (T, n, n) and bias forces (T, n) along a path."""
    model, data = leg.model, mujoco.MjData(leg.model)
    inertia, bias = np.empty((len(position), leg.count, leg.count)), np.empty_like(position)
    for row, (q, v) in enumerate(zip(position, velocity, strict=True)):
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, inertia[row])
        bias[row] = data.qfrc_bias - data.qfrc_passive
    return inertia, bias


def _law_torque(
    leg: FixedLeg, command: np.ndarray, position: np.ndarray, velocity: np.ndarray, step_s: float
) -> tuple[np.ndarray, np.ndarray]:
    """The physical law's motor torque in each step of a path, and at the step's beginning, (T, n) each."""
    demand = motor_torque(JointCommand.of(np.moveaxis(command, 1, 0)), position, velocity, leg.motor)
    if leg.motor.lag_s is None:
        return demand, np.zeros_like(demand)
    lag, lag_state = lag_over(leg.motor.lag_s, step_s), demand[0]
    torque, before = np.empty_like(demand), np.empty_like(demand)
    for row, demanded in enumerate(demand):
        before[row] = lag_state
        torque[row], lag_state = lagged(demanded, lag_state, lag)
    return torque, before
