"""Searches for a default pose: knees bent, soles level, the centre of mass above the middle of the feet.

Damped least squares, from several starts, give each leg's joints for a foot position.
"""

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.robots.importer.machine import Leg, Machine
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.targets import soft_limits

GIVEN_RANGE = 0.94  # share of each joint's range for a given pose: the soft limits, minus rounding
USED_RANGE = 0.85  # share of each joint's range, about its middle, that the pose may use
MAX_ANGLE_RAD = np.pi  # largest angle of a joint
UPRIGHT, CROUCHED = 0.95, 0.75  # share of a leg's reach, on two legs and on more
SPREAD_SHARE = 0.4  # at zero, a spread leg reaches down less than this share of its length
SPREAD_IN = 0.7  # distance of a spread leg's foot from its hip, over that at zero
STARTS = 5  # random starts of a search
STEPS = 40  # largest number of steps from a start
WORTH_A_STEP = 1e-3  # smallest reduction of the cost, as a share, to continue
DAMPING = 1e-3  # at the first step
WEIGHTS = {"position": 1.0, "height": 3.0, "level": 3.0, "heading": 0.3, "posture": 0.02}
STANDS = 0.3  # smallest share of a leg's reach at which a given pose counts as standing
EQUAL_COST = 0.002  # costs that differ by less count as equal
SAME_COST = 1e-4  # if costs differ by less, the pose is kept
OFF_CENTRE = 0.02  # a lateral offset of the centre of mass below this share of a leg's length counts as 0
BALANCING_ROUNDS = 4  # moves of the feet towards the centre of mass


class Pose(NamedTuple):
    """A standing pose."""

    joints: dict[str, float]  # rad
    height_m: float  # of the base, feet just touching
    knees_forward_m: float  # mean distance of the knees in front of the lines from hips to feet
    reach_m: float  # of the longest leg, stretched: from its first joint to the lowest point of its foot
    given: bool = False  # whether it is the given pose


def standing_pose(machine: Machine, given: Mapping[str, float] | None = None, seed: int = 0) -> Pose:
    """A default pose for a machine; the base is level and its x axis points forward.

    Args:
        machine: the robot.
        given: joints of a given pose, clamped to the soft limits, rad. If empty, or if it folds the legs, a
            pose is searched.
        seed: seed of the search.
    """
    return _Search(machine, seed).run(given or {})


class _Search:
    """Search for the default pose of one machine."""

    def __init__(self, machine: Machine, seed: int) -> None:
        self._machine = machine
        self._random = np.random.default_rng(seed)
        self._model = mujoco.MjModel.from_xml_string(model_xml(machine))
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = self._model.qpos0
        mujoco.mj_kinematics(self._model, self._data)
        self._legs = [LegSearch(self._model, self._data, leg) for leg in machine.legs]

    def run(self, given: Mapping[str, float]) -> Pose:
        data, legs = self._data, self._legs
        for at, low, high in self._joints_of_no_leg():
            data.qpos[at] = np.clip(0.0, low, high)
        mujoco.mj_kinematics(self._model, data)
        reach = [self._solve(leg, self._lowest_of(leg)).reach for leg in legs]
        stands = bool(given) and self._apply_given(given, reach)
        if not stands:
            self._balance(reach)
        mujoco.mj_kinematics(self._model, data)
        joints = {hinge.name: float(data.joint(hinge.name).qpos[0]) for hinge in self._machine.hinges}
        knees = float(np.mean([leg.knee(data) for leg in legs]))
        return Pose(joints, -min(leg.foot(data)[2] for leg in legs), knees, max(reach), stands)

    def _apply_given(self, given: Mapping[str, float], reach: list[float]) -> bool:
        """Set a given pose; returns whether it stands, which needs one leg stretched far enough."""
        for hinge in self._machine.hinges:
            low, high = soft_limits(hinge.low, hinge.high, GIVEN_RANGE)
            self._data.joint(hinge.name).qpos = np.clip(given[hinge.name], low, high)
        mujoco.mj_kinematics(self._model, self._data)
        depth = [leg.hip[2] - leg.foot(self._data)[2] for leg in self._legs]
        return any(z > STANDS * leg_reach for z, leg_reach in zip(depth, reach, strict=True))

    def _balance(self, reach: list[float]) -> None:
        """Bend the legs, and move the feet until the centre of mass is above their middle."""
        data, legs = self._data, self._legs
        share = UPRIGHT if len(legs) == 2 else CROUCHED
        ground = max(leg.hip[2] - share * leg_reach for leg, leg_reach in zip(legs, reach, strict=True))
        targets = [np.array([*leg.natural_position(), ground]) for leg in legs]
        for _ in range(BALANCING_ROUNDS):
            solved: list[_Solved] = []
            for leg, target in zip(legs, targets, strict=True):
                solved.append(self._leg_angles(leg, target, solved))
                data.qpos[leg.at] = solved[-1].joints
            shift = self._centre_of_mass()[:2] - np.mean([leg.foot(data)[:2] for leg in legs], axis=0)
            if abs(shift[1]) < OFF_CENTRE * legs[0].length:
                shift[1] = 0.0
            targets = [target + np.append(shift, 0.0) for target in targets]

    def _joints_of_no_leg(self) -> list[tuple[int, float, float]]:
        leg_joints = {name for leg in self._machine.legs for name in leg.joints}
        return [
            (int(self._model.joint(hinge.name).qposadr[0]), hinge.low, hinge.high)
            for hinge in self._machine.hinges
            if hinge.name not in leg_joints
        ]

    def _lowest_of(self, leg: "LegSearch") -> np.ndarray:
        """A point far below the hip: reaching for it stretches the leg."""
        return np.array([*leg.hip[:2], leg.hip[2] - 1.2 * leg.length])

    def _leg_angles(self, leg: "LegSearch", target: np.ndarray, solved: "list[_Solved]") -> "_Solved":
        """Angles of an earlier leg, mirrored for a leg on the other side; a new search if they do not fit."""
        earlier = zip(self._legs, solved, strict=False)
        mirrored = [
            (leg.like(other, found.joints), found.cost) for other, found in earlier if other.kind == leg.kind
        ]
        if not mirrored:
            return self._solve(leg, target)
        evaluated = [self._evaluated(leg, target, joints) for joints, _ in mirrored]
        exact = min(evaluated, key=lambda found: found.cost)
        nearby = self._descend(leg, target, exact.joints)
        if exact.cost < nearby.cost + SAME_COST:
            return exact
        max_cost = max(cost for _, cost in mirrored) + EQUAL_COST
        return nearby if nearby.cost < max_cost else self._solve(leg, target)

    def _evaluated(self, leg: "LegSearch", target: np.ndarray, joints: np.ndarray) -> "_Solved":
        joints = np.clip(joints, leg.low, leg.high)
        residual = self._residual(leg, target, joints)
        return self._solved(leg, joints, residual)

    def _solve(self, leg: "LegSearch", target: np.ndarray) -> "_Solved":
        """The best of several starts; among equals, the one whose knee bends in the usual direction."""
        starts = [leg.near_zero, *self._random.uniform(leg.low, leg.high, (STARTS, len(leg.at)))]
        found = [self._descend(leg, target, start) for start in starts]
        best = min(solved.cost for solved in found)
        good = [solved for solved in found if solved.cost < best + EQUAL_COST]
        return max(good, key=lambda solved: solved.knee * (1.0 if len(self._legs) == 2 else -1.0))

    def _descend(self, leg: "LegSearch", target: np.ndarray, start: np.ndarray) -> "_Solved":
        joints = np.clip(start, leg.low, leg.high)
        residual = self._residual(leg, target, joints)
        damping = DAMPING
        for _ in range(STEPS):
            jacobian = np.empty((len(residual), len(joints)))
            for i in range(len(joints)):
                moved = joints.copy()
                moved[i] += 1e-6
                jacobian[:, i] = (self._residual(leg, target, moved) - residual) / 1e-6
            normal = jacobian.T @ jacobian
            step = np.linalg.solve(normal + damping * np.eye(len(joints)), -jacobian.T @ residual)
            trial = np.clip(joints + step, leg.low, leg.high)
            trial_residual = self._residual(leg, target, trial)
            if trial_residual @ trial_residual < residual @ residual:
                converged = trial_residual @ trial_residual > (1.0 - WORTH_A_STEP) * (residual @ residual)
                joints, residual, damping = trial, trial_residual, damping / 3
                if converged:
                    break
            else:
                damping *= 5
                if damping > 1e6:
                    break
        return self._solved(leg, joints, residual)

    def _solved(self, leg: "LegSearch", joints: np.ndarray, residual: np.ndarray) -> "_Solved":
        self._data.qpos[leg.at] = joints
        mujoco.mj_kinematics(self._model, self._data)
        foot = leg.foot(self._data)
        return _Solved(joints, float(residual @ residual), float(leg.hip[2] - foot[2]), leg.knee(self._data))

    def _residual(self, leg: "LegSearch", target: np.ndarray, joints: np.ndarray) -> np.ndarray:
        data = self._data
        data.qpos[leg.at] = joints
        mujoco.mj_kinematics(self._model, data)
        error = (leg.foot(data) - target) / leg.length
        parts = [
            WEIGHTS["position"] * error[:2],
            WEIGHTS["height"] * error[2:],
            WEIGHTS["posture"] * (joints - leg.near_zero),
        ]
        if leg.sole:
            axes = leg.axes(data)
            parts += [WEIGHTS["level"] * axes[:2, 2], WEIGHTS["heading"] * axes[1:2, 0]]
        return np.concatenate(parts)

    def _centre_of_mass(self) -> np.ndarray:
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        return self._data.subtree_com[1]


class _Solved(NamedTuple):
    joints: np.ndarray
    cost: float
    reach: float  # m, from the hip down to the foot's lowest point
    knee: float  # m, distance of the knee in front of the line from hip to foot


class LegSearch:
    """One leg in the model: its joints, its foot, and its foot's frame at zero."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, leg: Leg) -> None:
        """`data` has all joints as in the file."""
        joints = [model.joint(name) for name in leg.joints]
        self._ids = np.array([joint.id for joint in joints])
        self.at = np.array([int(joint.qposadr[0]) for joint in joints])
        self.zero = model.qpos0[self.at]
        low, high = np.array([joint.range for joint in joints]).T
        middle, half = (low + high) / 2, USED_RANGE * (high - low) / 2
        self.low, self.high = (
            np.maximum(middle - half, np.minimum(-MAX_ANGLE_RAD, middle)),
            np.minimum(middle + half, np.maximum(MAX_ANGLE_RAD, middle)),
        )
        self.near_zero = np.clip(0.0, self.low, self.high)
        self._model = model
        self._geoms = [model.geom(name).id for name in leg.geoms]
        self._body = int(model.geom_bodyid[self._geoms[0]])
        self._upright = data.xmat[self._body].reshape(3, 3).T.copy()
        self.sole = _is_sole(data, self._geoms)
        self.hip = data.xanchor[self._ids[0]].copy()
        self._place_at_zero = self.foot(data)
        self._axes_at_zero = data.xaxis[self._ids].copy()
        anchors = [*data.xanchor[self._ids], self._place_at_zero]
        self.length = float(np.linalg.norm(np.diff(anchors, axis=0), axis=1).sum())
        self.kind = (len(self.at), self.sole)

    def foot(self, data: mujoco.MjData) -> np.ndarray:
        """Middle of the foot and height of its lowest point, m, (3,)."""
        middle = np.mean(data.geom_xpos[self._geoms], axis=0)
        lowest = min(lowest_height(self._model, data, geom) for geom in self._geoms)
        return np.array([middle[0], middle[1], lowest])

    def axes(self, data: mujoco.MjData) -> np.ndarray:
        """The foot's rotation since zero, (3, 3)."""
        return data.xmat[self._body].reshape(3, 3) @ self._upright

    def knee(self, data: mujoco.MjData) -> float:
        """Forward distance from the hip-foot line of the joint farthest from that line, m."""
        foot, anchors = self.foot(data), data.xanchor[self._ids]
        along = foot - self.hip
        share = np.clip((anchors - self.hip) @ along / max(along @ along, 1e-9), 0.0, 1.0)
        offset = anchors - self.hip - share[:, None] * along
        return float(offset[int(np.linalg.norm(offset, axis=1).argmax())][0])

    def natural_position(self) -> np.ndarray:
        """Desired position of the foot on the ground, (2,) m: as at zero, or nearer if the leg is spread."""
        outward = self._place_at_zero - self.hip
        spread = -outward[2] < SPREAD_SHARE * self.length
        return (self.hip + (SPREAD_IN if spread else 1.0) * outward)[:2]

    def like(self, other: "LegSearch", joints: np.ndarray) -> np.ndarray:
        """Joint angles that rotate this leg's links as `joints` rotate those of another leg.

        Across the body's middle plane a rotation vector (x, y, z) is mirrored to (-x, y, -z).
        """
        mirror = np.array([-1.0, 1.0, -1.0]) if self.hip[1] * other.hip[1] < 0 else np.ones(3)
        turned = (joints - other.zero)[:, None] * other._axes_at_zero * mirror
        return self.zero + np.sum(turned * self._axes_at_zero, axis=1)


def lowest_height(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of the lowest point of a sphere or an ellipsoid, m."""
    up, size = data.geom_xmat[geom].reshape(3, 3)[2], model.geom_size[geom]
    is_sphere = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE
    return float(data.geom_xpos[geom][2] - (size[0] if is_sphere else np.linalg.norm(size * up)))


def _is_sole(data: mujoco.MjData, geoms: list[int]) -> bool:
    """Whether a foot has three or more contact points that are not in a line."""
    positions = data.geom_xpos[geoms][:, :2]
    return len(geoms) > 2 and float(np.linalg.svd(positions - positions.mean(axis=0))[1][1]) > 0.01
