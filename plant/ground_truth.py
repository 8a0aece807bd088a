"""Ground truth of a simulation: the true state, contacts and falls."""

from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.rotations import rotate_to_body, tilt
from footfall.plant.engines.engine import Engine
from footfall.plant.sensors import Layout
from footfall.robots.leg_bodies import NO_LEG
from footfall.robots.model import Plant

WORLD = 0  # body id
GEOM = mujoco.mjtObj.mjOBJ_GEOM
FALLEN_TILT = np.deg2rad(70.0)
COLLAPSED_SHARE = 0.4  # of the standing height


class Truth(NamedTuple):
    """The true state. Contacts, forces and torques are those of the last physics step."""

    base_position: np.ndarray  # (3,) m, world
    base_quaternion: np.ndarray  # (4,) w x y z, body to world
    base_velocity: np.ndarray  # (3,) m/s, body frame
    base_angular_velocity: np.ndarray  # (3,) rad/s, body frame
    joint_position: np.ndarray  # (n,) rad
    joint_velocity: np.ndarray  # (n,) rad/s
    motor_torque: np.ndarray  # (n,) N m at the joint, before gearbox friction
    foot_position: np.ndarray  # (feet, 3) m, world, mean of its geoms; NaN for a foot missing in the plant
    foot_velocity: np.ndarray  # (feet, 3) m/s, world
    foot_contact: np.ndarray  # (feet,) bool
    foot_force: np.ndarray  # (feet,) N, normal
    legs_touch: bool  # two different legs press on each other
    qpos: np.ndarray  # (nq,)


class GroundTruth:
    """Reads the true state of a plant from its simulation."""

    def __init__(
        self, plant: Plant, data: mujoco.MjData, engine: Engine, layout: Layout, height_m: float
    ) -> None:
        """`layout` has the indices of joints and base; `height_m` is the base's height when standing."""
        self._model, self._data, self._engine = plant.model, data, engine
        self._position, self._velocity, self._geom_position = data.qpos, data.qvel, data.geom_xpos
        self._geoms_of_foot = [geoms.tolist() for geoms in plant.feet]
        self._qpos, self._qvel = layout.qpos, layout.qvel
        self._free_qpos, self._free_qvel = layout.base_qpos, layout.base_qvel
        self._foot_of_geom = {geom: foot for foot, geoms in enumerate(plant.feet) for geom in geoms.tolist()}
        self._feet = list(self._foot_of_geom)
        self._body_of_geom = plant.model.geom_bodyid.tolist()
        self._leg_of_geom = plant.leg_of_body[plant.model.geom_bodyid].tolist()
        self._base_and_world = {plant.base, WORLD}
        self._unknown = np.full((len(plant.feet), 3), np.nan)  # for feet missing in the plant
        self._twist = np.zeros(6)
        self._lowest_height = COLLAPSED_SHARE * height_m

    def truth(self, motor_torque: np.ndarray) -> Truth:
        """The current state, with the motor torque (n,) of the last physics step."""
        qpos, qvel, first_qpos, first_qvel = self._position, self._velocity, self._free_qpos, self._free_qvel
        quaternion = qpos[first_qpos + 3 : first_qpos + 7].copy()
        position, velocity = self._unknown.copy(), self._unknown.copy()
        for foot, geoms in enumerate(self._geoms_of_foot):
            if len(geoms) == 1:  # a mean takes ten times as long
                position[foot], velocity[foot] = self._geom_position[geoms[0]], self._velocity_of(geoms[0])
            elif geoms:
                position[foot] = self._geom_position[geoms].mean(axis=0)
                velocity[foot] = np.mean([self._velocity_of(geom).copy() for geom in geoms], axis=0)
        contact, force, legs_touch = self._contacts()
        return Truth(
            base_position=qpos[first_qpos : first_qpos + 3].copy(),
            base_quaternion=quaternion,
            base_velocity=rotate_to_body(quaternion, qvel[first_qvel : first_qvel + 3]),
            base_angular_velocity=qvel[first_qvel + 3 : first_qvel + 6].copy(),
            joint_position=qpos[self._qpos].copy(),
            joint_velocity=qvel[self._qvel].copy(),
            motor_torque=motor_torque.copy(),
            foot_position=position,
            foot_velocity=velocity,
            foot_contact=contact,
            foot_force=force,
            legs_touch=legs_touch,
            qpos=qpos.copy(),
        )

    def foot_force(self) -> np.ndarray:
        """Normal force on each foot in the last physics step, N, (feet,)."""
        return self._contacts()[1]

    def fall(self) -> str | None:
        """Reason why the robot counts as fallen; None if it has not fallen."""
        qpos, first_qpos = self._position, self._free_qpos
        if tilt(qpos[first_qpos + 3 : first_qpos + 7]) > FALLEN_TILT:
            return "the base tilted past 70 degrees"
        for first, second in self._engine.touching():
            if {self._body_of_geom[first], self._body_of_geom[second]} == self._base_and_world:
                return "the base touched the ground"
        ground = min(self._geom_position[self._feet, 2].tolist()) if len(self._feet) else 0.0
        if qpos[first_qpos + 2] - ground < self._lowest_height:
            return "the base sank to the height of the feet"
        return None

    def _velocity_of(self, geom: int) -> np.ndarray:
        """Velocity of a geom's centre, m/s, world frame, (3,); valid until the next call."""
        mujoco.mj_objectVelocity(self._model, self._data, GEOM, geom, self._twist, 0)
        return self._twist[3:]

    def _contacts(self) -> tuple[np.ndarray, np.ndarray, bool]:
        """Contact and normal force, N, of each foot, (feet,) each; and `Truth.legs_touch`."""
        force, legs_touch = np.zeros(len(self._unknown)), False
        for index, geoms in enumerate(self._engine.touching()):
            first, second = (self._leg_of_geom[geom] for geom in geoms)
            between_legs = first != second and NO_LEG not in (first, second)
            feet = [self._foot_of_geom[geom] for geom in geoms if geom in self._foot_of_geom]
            if not (feet or between_legs):
                continue
            normal = self._engine.normal_force(index)
            legs_touch = legs_touch or (between_legs and normal > 0.0)
            for foot in feet:
                force[foot] += normal
        return force > 0.0, force, legs_touch
