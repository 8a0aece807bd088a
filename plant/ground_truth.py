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
        self._qpos, self._qvel, self._geom_position = data.qpos, data.qvel, data.geom_xpos
        self._geoms_of_foot = [geoms.tolist() for geoms in plant.feet]
        self._joint_qpos, self._joint_qvel = layout.qpos, layout.qvel  # indices
        self._base_qpos, self._base_qvel = layout.base_qpos, layout.base_qvel  # first index of each
        self._foot_geoms = plant.foot_geoms
        self._foot_of_geom: list[int | None] = [None] * plant.model.ngeom
        for foot, geoms in enumerate(plant.feet):
            for geom in geoms.tolist():
                self._foot_of_geom[geom] = foot
        self._one_geom_per_foot = all(len(geoms) == 1 for geoms in plant.feet)
        self._body_of_geom = plant.model.geom_bodyid.tolist()
        self._leg_of_geom = plant.leg_of_body[plant.model.geom_bodyid].tolist()
        self._base_and_world = (plant.base, WORLD), (WORLD, plant.base)
        self._unknown_positions = np.full((len(plant.feet), 3), np.nan)  # for feet missing in the plant
        self._twists = np.zeros((len(self._foot_geoms), 6))  # angular and linear velocity of each foot geom
        self._twist_of = list(self._twists)
        self._min_height_m = COLLAPSED_SHARE * height_m

    def truth(self, motor_torque: np.ndarray) -> Truth:
        """The current state, with the motor torque (n,) of the last physics step."""
        qpos, qvel, first_qpos, first_qvel = self._qpos, self._qvel, self._base_qpos, self._base_qvel
        quaternion = qpos[first_qpos + 3 : first_qpos + 7].copy()
        position, velocity = self._foot_motion()
        contact, force, legs_touch = self._contacts()
        return Truth(
            base_position=qpos[first_qpos : first_qpos + 3].copy(),
            base_quaternion=quaternion,
            base_velocity=rotate_to_body(quaternion, qvel[first_qvel : first_qvel + 3]),
            base_angular_velocity=qvel[first_qvel + 3 : first_qvel + 6].copy(),
            joint_position=qpos[self._joint_qpos].copy(),
            joint_velocity=qvel[self._joint_qvel].copy(),
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
        qpos, first_qpos = self._qpos, self._base_qpos
        if tilt(qpos[first_qpos + 3 : first_qpos + 7]) > FALLEN_TILT:
            return "the base tilted past 70 degrees"
        for first, second in self._engine.touching():
            if (self._body_of_geom[first], self._body_of_geom[second]) in self._base_and_world:
                return "the base touched the ground"
        ground = min(self._geom_position[self._foot_geoms, 2].tolist()) if len(self._foot_geoms) else 0.0
        if qpos[first_qpos + 2] - ground < self._min_height_m:
            return "the base sank to the height of the feet"
        return None

    def _foot_motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Position m and velocity m/s of each foot, world frame, (feet, 3) each: means over its geoms."""
        for geom, twist in zip(self._foot_geoms, self._twist_of, strict=True):
            mujoco.mj_objectVelocity(self._model, self._data, GEOM, geom, twist, 0)
        positions, velocities = self._geom_position[self._foot_geoms], self._twists[:, 3:]
        if self._one_geom_per_foot:  # a mean takes ten times as long
            return positions, velocities.copy()
        position, velocity = self._unknown_positions.copy(), self._unknown_positions.copy()
        first = 0
        for foot, geoms in enumerate(self._geoms_of_foot):
            rows = slice(first, first := first + len(geoms))
            if geoms:
                position[foot], velocity[foot] = positions[rows].mean(axis=0), velocities[rows].mean(axis=0)
        return position, velocity

    def _contacts(self) -> tuple[np.ndarray, np.ndarray, bool]:
        """Contact and normal force, N, of each foot, (feet,) each; and `Truth.legs_touch`."""
        forces, legs_touch = [0.0] * len(self._unknown_positions), False
        leg_of, foot_of = self._leg_of_geom, self._foot_of_geom
        for index, (first, second) in enumerate(self._engine.touching()):
            between_legs = leg_of[first] != leg_of[second] and NO_LEG not in (leg_of[first], leg_of[second])
            feet = foot_of[first], foot_of[second]
            if feet == (None, None) and not between_legs:
                continue
            normal = self._engine.normal_force(index)
            legs_touch = legs_touch or (between_legs and normal > 0.0)
            for foot in feet:
                if foot is not None:
                    forces[foot] += normal
        force = np.array(forces)
        return force > 0.0, force, legs_touch
