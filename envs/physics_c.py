"""The physics in MuJoCo C: whole batches of robots on a thread pool, called from inside a JAX program."""

import ctypes
import math
import os
import threading
from copy import copy
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from mujoco.batch import Batch, SimulationError

from envs.physics import Drive, Fields, Motion, Physics, Trace, drive_torque
from robots.description import Robot
from robots.model import joint_addresses

_CLOCK = ctypes.c_void_p.in_dll(ctypes.CDLL(mujoco._callbacks.__file__), "mjcb_time")


def c_physics(model: mujoco.MjModel, robot: Robot) -> Physics:
    """The motion of a robot whose nominal model this is; `jax.vmap` hands over all robots at once."""
    simulations = _Simulations(model, robot)

    def simulate(motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        start, trace = jax.tree.map(
            lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype),
            (Motion(*(x[None] for x in motion)), simulations.room(1, len(drive.target))),
        )
        # As one array: handing one over costs JAX more than what a small array holds.
        arguments, layout = _as_one((motion, drive, fields))
        return jax.pure_callback(
            partial(simulations, layout), (start, trace), arguments, vmap_method="broadcast_all"
        )

    return simulate


class _Layout(NamedTuple):
    """How values of different names and shapes lie in one row."""

    tree: Any
    shapes: tuple[tuple[int, ...], ...]

    def parts(self, rows: np.ndarray) -> Any:
        """The values of each row, with the rows as their first axis."""
        ends = np.cumsum([math.prod(shape) for shape in self.shapes])
        leaves = np.split(rows, ends[:-1], axis=1)
        return self.tree.unflatten(
            # Copied: what lies close together is computed faster.
            [
                np.ascontiguousarray(leaf).reshape(-1, *shape)
                for leaf, shape in zip(leaves, self.shapes, strict=True)
            ]
        )


def _as_one(values: Any) -> tuple[jax.Array, _Layout]:
    leaves, tree = jax.tree.flatten(values)
    row = jnp.concatenate([jnp.ravel(leaf) for leaf in leaves])
    return row, _Layout(tree, tuple(leaf.shape for leaf in leaves))


class _Simulations:
    """Robots side by side in MuJoCo C.

    A call depends on its arguments alone: the pools that are kept are only room to work in.
    """

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        self._model = _for_stepping(model)
        self._positions, self._dofs = map(_as_slice, joint_addresses(model, robot))
        self._feet = _as_slice(np.array([model.geom(foot.geom).id for foot in robot.description.feet]))
        self._joints, self._foot_count = len(robot.joint_names), len(robot.description.feet)
        self._pools: dict[int, Batch] = {}  # by number of robots
        self._lock = threading.Lock()

    def __call__(self, layout: _Layout, arguments: Any) -> tuple[Motion, Trace]:
        """One control step of robots with any number of leading axes, one after `jax.vmap`.

        A simulation that MuJoCo gives up is not a number from there on; the others go on.
        """
        # NumPy only from here on: JAX called from inside a JAX program may wait for itself.
        values = np.asarray(arguments)
        lead = values.shape[:-1]
        with self._lock, _UNDISTURBED, np.errstate(all="ignore"):
            results = self._simulate(*layout.parts(values.reshape(-1, values.shape[-1])))
        return jax.tree.map(lambda x: x.reshape(*lead, *x.shape[1:]), results)

    def room(self, robots: int, substeps: int) -> Trace:
        """Room for a trace, its contents arbitrary."""
        sizes = Trace((self._model.nq,), (self._model.nv,), (self._foot_count, 3), (self._joints,))
        return Trace(*(np.empty((robots, substeps, *size), np.float32) for size in sizes))

    def _simulate(self, motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        robots, substeps, _ = drive.target.shape
        pool = self._pool(robots)
        state = Motion(*map(pool.bind, Motion._fields))
        force, geoms = pool.bind("qfrc_applied"), pool.bind("geom_xpos")
        for name, values in fields.items():
            pool.expand(name)[:] = values
        for now, start in zip(state, motion, strict=True):
            now[:] = start
        trace = self.room(robots, substeps)
        for k in range(substeps):
            position = state.qpos[:, self._positions].astype(np.float32)
            velocity = state.qvel[:, self._dofs].astype(np.float32)
            torque, force[:, self._dofs] = drive_torque(drive, drive.target[:, k], position, velocity)
            _step(pool, state)
            left = Trace(state.qpos, state.qvel, geoms[:, self._feet], torque)
            for kept, value in zip(trace, left, strict=True):
                kept[:, k] = value
        return Motion(*(x.astype(np.float32) for x in state)), trace

    def _pool(self, robots: int) -> Batch:
        if robots not in self._pools:
            self._pools[robots] = Batch(self._model, robots, nthread=min(robots, _usable_cores()))
        return self._pools[robots]


def _step(pool: Batch, state: Motion) -> None:
    try:
        pool.step()
    except SimulationError as error:
        state.qpos[error.ids] = np.nan


def _for_stepping(model: mujoco.MjModel) -> mujoco.MjModel:
    """The same model for many short steps: what has diverged stays so, and nothing is done in vain."""
    model = copy(model)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_ISLAND
    model.body_sameframe[:] = 0  # the centre of mass of a body may be moved
    return model


class _Undisturbed:
    """No stopwatch and no warnings while MuJoCo steps; both are settings of the whole process.

    MuJoCo's Python package has each stage of each step timed (`MjData.timer`), a tenth of the step's time.
    Only C can take its clock away: `mujoco.set_mjcb_time(None)` puts it back. Its warnings of a diverging
    simulation would go to a file in the working directory. Of several threads inside, the first to enter
    changes the settings and the last to leave restores them.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._kept: tuple[int | None, Any] = (None, None)  # clock, handler of warnings

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._kept = (_CLOCK.value, mujoco.get_mju_user_warning())
                _CLOCK.value = None
                mujoco.set_mju_user_warning(_ignore)
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                _CLOCK.value, warning = self._kept
                mujoco.set_mju_user_warning(warning)


def _ignore(_: str) -> None:
    pass


_UNDISTURBED = _Undisturbed()


def _as_slice(indices: np.ndarray) -> slice | np.ndarray:
    """Indices that follow one another as a slice, which NumPy need not gather."""
    first, last = int(indices[0]), int(indices[-1])
    return slice(first, last + 1) if np.array_equal(indices, np.arange(first, last + 1)) else indices


def _usable_cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
