"""Kinematics of a robot's limbs: where their tips are, how they move, and which angles put them somewhere.

The way forward is MuJoCo's. The way back is in closed form for limbs that have one (`closed_form.py`), by
damped least squares on MuJoCo's Jacobians for all others (`least_squares.py`). Limbs of one robot may have
different numbers of hinges: arrays are as wide as the longest limb, m, and zero where another has no hinge.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.arrays import as_slice
from footfall.common.errors import UserError
from footfall.common.linear import solve
from footfall.common.rotations import skew
from footfall.robots.closed_form import closed_form
from footfall.robots.feet import FootBalls, foot_balls, foot_geoms
from footfall.robots.least_squares import Chains, LeastSquares
from footfall.robots.limb import Limb
from footfall.robots.mjcf import load_spec
from footfall.robots.robot_yaml import Description
from footfall.robots.stance import base_corners, lowest_points

_REGULAR = 1e-6 * np.eye(3)  # m^2/rad^2
_HINGES_FOR_LEVEL_SOLE = 6  # three for its place, three for its orientation


class LegPose(NamedTuple):
    """Where the limbs are, in the base frame (origin at the base body's, axes along it)."""

    foot: np.ndarray  # (legs, 3) m, tip of each limb: the middle of its foot's geoms
    jacobian: np.ndarray  # (legs, 3, m) m/rad, tip velocity = jacobian @ joint velocity
    axes: np.ndarray  # (legs, 3, m), column j is the direction of the limb's joint j


class Legs:
    """Kinematics of all limbs together. Their order is that of the feet in `robot.yaml`.

    The arrays that a pose is worked out in belong to this object: it is for one thread at a time.

    Args:
        description: of the robot.
        xml_path: the robot's own MJCF: only the nominal geometry is used, never a plant's.

    Raises:
        UserError: a limb has another joint than hinges.
    """

    def __init__(self, description: Description, xml_path: Path) -> None:
        self._joints_of = description.foot_joints
        self.count = len(self._joints_of)
        self.hinges = max(map(len, self._joints_of))
        self.present = np.array([[k < len(own) for k in range(self.hinges)] for own in self._joints_of])
        self._alike = bool(self.present.all())
        # Where a limb has no hinge, its first one stands in, and `present` says so.
        self.joints = np.array([[*own, *[own[0]] * (self.hinges - len(own))] for own in self._joints_of])
        self._places = as_slice(self.joints.ravel())
        # Whether the limbs' joints are all that the robot has, one limb after another.
        self._in_order = self._alike and self._places == slice(0, len(description.joints), 1)
        self._set_model(description, xml_path)
        base = self._model.body(description.base).id
        self.mass = float(self._model.body_subtreemass[base])  # kg, of the whole robot
        self.limbs = self._read_limbs(description)
        self.reach = np.array([limb.reach for limb in self.limbs])  # (legs,) m, from each first hinge
        self._last_rolling = np.empty(0), b"", np.empty(0)
        default = description.default_pose
        self._last = default.tobytes(), self._pose(default, self._data)
        self.default_angles = self.gather(default)
        self.default_foot = self.pose(default).foot
        self.foot_radius = self.default_foot[:, 2] - lowest_points(description, self._model)
        self.base_corners = base_corners(description, self._model)
        self.base_below = -float(self.base_corners[:, 2].min())  # m, of its origin, when level
        # Each as often as a limb's Jacobian has numbers: to broadcast takes longer.
        self._radii = np.repeat(self.foot_radius, 3 * self.hinges).reshape(self.count, 3, self.hinges)
        forms = [closed_form(limb, tip) for limb, tip in zip(self.limbs, self.default_foot, strict=True)]
        self._forms = [form for form in forms if form is not None]
        self._chains = None if len(self._forms) == self.count else self._least_squares(description)
        self._form_of = forms

    def pose(self, joint_position: np.ndarray) -> LegPose:
        """Feet, Jacobians and joint axes; the arrays must not be written to.

        The last answer is kept: in each tick the estimator and a controller ask about the same readings.

        Args:
            joint_position: (n,) rad, in the robot's joint order.
        """
        key = joint_position.tobytes()
        if key != self._last[0]:
            self._last = key, self._pose(joint_position, self._data)
        return self._last[1]

    def turn(self, joint_position: np.ndarray) -> np.ndarray:
        """Rotation of each limb's last link, to the base frame, (legs, 3, 3)."""
        self.pose(joint_position)
        return self._data.site_xmat[self._tips].reshape(self.count, 3, 3)

    def holding_torque(self, joint_position: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Torques (legs, m), N m, that hold the limbs against their own weight and the base's acceleration.

        Args:
            joint_position: (n,) rad.
            acceleration: (3,) m/s^2, the base's proper acceleration, base frame: 9.81 upwards at rest.
        """
        self.pose(joint_position)
        np.negative(acceleration, out=self._gravity)
        mujoco.mj_rne(self._model, self._data, 0, self._bias)
        torque = self._bias.take(self._dofs)
        return torque if self._alike else torque * self.present

    def _pose(self, joint_position: np.ndarray, data: mujoco.MjData) -> LegPose:
        model = self._model
        data.qpos[self._addresses] = joint_position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        foot = data.site_xpos.take(self._tips, axis=0)
        for full, tip in self._jacobian_of_tip:
            mujoco.mj_jacSite(model, data, full, None, tip)
        jacobian, axes = self._full_jacobian.take(self._jacobian_places), data.xaxis.take(self._axis_places)
        if self._alike:
            return LegPose(foot, jacobian, axes)
        return LegPose(foot, jacobian * self.present[:, None], axes * self.present[:, None])

    def solve(self, foot: np.ndarray, legs: Sequence[int] | None = None) -> np.ndarray:
        """Joint angles that put the tips at given places; the inverse of `pose`.

        Every result lies within the joint limits and is finite. A place out of reach gives the limb that
        points at it, stretched or folded as far as the limits allow; a place that is not a number, angles
        that are none. Of several solutions it is the one on the default pose's side.

        Args:
            foot: (k, 3) m, base frame.
            legs: the k limbs that are meant; all if None.

        Returns:
            (k, m) rad.
        """
        if self._chains is None:
            chosen = self._forms if legs is None else [self._forms[leg] for leg in legs]
            # Limb by limb: on so few numbers, Python's own arithmetic takes a quarter of NumPy's time.
            return np.array([form.angles(tip) for tip, form in zip(foot.tolist(), chosen, strict=True)])
        meant = list(range(self.count)) if legs is None else list(legs)
        angles = np.zeros((len(meant), self.hinges))
        others = [row for row, leg in enumerate(meant) if self._form_of[leg] is None]
        for row, leg in enumerate(meant):
            form = self._form_of[leg]
            if form is not None:
                angles[row, :3] = form.angles(foot[row].tolist())
        if others:
            angles[others] = self._chains.solve(foot[others], [meant[row] for row in others])
        return angles

    def rolling_offset(self, axes: np.ndarray, up: np.ndarray) -> np.ndarray:
        """What to add to the tips' Jacobians to get those of the points on the ground under them.

        A round foot rolls: not its centre but its lowest point stands still in stance. At a walking pace the
        difference is close to a tenth of the base's speed. Of a sole flat on the ground it is the same.
        The last answer is kept, as that of `pose` is, and must not be written to.

        Args:
            axes: (legs, 3, m) from `pose`.
            up: (3,) the ground's normal in the base frame.

        Returns:
            (legs, 3, m) m/rad.
        """
        key = up.tobytes()
        if axes is not self._last_rolling[0] or key != self._last_rolling[1]:
            self._last_rolling = axes, key, self._radii * (skew(up) @ axes)
        return self._last_rolling[2]

    def torque(self, jacobian: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Joint torques (legs, m), N m, at which the ground exerts forces (legs, 3), N, on limbs at rest.

        Args:
            jacobian: (legs, 3, m) of the points that the forces act on.
            force: base frame.
        """
        return -(force[:, None, :] @ jacobian)[:, 0]

    def joint_rates(self, jacobian: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Joint rates (legs, m, k) for k motions of the tips, (legs, 3, k), or the nearest that there are.

        Of limbs that all have three hinges the exact ones; else the smallest ones, damped where a limb is
        stretched.

        Args:
            jacobian: (legs, 3, m).
            motion: m/s, m/s^2 or whatever the joint rates shall be rates of.
        """
        if self.hinges == 3 and self._alike:
            return solve(jacobian, motion)
        across = jacobian.transpose(0, 2, 1)
        return across @ solve(jacobian @ across + _REGULAR, motion)

    def gather(self, joint_values: np.ndarray) -> np.ndarray:
        """Joint order (..., n) to limbs (..., legs, m)."""
        values = joint_values.take(self.joints, axis=-1)
        return values if self._alike else values * self.present

    def scatter(self, leg_values: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Limbs (..., legs, m) to joint order (..., n); joints outside them keep their value in `others`."""
        if self._in_order:
            return leg_values.reshape(others.shape)
        result = others.copy()
        if self._alike:
            result[..., self._places] = leg_values.reshape(*leg_values.shape[:-2], -1)
        else:
            result[..., self.joints[self.present]] = leg_values[..., self.present]
        return result

    def _set_model(self, description: Description, xml_path: Path) -> None:
        """The robot's own model with its base at the origin, and where in it the limbs are."""
        spec = load_spec(xml_path)
        own = spec.compile()
        for foot in description.feet:
            geoms = [own.geom(name) for name in foot.geoms]
            tip = np.mean([geom.pos for geom in geoms], axis=0)
            spec.geom(foot.geoms[0]).parent.add_site(name=_tip_name(foot.name), pos=tip)
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = 0.0
        for joint in range(model.njnt):
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                self._data.qpos[model.jnt_qposadr[joint] + 3] = 1.0
        joints = np.array([model.joint(name).id for name in description.joint_names])
        self._addresses = as_slice(model.jnt_qposadr[joints])
        self._hinges_at = joints[self.joints]
        if np.any(model.jnt_type[self._hinges_at] != mujoco.mjtJoint.mjJNT_HINGE):
            raise UserError(f"{xml_path}: the joints of a leg must be hinges")
        self._tips = np.array([model.site(_tip_name(foot.name)).id for foot in description.feet])
        self.balls: list[FootBalls] = [  # that each foot touches the ground with
            foot_balls(model, geoms, model.site_pos[tip])
            for geoms, tip in zip(foot_geoms(model, description), self._tips, strict=True)
        ]
        self._dofs = model.jnt_dofadr[self._hinges_at]
        self._bias = np.zeros(model.nv)
        self._gravity = model.opt.gravity
        self._full_jacobian = np.zeros((self.count, 3, model.nv))
        self._jacobian_of_tip = list(zip(self._full_jacobian, self._tips.tolist(), strict=True))
        # Where each limb's (3, m) stands in the flat arrays of all degrees of freedom, of all axes.
        rows = np.arange(3 * self.count).reshape(self.count, 3, 1)
        self._jacobian_places = rows * model.nv + self._dofs[:, None, :]
        self._axis_places = 3 * self._hinges_at[:, None, :] + np.arange(3)[:, None]

    def _read_limbs(self, description: Description) -> list[Limb]:
        data = self._data
        data.qpos[self._addresses] = 0.0
        mujoco.mj_kinematics(self._model, data)
        limbs = []
        for own, hinges, tip in zip(self._joints_of, self._hinges_at, self._tips, strict=True):
            at = hinges[: len(own)]
            limbs.append(
                Limb(
                    anchor=data.xanchor[at],
                    axis=data.xaxis[at],
                    tip=data.site_xpos[tip].copy(),
                    lower=self._model.jnt_range[at, 0],
                    upper=self._model.jnt_range[at, 1],
                    default=description.default_pose[own],
                )
            )
        return limbs

    def _least_squares(self, description: Description) -> LeastSquares:
        soles = np.array([_is_sole(self._model, foot.geoms) for foot in description.feet])
        enough = self.present.sum(axis=1) >= _HINGES_FOR_LEVEL_SOLE
        lower, upper = (self._model.jnt_range[self._hinges_at, side] * self.present for side in (0, 1))
        others = description.default_pose
        data = mujoco.MjData(self._model)  # its own: what is kept of the last pose stays
        data.qpos[:] = self._data.qpos

        def forward(angles: np.ndarray) -> Chains:
            pose = self._pose(self.scatter(angles, others), data)
            return Chains(*pose, data.site_xmat[self._tips].reshape(self.count, 3, 3))

        return LeastSquares(forward, lower, upper, self.default_angles, soles & enough)


def _is_sole(model: mujoco.MjModel, geoms: Sequence[str]) -> bool:
    """Whether a foot is more than one ball."""
    return len(geoms) > 1 or model.geom(geoms[0]).type[0] != mujoco.mjtGeom.mjGEOM_SPHERE


def _tip_name(foot: str) -> str:
    return f"footfall_tip_{foot}"
