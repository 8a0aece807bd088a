"""The generated physics as an implementation of `Physics`."""

from collections.abc import Callable
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.envs.physics.generated import on_gpu, on_processor
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.geom_pairs import contact_refusals
from footfall.envs.physics.generated.limb_program import substep_by_threads
from footfall.envs.physics.generated.substep import SINGLE, Substep, substep
from footfall.envs.physics.generated.tree import refusals
from footfall.envs.physics.interface import Drive, Fields, Motion, Physics, Trace
from footfall.robots.actuator import Motor
from footfall.robots.description import Robot


def not_generated(model: mujoco.MjModel) -> str:
    """Why this model or this device has no generated physics; empty if it has."""
    reasons = [*refusals(model), *contact_refusals(model)]
    if reasons:
        return f"the generated physics does not support {reasons[0]}"
    match jax.default_backend():
        case "cpu":
            return on_processor.unavailable()
        case "gpu":
            return on_gpu.unavailable()
        case other:
            return f"the generated physics does not run on {other}"


def generated_physics(model: mujoco.MjModel, robot: Robot) -> Physics:
    """The physics of robots with this nominal model; `jax.vmap` passes all robots in one call."""

    @cache
    def step_of(
        shapes: tuple[tuple[str, tuple[int, ...]], ...], effects: tuple[str, ...]
    ) -> Callable[[], Substep]:
        write = substep_by_threads if jax.default_backend() == "gpu" else substep
        built = write(model, robot, dict(shapes), SINGLE, effects)
        return lambda: built  # the back ends keep compiled programs by function: a `Substep` has no hash

    def simulate(motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        return _batched(step_of, ())(motion, drive, fields)

    return simulate


def _batched(step_of: Callable[..., Callable[[], Substep]], lead: tuple[int, ...]) -> Physics:
    """The physics of robots with these leading axes; each `jax.vmap` adds one."""

    @jax.custom_batching.custom_vmap
    def simulate(motion: Motion, drive: Drive, fields: Fields) -> tuple[Motion, Trace]:
        return _control_step(step_of, lead, motion, drive, fields)

    @simulate.def_vmap
    def _add_axis(size: int, batched: Any, *operands: Any) -> tuple[Any, Any]:
        def with_axis(x: jax.Array, is_batched: bool) -> jax.Array:
            return x if is_batched else jnp.broadcast_to(jnp.asarray(x)[None], (size, *jnp.shape(x)))

        results = _batched(step_of, (size, *lead))(*jax.tree.map(with_axis, operands, tuple(batched)))
        return results, jax.tree.map(lambda _: True, results)

    return simulate


def _control_step(
    step_of: Callable[..., Callable[[], Substep]],
    lead: tuple[int, ...],
    motion: Motion,
    drive: Drive,
    fields: Fields,
) -> tuple[Motion, Trace]:
    axes, robots = len(lead), int(np.prod(lead, dtype=int))
    motor = {name: value for name, value in drive.motor._asdict().items() if value is not None}
    # Fields with a default are effects that a motor may lack: only those that it has are computed.
    effects = tuple(name for name in motor if name in Motor._field_defaults)
    shapes = tuple((name, jnp.shape(value)[axes:]) for name, value in sorted(fields.items()))
    substep_of = step_of(shapes, effects)
    joints, steps = drive.target.shape[-1], drive.target.shape[-2]
    fixed_inputs = {"kp": drive.kp, "kd": drive.kd, "encoder_bias": drive.encoder_bias}
    fixed_inputs |= {f"motor.{name}": value for name, value in motor.items()}
    fixed_inputs |= {f"lag.{name}": value for name, value in drive.lag._asdict().items()} if drive.lag else {}
    inputs_by_name = motion._asdict() | fields | {"target": drive.target}
    inputs_by_name |= {name: jnp.broadcast_to(value, (*lead, joints)) for name, value in fixed_inputs.items()}
    inputs, outputs = arguments(substep_of())
    arrays = [
        jnp.asarray(inputs_by_name[array.name], jnp.float32).reshape(array.shape(robots, steps))
        for array in inputs
    ]
    back_end = on_gpu if jax.default_backend() == "gpu" else on_processor
    results = back_end.run(substep_of, steps, robots, arrays)
    by_name = {
        array.name: result.reshape((*lead, *array.shape(1, steps)[1:]))
        for array, result in zip(outputs, results, strict=True)
    }
    points = by_name["trace.foot_position"]
    by_name["trace.foot_position"] = points.reshape((*points.shape[:-1], -1, 3))
    end = Motion(*(by_name.get(f"end.{name}") for name in Motion._fields))
    return end, Trace(*(by_name[f"trace.{name}"] for name in Trace._fields))
