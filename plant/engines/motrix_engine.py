"""MotrixSim as the engine of a simulated robot: it reads MJCF, in single precision, with its own contacts.

The joint law, including friction of the gearboxes, stays outside, as for MuJoCo: its torque acts through one
motor for each hinge. Forces on the base change the velocity at the beginning of a step.
"""

import motrixsim
import mujoco
import numpy as np

from footfall.plant.engines.motrix_model import hinges, motrix_mjcf
from footfall.plant.engines.shared import FREE, WORLD, collidable, generalised_force, update_derived


class MotrixEngine:
    """A scene of MotrixSim; see `Engine`. Its velocities are in MuJoCo's order and frames."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Raises UserError if the model has features that this engine does not simulate."""
        self._model, self._data = model, data
        self._scene = scene = motrixsim.load_mjcf_str(motrix_mjcf(model))
        scene.reports.contact_forces = scene.reports.contacting_geoms = True
        self._state = motrixsim.SceneData(scene)
        free = int(np.flatnonzero(model.jnt_type == FREE)[0])
        quaternion = int(model.jnt_qposadr[free]) + 3
        self._positions = np.arange(model.nq)  # for each of MotrixSim's positions, its index in MuJoCo's
        self._positions[quaternion : quaternion + 4] = quaternion + np.array([1, 2, 3, 0])
        self._motors = model.jnt_dofadr[hinges(model)]
        self._others = np.setdiff1d(np.arange(model.nv), self._motors)
        self._geoms = np.flatnonzero(collidable(model) & (model.geom_bodyid != WORLD)).tolist()
        self._geom_of_index = [int(name.removeprefix("geom_")) for name in scene.geom_names]
        self._link_of_body = {int(name.removeprefix("body_")): i for i, name in enumerate(scene.link_names)}
        self._applied, self._inverse = np.zeros(model.nv), np.zeros(model.nv)
        self._touching: list[list[int]] | None = []
        self._failed = False

    def step(self) -> None:
        """See `Engine`. A failed step does not change the state."""
        data, model, state = self._data, self._model, self._state
        before = data.qvel.copy()
        generalised_force(model, data, self._applied)
        velocity = before + self._other_acceleration() * model.opt.timestep
        if not np.isfinite(velocity).all():
            self._failed = True
            return
        state.set_dof_pos(data.qpos[self._positions].astype(np.float32), self._scene)
        state.set_dof_vel(velocity.astype(np.float32))
        if len(self._motors):
            state.actuator_ctrls = self._applied[self._motors].astype(np.float32)
        self._scene.step(state)
        if not (np.isfinite(state.dof_pos).all() and np.isfinite(state.dof_vel).all()):
            self._failed = True
            return
        data.qpos[self._positions] = state.dof_pos
        mujoco.mj_normalizeQuat(model, data.qpos)
        data.qvel[:] = state.dof_vel
        data.time += model.opt.timestep
        self._touching = None
        update_derived(model, data, (data.qvel - before) / model.opt.timestep)

    def touching(self) -> list[list[int]]:
        """See `Engine`."""
        if self._touching is None:
            self._touching = self._read_contacts()
        return self._touching

    def normal_force(self, contact: int) -> float:
        """See `Engine`. MotrixSim gives one force for each link, which its contacts share evenly."""
        one, other = self.touching()[contact]
        bodies = self._model.geom_bodyid
        geom, partner = (one, other) if bodies[one] != WORLD else (other, one)
        link = self._link_of_body[int(bodies[geom])]
        force = self._scene.get_link_net_contact_forces(self._state)[link, :3].astype(float)
        count = sum(bodies[geom] in bodies[pair] for pair in self.touching())
        if bodies[partner] == WORLD:
            normal = self._data.geom_xmat[partner].reshape(3, 3)[:, 2]
            return max(float(force @ normal), 0.0) / count
        return float(np.linalg.norm(force)) / count

    def diverged(self) -> bool:
        """See `Engine`."""
        return self._failed

    def _other_acceleration(self) -> np.ndarray:
        """Acceleration by forces that no motor applies, (nv,)."""
        model, data, force = self._model, self._data, np.zeros(self._model.nv)
        force[self._others] = self._applied[self._others]
        if not force.any():
            return force
        mujoco.mj_crb(model, data)
        mujoco.mj_factorM(model, data)
        mujoco.mj_solveM(model, data, self._inverse[None], force[None])
        return self._inverse

    def _read_contacts(self) -> list[list[int]]:
        """The two geoms of each contact of the last step, one for each pair of geoms."""
        query = self._scene.get_contact_query(self._state)
        pairs = set()
        for geom in self._geoms:
            for index in query.contacting_geoms(f"geom_{geom}").tolist():
                pairs.add(tuple(sorted((geom, self._geom_of_index[index]))))
        return [list(pair) for pair in sorted(pairs)]
