"""Drake as the engine of a simulated robot, to compare contacts and integration.

The joint law, including friction of the gearboxes, stays outside, as for MuJoCo. Contacts are Drake's:
compliant points (1 mm of penetration under the robot's weight) with regularised Coulomb friction, solved
implicitly in each step.
"""

import mujoco
import numpy as np
from pydrake.systems.analysis import Simulator

from footfall.common.rotations import rotate_to_body, rotation_matrix
from footfall.plant.engines.drake_model import drake_plant
from footfall.plant.engines.shared import FREE, generalised_force, update_derived


class DrakeEngine:
    """Drake's discrete multibody plant; see `Engine`."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, feet: list[int]) -> None:
        """Raises UserError if the model has features that this engine does not simulate."""
        self._model, self._data = model, data
        self._plant = plant = drake_plant(model, feet)
        self._simulator = Simulator(plant.diagram)
        self._context = plant.plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        self._forces = plant.plant.get_applied_generalized_force_input_port()
        self._results = plant.plant.get_contact_results_output_port()
        free = int(np.flatnonzero(model.jnt_type == FREE)[0])
        at, dof = int(model.jnt_qposadr[free]), int(model.jnt_dofadr[free])
        self._quaternion, self._angular = slice(at + 3, at + 7), slice(dof + 3, dof + 6)
        self._applied = np.zeros(model.nv)
        self._touching: list[list[int]] = []
        self._normal_force: list[float] = []
        self._failed = False
        self._steps = 0

    def step(self) -> None:
        """See `Engine`. A failed step does not change the state."""
        data, model, plant = self._data, self._model, self._plant.plant
        positions, velocities, step_s = self._plant.positions, self._plant.velocities, model.opt.timestep
        before = data.qvel.copy()
        q, v, force = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
        q[positions], v[velocities] = data.qpos, self._to_world(before)
        generalised_force(model, data, self._applied)
        force[velocities] = self._to_world(self._applied)
        if not (np.isfinite(v).all() and np.isfinite(force).all()):  # too large in the world frame
            self._failed = True
            return
        plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        self._forces.FixValue(self._context, force)
        self._steps += 1
        try:  # to a multiple of the step: a sum of steps may round to just before or after an update
            self._simulator.AdvanceTo(self._steps * step_s)
        except RuntimeError:  # the solver did not converge
            self._failed = True
            return
        q = plant.GetPositions(self._context)[positions]
        v = plant.GetVelocities(self._context)[velocities]
        v[self._angular] = rotate_to_body(q[self._quaternion], v[self._angular])
        if not (np.isfinite(q).all() and np.isfinite(v).all()):
            self._failed = True
            return
        data.qpos[:], data.qvel[:] = q, v
        data.time += step_s
        self._read_contacts()
        update_derived(model, data, (data.qvel - before) / step_s)

    def touching(self) -> list[list[int]]:
        """See `Engine`."""
        return self._touching

    def normal_force(self, contact: int) -> float:
        """See `Engine`."""
        return self._normal_force[contact]

    def diverged(self) -> bool:
        """See `Engine`."""
        return self._failed

    def _to_world(self, values: np.ndarray) -> np.ndarray:
        """Velocities or forces, (nv,), with the base's angular part in the world frame instead of its own."""
        result = values.copy()
        result[self._angular] = rotation_matrix(self._data.qpos[self._quaternion]) @ values[self._angular]
        return result

    def _read_contacts(self) -> None:
        """Keep the contacts of this step."""
        results = self._results.Eval(self._context)
        self._touching, self._normal_force = [], []
        for index in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(index)
            pair = contact.point_pair()
            geoms = self._plant.geoms
            self._touching.append([geoms[pair.id_A], geoms[pair.id_B]])
            self._normal_force.append(abs(float(contact.contact_force() @ pair.nhat_BA_W)))
