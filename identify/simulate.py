"""Simulates many candidates of a leg over many windows: the joint law here, the bodies in MuJoCo."""

import copy
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco import rollout

from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import Values
from footfall.identify.windows import Windows
from footfall.robots.actuator import JointCommand, friction_torque, lag_over, lagged, motor_torque
from footfall.robots.actuator_net import inputs_of, learned_torque


class Prediction(NamedTuple):
    """Simulated encoder and torque readings of K candidates: (K, W, R, n)."""

    position: np.ndarray  # rad
    torque: np.ndarray  # N m


def simulate(leg: FixedLeg, windows: Windows, values: Values, start: np.ndarray) -> Prediction:
    """Simulated readings of candidates.

    Commands take effect at whole physics steps. The remainder of a delay is applied to the readings instead:
    only the sum of both delays is observable, and a command spread over two steps would look like a lag.

    Args:
        leg: nominal leg.
        windows: commands, and times of readings.
        values: parameter values of K candidates.
        start: encoder position and velocity at each window's start, (K, W, 2, n).
    """
    count, width, n = len(values.delay_s), windows.width, leg.count
    steps = len(windows.command) - windows.margin
    models = [model for model in _models(leg, values) for _ in range(width)]
    whole, share = _delays(values.delay_s, windows.step_s)
    rest_s = windows.step_s * share  # from a window's start to the first physics step
    velocity = start[:, :, 1] + rest_s * windows.acceleration
    position = start[:, :, 0] - values.encoder_bias + rest_s * velocity
    state = np.zeros((count * width, 1 + 2 * n))
    state[:, 1 : 1 + n] = position.reshape(-1, n)
    state[:, 1 + n :] = velocity.reshape(-1, n)
    next_state = np.zeros((count * width, 1, 1 + 2 * n))
    force, sensors = np.zeros((count * width, 1, n)), np.zeros((count * width, 1, 0))
    datas = [mujoco.MjData(leg.model)]
    spec = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
    lag = None if values.motor.lag_s is None else lag_over(values.motor.lag_s, windows.step_s)
    before: np.ndarray | None = None  # torque at the end of the previous step
    memory: np.ndarray | None = None  # state of the learned part of the joint law
    path, torques = np.empty((steps + 1, count, width, n)), np.empty((steps + 1, count, width, n))
    with rollout.Rollout(nthread=0) as runner:
        for step in range(steps):
            states = state.reshape(count, width, -1)
            joint_position, joint_velocity = states[:, :, 1 : 1 + n], states[:, :, 1 + n :]
            path[step] = joint_position
            sent = _command(windows.command, windows.margin + step - whole)
            command = JointCommand(
                sent[:, :, 0],
                sent[:, :, 1],
                sent[:, :, 2] * values.kp,
                sent[:, :, 3] * values.kd,
                sent[:, :, 4],
            )
            demand = motor_torque(command, joint_position + values.encoder_bias, joint_velocity, values.motor)
            if lag is None:
                torque = demand
            else:
                torque, before = lagged(demand, demand if before is None else before, lag)
            torques[step + 1] = torque
            joint_torque = torque + friction_torque(joint_velocity, values.motor, torque)
            if leg.net is not None:
                inputs = inputs_of(
                    leg.net, command, joint_position + values.encoder_bias, joint_velocity, torque
                )
                if memory is None:
                    memory = np.repeat(inputs[..., None, :], len(leg.net.memory_s), axis=-2)
                learned = learned_torque(leg.net, inputs, memory, windows.step_s)
                joint_torque, memory = joint_torque + learned.torque, learned.memory
            force[:, 0] = joint_torque.reshape(-1, n)
            runner.rollout(
                models, datas, state, force, control_spec=spec, skip_checks=True, nstep=1, state=next_state,
                sensordata=sensors,
            )  # fmt: skip
            state[:] = next_state[:, 0]
    path[steps] = state.reshape(count, width, -1)[:, :, 1 : 1 + n]
    torques[0] = torques[1]
    steps_at = windows.time_s / windows.step_s - share[:, :, None]
    return Prediction(
        _read(path, steps_at) + values.encoder_bias[:, None],
        _read(torques, steps_at),  # a motor reports the mean over the step before its reading
    )


def _models(leg: FixedLeg, values: Values) -> list[mujoco.MjModel]:
    """One model per candidate."""
    models = []
    moving = leg.model.jnt_bodyid
    for armature, scale, com in zip(values.armature, values.link_mass, values.link_com, strict=True):
        model = copy.copy(leg.model)
        model.dof_armature[:] = armature
        model.body_mass[moving] *= scale
        model.body_inertia[moving] *= scale[:, None]
        model.body_ipos[moving] *= com[:, None]
        models.append(model)
    return models


def _delays(delay_s: np.ndarray, step_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Each delay as whole steps, (K, n), and the remaining fraction of a step, (K, 1, n)."""
    steps = delay_s / step_s
    whole = np.floor(steps).astype(int)
    return whole, (steps - whole)[:, None, :]


def _command(command: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Commands in effect, (K, W, 5, n), from commands on the physics grid, (T, W, 5, n), and rows (K, n)."""
    joint = np.arange(command.shape[3])
    active: np.ndarray = command[rows, :, :, joint].transpose(0, 2, 3, 1)
    return active


def _read(path: np.ndarray, steps_at: np.ndarray) -> np.ndarray:
    """Interpolate a path (S + 1, K, W, n) at times in steps, (K, W, R, n)."""
    last = len(path) - 1
    before = np.floor(steps_at).astype(int).clip(0, last - 1)
    share = steps_at - before
    candidate, window, _, joint = np.ogrid[tuple(slice(size) for size in steps_at.shape)]
    low = path[before, candidate, window, joint]
    readings: np.ndarray = low + share * (path[before + 1, candidate, window, joint] - low)
    return readings
