"""Ground truth of a simulation: the true state, contacts and falls."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.rotations import rotate_to_body, tilt
from footfall.plant.engines.engine import Engine
from footfall.plant.sensors import Layout
from footfall.robots.leg_bodies import NO_LEG
from footfall.robots.model import Plant

WORLD = 0  # body id
FALLEN_TILT = np.deg2rad(70.0)
COLLAPSED_SHARE = 0.4  # of the standing height


class Snapshot(NamedTuple):
    """Raw state from which the true state is computed. Taking it costs a fraction of the computation.

    The arrays are copies from MuJoCo's `MjData`, except torque and contacts.
    """

    qpos: np.ndarray
    qvel: np.ndarray
    motor_torque: np.ndarray  # (n,) N m
    geom_position: np.ndarray  # (geoms, 3) m, world
    twist: np.ndarray  # (bodies, 6) angular and linear velocity, in world axes, at `centre`
    centre: np.ndarray  # (bodies, 3) m, world
    touching: list[list[int]]  # the two geoms of each contact
    normal_force: list[float]  # N, of each contact of a leg or foot; 0 for others


class Truth(NamedTuple):
    """The true state. Contacts, forces and torques are those of the last physics step.

    Of T snapshots, each array has a further first axis.
    """

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
    legs_touch: np.ndarray  # () bool, two different legs press on each other
    qpos: np.ndarray  # (nq,)


class GroundTruth:
    """Reads the true state of a plant from its simulation."""

    def __init__(
        self, plant: Plant, data: mujoco.MjData, engine: Engine, layout: Layout, height_m: float
    ) -> None:
        """`layout` has the indices of joints and base; `height_m` is the base's height when standing."""
        self._engine = engine
        self._qpos, self._qvel, self._geom_position = data.qpos, data.qvel, data.geom_xpos
        self._twist, self._centre = data.cvel, data.subtree_com
        self._layout = layout
        self._foot_geoms = plant.foot_geoms
        self._foot_bodies = plant.model.geom_bodyid[plant.foot_geoms]
        self._foot_roots = plant.model.body_rootid[self._foot_bodies]
        self._count_of_foot = [len(geoms) for geoms in plant.feet]  # numbers of geoms
        self._one_geom_per_foot = all(count == 1 for count in self._count_of_foot)
        self._foot_of_geom: list[int | None] = [None] * plant.model.ngeom
        for foot, geoms in enumerate(plant.feet):
            for geom in geoms.tolist():
                self._foot_of_geom[geom] = foot
        self._body_of_geom = plant.model.geom_bodyid.tolist()
        self._leg_of_geom = plant.leg_of_body[plant.model.geom_bodyid].tolist()
        self._on_leg = [
            leg != NO_LEG or foot is not None
            for leg, foot in zip(self._leg_of_geom, self._foot_of_geom, strict=True)
        ]
        self._base_and_world = (plant.base, WORLD), (WORLD, plant.base)
        self._min_height_m = COLLAPSED_SHARE * height_m

    def snapshot(self, motor_torque: np.ndarray) -> Snapshot:
        """The current state, with the motor torque (n,) of the last physics step."""
        touching = self._engine.touching()
        return Snapshot(
            self._qpos.copy(),
            self._qvel.copy(),
            motor_torque,
            self._geom_position.copy(),
            self._twist.copy(),
            self._centre.copy(),
            touching,
            self._normal_forces(touching),
        )

    def truth(self, motor_torque: np.ndarray) -> Truth:
        """The current state, with the motor torque (n,) of the last physics step."""
        return Truth(*(part[0] for part in self.truths([self.snapshot(motor_torque)])))

    def truths(self, snapshots: Sequence[Snapshot]) -> Truth:
        """The states of T snapshots, at least one: arrays (T, ...)."""
        parts = list(zip(*snapshots, strict=True))
        qpos, qvel, torque, geom_position, twist, centre = map(np.array, parts[:6])
        layout = self._layout
        first_qpos, first_qvel = layout.base_qpos, layout.base_qvel
        quaternion = qpos[:, first_qpos + 3 : first_qpos + 7]
        position, velocity = self._foot_motion(geom_position, twist, centre)
        force = np.array([self._foot_forces(each) for each in snapshots])
        return Truth(
            base_position=qpos[:, first_qpos : first_qpos + 3],
            base_quaternion=quaternion,
            base_velocity=rotate_to_body(quaternion, qvel[:, first_qvel : first_qvel + 3]),
            base_angular_velocity=qvel[:, first_qvel + 3 : first_qvel + 6],
            joint_position=qpos[:, layout.qpos],
            joint_velocity=qvel[:, layout.qvel],
            motor_torque=torque,
            foot_position=position,
            foot_velocity=velocity,
            foot_contact=force > 0.0,
            foot_force=force,
            legs_touch=np.array([self._legs_touch(each) for each in snapshots]),
            qpos=qpos,
        )

    def foot_force(self) -> np.ndarray:
        """Normal force on each foot in the last physics step, N, (feet,)."""
        touching = self._engine.touching()
        return np.array(self._sum_by_foot(touching, self._normal_forces(touching)))

    def fall(self, snapshot: Snapshot) -> str | None:
        """Reason why the robot counts as fallen; None if it has not fallen."""
        qpos, first_qpos = snapshot.qpos, self._layout.base_qpos
        if tilt(qpos[first_qpos + 3 : first_qpos + 7]) > FALLEN_TILT:
            return "the base tilted past 70 degrees"
        for first, second in snapshot.touching:
            if (self._body_of_geom[first], self._body_of_geom[second]) in self._base_and_world:
                return "the base touched the ground"
        heights = snapshot.geom_position[:, 2].tolist()
        ground = min((heights[geom] for geom in self._foot_geoms), default=0.0)
        if qpos[first_qpos + 2] - ground < self._min_height_m:
            return "the base sank to the height of the feet"
        return None

    def _normal_forces(self, touching: list[list[int]]) -> list[float]:
        """Normal force of each contact of a leg or foot, N; 0 for others."""
        on_leg, normal_force = self._on_leg, self._engine.normal_force
        return [
            normal_force(index) if on_leg[first] or on_leg[second] else 0.0
            for index, (first, second) in enumerate(touching)
        ]

    def _foot_motion(
        self, geom_position: np.ndarray, twist: np.ndarray, centre: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Positions m and velocities m/s of the feet, world frame, (T, feet, 3) each: means over their geoms.

        The arguments are those fields of T snapshots, with a further first axis. The velocity of a point is
        v + w x r, with r from `centre` to the point.
        """
        positions, twists = geom_position[:, self._foot_geoms], twist[:, self._foot_bodies]
        arms = positions - centre[:, self._foot_roots]
        velocities = twists[..., 3:] + _crosses(twists, arms)
        if self._one_geom_per_foot:
            return positions, velocities
        means = np.full((2, len(positions), len(self._count_of_foot), 3), np.nan)
        start = 0
        for foot, count in enumerate(self._count_of_foot):
            rows = slice(start, start := start + count)
            if count:  # 0 for a foot that is missing in the plant
                means[0, :, foot] = positions[:, rows].mean(axis=1)
                means[1, :, foot] = velocities[:, rows].mean(axis=1)
        return means[0], means[1]

    def _foot_forces(self, snapshot: Snapshot) -> list[float]:
        return self._sum_by_foot(snapshot.touching, snapshot.normal_force)

    def _sum_by_foot(self, touching: list[list[int]], normal_force: list[float]) -> list[float]:
        """Normal force on each foot, N."""
        forces = [0.0] * len(self._count_of_foot)
        for geoms, normal in zip(touching, normal_force, strict=True):
            for geom in geoms:
                foot = self._foot_of_geom[geom]
                if foot is not None:
                    forces[foot] += normal
        return forces

    def _legs_touch(self, snapshot: Snapshot) -> bool:
        """See `Truth.legs_touch`."""
        leg_of = self._leg_of_geom
        return any(
            normal > 0.0 and NO_LEG not in (leg_of[first], leg_of[second]) and leg_of[first] != leg_of[second]
            for (first, second), normal in zip(snapshot.touching, snapshot.normal_force, strict=True)
        )


def _crosses(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Cross products of vectors (..., 3 or more) with others (..., 3), in a third of `numpy.cross`'s time."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    return np.stack((b * z - c * y, c * x - a * z, a * y - b * x), axis=-1)
