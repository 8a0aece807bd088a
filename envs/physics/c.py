"""The physics in MuJoCo C: whole batches of robots on a thread pool, called from inside a JAX program."""

import threading
from copy import copy
from functools import partial
from typing import Any

import jax
import mujoco
import numpy as np
from jax.experimental.buffer_callback import buffer_callback
from mujoco.batch import Batch, SimulationError

from footfall.common.arrays import as_slice, single
from footfall.common.processors import usable_cores
from footfall.envs.physics.interface import Drive, Fields, Motion, Physics, Trace, bodies, joint_effort
from footfall.envs.workarounds.undisturbed import UNDISTURBED
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses

LINE_SEARCH_EVALUATIONS = 20


def c_physics(model: mujoco.MjModel, robot: Robot) -> Physics:
    """The physics of robots with this nominal model; `jax.vmap` passes all robots in one call."""
    simulations = _Simulations(model, robot)

    def simulate(motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        def shape_of(x: Any) -> jax.ShapeDtypeStruct:
            return jax.ShapeDtypeStruct(x.shape, x.dtype)

        results = jax.tree.map(shape_of, (motion, simulations.empty_trace(len(drive.target))))
        return jax.lax.platform_dependent(
            *(motion, drive, fields),
            # XLA's arrays lie in the host's memory: a step that uses them in place is 4 % shorter.
            cpu=buffer_callback(simulations.in_place, results, vmap_method="broadcast_all"),
            default=partial(jax.pure_callback, simulations, results, vmap_method="broadcast_all"),
        )

    return simulate


class _Simulations:
    """A batch of robots in MuJoCo C.

    A call depends on its arguments alone: the pools are only working memory.
    """

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        self._model = _for_stepping(model)
        self._positions, self._dofs = map(as_slice, joint_addresses(model, robot))
        points = np.concatenate(foot_geoms(model, robot.description))
        self._points = as_slice(points)
        self._joints, self._point_count = len(robot.joint_names), len(points)
        self._net = None if robot.actuator_net is None else jax.tree.map(single, robot.actuator_net)
        self._pools: dict[int, Batch] = {}  # by number of robots
        self._checked: set[tuple] = set()  # shapes of results whose reshaped arrays are known to be views
        self._lock = threading.Lock()

    def __call__(self, motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        """One control step of robots with any number of leading axes, one after `jax.vmap`."""
        end = jax.tree.map(lambda x: np.empty(x.shape, np.float32), motion)
        lead = motion.qpos.shape[:-1]
        trace = self.empty_trace(drive.target.shape[-2], lead)
        self.in_place(None, (end, trace), motion, drive, fields)
        return end, trace

    def in_place(self, _: Any, results: tuple[Motion, Trace], *inputs: Any) -> None:
        """One control step, written to `results`.

        A simulation that fails in MuJoCo becomes NaN; the others continue.
        """
        # NumPy only from here on: JAX called from inside a JAX program may wait for itself.
        values = jax.tree.map(np.asarray, (results, inputs))
        lead = values[0][0].qpos.ndim - 1
        results, inputs = jax.tree.map(lambda x: x.reshape(-1, *x.shape[lead:]), values)
        self._check_views(values[0], results)
        with self._lock, UNDISTURBED, np.errstate(all="ignore"):
            self._simulate(*results, *inputs)

    def _check_views(self, memory: Any, results: Any) -> None:
        """Check once for each shape that writing to the reshaped results writes to XLA's memory."""
        shapes = tuple(x.shape for x in jax.tree.leaves(memory))
        if shapes not in self._checked:
            pairs = zip(jax.tree.leaves(memory), jax.tree.leaves(results), strict=True)
            assert all(np.shares_memory(*pair) for pair in pairs), "results would be written to a copy"
            self._checked.add(shapes)

    def empty_trace(self, substeps: int, lead: tuple[int, ...] = ()) -> Trace:
        """An uninitialised trace."""
        sizes = Trace((self._model.nq,), (self._model.nv,), (self._point_count, 3), (self._joints,))
        return Trace(*(np.empty((*lead, substeps, *size), np.float32) for size in sizes))

    def _simulate(self, end: Motion, trace: Trace, start: Motion, drive: Drive, fields: Fields) -> None:
        robots, substeps, _ = drive.target.shape
        pool = self._pool(robots)
        state = Motion(**{name: pool.bind(name) for name in bodies(start)})
        force, geoms = pool.bind("qfrc_applied"), pool.bind("geom_xpos")
        for name, values in fields.items():
            pool.expand(name)[:] = values
        inertia = pool.expand("dof_armature")
        own_inertia = fields.get("dof_armature", self._model.dof_armature)[..., self._dofs]
        timestep_s = self._model.opt.timestep
        for name, values in bodies(start).items():
            getattr(state, name)[:] = values
        lagged_torque, net_memory = start.lagged_torque, start.net_memory
        for k in range(substeps):
            position = state.qpos[:, self._positions].astype(np.float32)
            velocity = state.qvel[:, self._dofs].astype(np.float32)
            effort = joint_effort(
                *(drive, drive.target[:, k], position, velocity, timestep_s, lagged_torque),
                *(self._net, net_memory),
            )
            lagged_torque, net_memory = effort.lagged_torque, effort.net_memory
            force[:, self._dofs] = effort.torque
            inertia[:, self._dofs] = own_inertia + effort.inertia
            _step(pool, state)
            record = Trace(state.qpos, state.qvel, geoms[:, self._points], effort.motor_torque)
            _copy(record, Trace(*(rows[:, k] for rows in trace)))
        for name, values in bodies(state).items():
            getattr(end, name)[:] = values
        if end.lagged_torque is not None:
            end.lagged_torque[:] = lagged_torque
        if end.net_memory is not None:
            end.net_memory[:] = net_memory

    def _pool(self, robots: int) -> Batch:
        if robots not in self._pools:
            self._pools[robots] = Batch(self._model, robots, nthread=min(robots, usable_cores()))
        return self._pools[robots]


def _copy(values: tuple[np.ndarray, ...], targets: tuple[np.ndarray, ...]) -> None:
    for value, target in zip(values, targets, strict=True):
        target[:] = value


def _step(pool: Batch, state: Motion) -> None:
    try:
        pool.step()
    except SimulationError as error:
        state.qpos[error.ids] = np.nan


def _for_stepping(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model for many short steps: diverged states stay diverged, and unneeded work is off.

    MuJoCo's `ls_iterations` counts evaluations of the cost in C and halvings of a bracket in MJX. The model's
    value, five, would end C's line search too early in 1 % of the steps, by up to 4 % of the velocity.
    """
    model = copy(model)
    model.opt.ls_iterations = LINE_SEARCH_EVALUATIONS
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_ISLAND
    model.body_sameframe[:] = 0  # the centre of mass of a body may be moved
    return model
