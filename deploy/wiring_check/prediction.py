"""Predicts the responses of a robot's own model to the motions of the wiring check."""

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
SEARCH_M = 2.0  # maximum height of the base


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

    def responses(self, start: np.ndarray, here: np.ndarray, motions: Motions, cause: Cause) -> np.ndarray:
        """Responses (n + 1, n + 2) of torques and of the x and y of `up` in the base frame; means in the last
        row.

        Args:
            start: joint positions reported by the motors before the motions, rad, (n,).
            here: position targets at the centre of the motions, rad, (n,).
            motions: the joints' motions.
            cause: the wiring; encoders are correct in the default pose.
        """
        data, model, n = self._data, self._model, len(here)
        ratio, about = cause.ratio, self._default
        units = cause.units(self.highest)
        pose = np.empty(n)
        pose[cause.joint] = about + (units[0] * start - about) / ratio
        self._put_down(pose)
        kp, kd, zero = units[2] * self._kp, units[3] * self._kd, np.zeros(n)
        count = round(motions.duration_s / STEP_S)
        before = round(SETTLE_S / STEP_S)
        values = np.empty((count, n + 2))
        torque = np.empty(n)
        up = data.xmat[self._base]
        for step in range(-before, count):
            position, velocity = data.qpos[self._qpos], data.qvel[self._qvel]
            seen = about + ratio * (position[cause.joint] - about)
            target = here + motions.offsets(step * STEP_S) if step >= 0 else here
            command = JointCommand(units[0] * target, zero, kp, kd, zero)
            motor_nm = motor_torque(command, seen, ratio * velocity[cause.joint], self._limits)
            torque[cause.joint] = ratio * motor_nm
            data.qfrc_applied[self._qvel] = torque + friction_torque(velocity, self._motor, torque)
            if step >= 0:
                values[step, :n] = motor_nm / units[4]
                values[step, n:] = up[6:8]
            mujoco.mj_step(model, data)
        return np.vstack(
            [
                motions.responses(np.arange(count) * STEP_S, values),
                values.mean(axis=0),
            ]
        )

    def _put_down(self, pose: np.ndarray) -> None:
        """Set the model down, level, in a pose: its lowest part touches the ground."""
        data, at = self._data, self._base_at
        mujoco.mj_resetData(self._model, data)
        data.qpos[self._qpos] = pose
        data.qpos[at + 3 : at + 7] = (1.0, 0.0, 0.0, 0.0)
        low, high = -SEARCH_M, SEARCH_M
        for _ in range(25):
            middle = (low + high) / 2
            low, high = (middle, high) if self._touches(middle) else (low, middle)
        if low == -SEARCH_M:
            raise UserError("the robot's model has no ground to stand on")
        data.qpos[at + 2] = low

    def _touches(self, height_m: float) -> bool:
        model, data = self._model, self._data
        data.qpos[self._base_at + 2] = height_m
        mujoco.mj_fwdPosition(model, data)
        touching = (model.geom_bodyid[data.contact.geom] == 0).any(axis=1) & (data.contact.dist <= 0.0)
        return bool(touching.any())
