"""Predicts the responses of a robot's own model to the motions of the wiring check."""

from collections.abc import Iterator

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.wiring_check.causes import Cause
from footfall.deploy.wiring_check.motions import Motions
from footfall.robots.actuator import JointCommand, friction_torque, motor_torque
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, read_plant

STEP_S = 0.002
SETTLE_S = 0.5  # settling time of the model before the motions
MAX_BASE_HEIGHT_M = 2.0  # limit of the search for the height at which the robot touches the ground


class Prediction:
    """The robot's own model on level ground, with a given wiring of its motors."""

    def __init__(self, robot: Robot, kp: np.ndarray, kd: np.ndarray, highest: np.ndarray) -> None:
        """Load the model.

        Args:
            robot: the robot.
            kp: stiffness that holds its joints, N m/rad, (n,).
            kd: damping, N m s/rad, (n,).
            highest: upper limits of its motors' commands, (5, n): the rows of a `JointCommand`.
        """
        plant = read_plant(robot)
        self._model, self._motor, self._base = plant.model, plant.motor, plant.base
        self._model.opt.timestep = STEP_S
        self._limits, self.highest = robot.motor, highest
        self._data = mujoco.MjData(self._model)
        self._qpos, self._qvel = joint_addresses(self._model, robot)
        self._base_at = int(self._model.jnt_qposadr[self._model.body_jntadr[plant.base]])
        self._kp, self._kd, self._default = kp, kd, robot.default_pose

    def responses(self, start: np.ndarray, centre: np.ndarray, motions: Motions, cause: Cause) -> np.ndarray:
        """Responses to all motions, and the means of the values in the last row, (n + 1, n + 2).

        Arguments as for `one_by_one`.
        """
        values = np.empty((_steps(motions), len(centre) + 2))
        rows = list(self._simulated(start, centre, motions, cause, values))
        return np.vstack([*rows, values.mean(axis=0)])

    def one_by_one(
        self, start: np.ndarray, centre: np.ndarray, motions: Motions, cause: Cause
    ) -> Iterator[np.ndarray]:
        """Yield the response to one motion after the other, (n + 2,): torques, and x and y of `up`.

        The model is simulated only as far as responses are taken, one cause at a time.

        Args:
            start: joint positions reported by the motors before the motions, rad, (n,).
            centre: position targets at the centre of the motions, rad, (n,).
            motions: the joints' motions.
            cause: the wiring; encoders are correct in the default pose.
        """
        values = np.empty((_steps(motions), len(centre) + 2))
        yield from self._simulated(start, centre, motions, cause, values)

    def _simulated(
        self, start: np.ndarray, centre: np.ndarray, motions: Motions, cause: Cause, values: np.ndarray
    ) -> Iterator[np.ndarray]:
        """Fill `values` step by step, and yield each response at the end of its motion."""
        data, model, n = self._data, self._model, len(centre)
        ratio, reference = cause.ratio, self._default
        units = cause.units(self.highest)
        pose = np.empty(n)
        pose[cause.joint] = reference + (units[0] * start - reference) / ratio
        self._put_down(pose)
        kp, kd, zero = units[2] * self._kp, units[3] * self._kd, np.zeros(n)
        times = np.arange(len(values)) * STEP_S
        ends = np.searchsorted(times, [motions.end_s(joint) for joint in range(n)]).tolist()
        torque = np.empty(n)
        up = data.xmat[self._base]
        moved = 0
        for step in range(-round(SETTLE_S / STEP_S), len(values)):
            position, velocity = data.qpos[self._qpos], data.qvel[self._qvel]
            reported = reference + ratio * (position[cause.joint] - reference)
            target = centre + motions.offsets(step * STEP_S) if step >= 0 else centre
            command = JointCommand(units[0] * target, zero, kp, kd, zero)
            motor_nm = motor_torque(command, reported, ratio * velocity[cause.joint], self._limits)
            torque[cause.joint] = ratio * motor_nm
            data.qfrc_applied[self._qvel] = torque + friction_torque(velocity, self._motor, torque)
            if step >= 0:
                values[step, :n] = motor_nm / units[4]
                values[step, n:] = up[6:8]
            mujoco.mj_step(model, data)
            if moved < n and step + 1 == ends[moved]:
                yield motions.response(moved, times, values)
                moved += 1

    def _put_down(self, pose: np.ndarray) -> None:
        """Set the model down, level, in a pose: its lowest part touches the ground."""
        data, at = self._data, self._base_at
        mujoco.mj_resetData(self._model, data)
        data.qpos[self._qpos] = pose
        data.qpos[at + 3 : at + 7] = (1.0, 0.0, 0.0, 0.0)
        low, high = -MAX_BASE_HEIGHT_M, MAX_BASE_HEIGHT_M
        for _ in range(25):
            middle = (low + high) / 2
            low, high = (middle, high) if self._touches(middle) else (low, middle)
        if low == -MAX_BASE_HEIGHT_M:
            raise UserError("the robot's model has no ground to stand on")
        data.qpos[at + 2] = low

    def _touches(self, height_m: float) -> bool:
        model, data = self._model, self._data
        data.qpos[self._base_at + 2] = height_m
        mujoco.mj_fwdPosition(model, data)
        touching = (model.geom_bodyid[data.contact.geom] == 0).any(axis=1) & (data.contact.dist <= 0.0)
        return bool(touching.any())


def _steps(motions: Motions) -> int:
    return round(motions.duration_s / STEP_S)
