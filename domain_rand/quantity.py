"""The declaration of a randomised quantity: its kind, its nominal value and its effects.

An effect is the same in training (JAX, MJX models) and on the simulated robot (NumPy, MuJoCo models).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np

from footfall.robots.kinds import Kind
from footfall.robots.readings import READINGS

Array = Any
Direction = Literal["actions", "readings"]  # of frames: to the motors, from the robot
SCALE, OFFSET = 1.0, 0.0  # nominal values of factors and of summands


@dataclass(frozen=True)
class BodyMap:
    """Indices in a model of the parts that a sample changes."""

    base: int  # body that carries the free joint
    contact_geoms: tuple[int, ...]  # geoms whose friction determines foot-ground contact
    dofs: tuple[int, ...]  # degrees of freedom of the joints, in joint order


class Effect(NamedTuple):
    """A change of some fields of a model, of motors, of a joint command or of another declared class."""

    fields: tuple[str, ...]
    change: Callable[..., Array]  # from the field's and the drawn value (models: also BodyMap) to the new one


class Quantity(NamedTuple):
    """The declaration of a quantity that differs from robot to robot, with at least one effect."""

    kind: Kind  # its shape, and its mirror image
    nominal: float | None  # None: the robot's own value
    lower: float = -math.inf  # limits of sensible values for any robot
    upper: float = math.inf
    model: Effect | None = None  # on the fields of a MuJoCo model
    motor: Effect | None = None  # on the fields of robots.actuator.Motor
    command: Effect | None = None  # on a JointCommand, as the motors carry it out
    winding: Effect | None = None  # on the fields of robots.winding.Winding
    force_sensor: Effect | None = None  # on the fields of domain_rand.foot_force.ForceSensors
    accelerometer: Effect | None = None  # on the fields of domain_rand.accelerometer.Accelerometer
    actions: Effect | None = None  # on the fields of domain_rand.transport.Transport, for commands
    readings: Effect | None = None  # on the fields of domain_rand.transport.Transport, for readings
    bias_of: str | None = None  # reading to which the drawn value is added
    charge: bool = False  # whether it is the battery's initial charge, 0 to 1


def quantity(kind: Kind, nominal: float | None, **rest: Any) -> Any:
    """A field of `Randomisation`: it declares a quantity, with limits and effects as `Quantity` has."""
    return field(default=None, metadata={"declares": Quantity(kind, nominal, **rest)})


def check_quantity(name: str, declared: Quantity) -> None:
    """Raise ValueError for a declaration without an effect."""
    effects = (
        declared.model,
        declared.motor,
        declared.command,
        declared.winding,
        declared.force_sensor,
        declared.accelerometer,
        declared.actions,
        declared.readings,
    )
    if not declared.charge and not any((*effects, declared.bias_of)):
        raise ValueError(
            f"quantity '{name}' has no effect: give model, motor, command, winding, force_sensor,"
            " accelerometer, actions, readings, bias_of or charge"
        )
    if declared.bias_of is not None and declared.bias_of not in READINGS:
        raise ValueError(f"quantity '{name}': no reading '{declared.bias_of}', only {', '.join(READINGS)}")
    if declared.bias_of is not None and declared.kind is not READINGS[declared.bias_of].kind:
        raise ValueError(f"quantity '{name}' and reading '{declared.bias_of}' differ in kind")


def scales(*names: str) -> Effect:
    """The drawn value multiplies these fields; a field that is None stays None."""
    return Effect(names, lambda nominal, drawn: None if nominal is None else nominal * drawn)


def adds_to(*names: str) -> Effect:
    """The drawn value is added to these fields; a field that is None gets the drawn value."""
    return Effect(names, lambda nominal, drawn: drawn if nominal is None else nominal + drawn)


def scales_bodies(*names: str) -> Effect:
    """One drawn value per body (without the world) multiplies these model fields (bodies, ...)."""

    def change(nominal: Array, drawn: Array, _: BodyMap) -> Array:
        xp = nominal.__array_namespace__()
        scale = xp.concat([xp.ones(1, dtype=nominal.dtype), drawn])
        return nominal * _column(scale, nominal)

    return Effect(names, change)


def adds_to_base(*names: str) -> Effect:
    """The drawn value is added to the base's row of these model fields (bodies, ...)."""

    def change(nominal: Array, drawn: Array, where: BodyMap) -> Array:
        xp = nominal.__array_namespace__()
        at_base = xp.asarray(np.arange(nominal.shape[0]) == where.base, dtype=nominal.dtype)
        return nominal + _column(at_base, nominal) * drawn

    return Effect(names, change)


def scales_joints(*names: str) -> Effect:
    """One drawn value per joint multiplies these model fields (nv,) at the joints' degrees of freedom."""

    def change(nominal: Array, drawn: Array, where: BodyMap) -> Array:
        xp = nominal.__array_namespace__()
        selection, rest = np.zeros((nominal.shape[0], len(where.dofs))), np.ones(nominal.shape[0])
        selection[list(where.dofs), np.arange(len(where.dofs))] = 1.0
        rest[list(where.dofs)] = 0.0
        joint_scale = xp.asarray(selection, dtype=nominal.dtype) @ drawn
        return nominal * (joint_scale + xp.asarray(rest, dtype=nominal.dtype))

    return Effect(names, change)


def sets_sliding_friction() -> Effect:
    """The drawn value is the sliding friction of the geoms that determine foot-ground contact."""

    def change(nominal: Array, drawn: Array, where: BodyMap) -> Array:
        xp = nominal.__array_namespace__()
        sliding = np.zeros(nominal.shape, dtype=bool)
        sliding[list(where.contact_geoms), 0] = True
        return xp.where(xp.asarray(sliding), drawn, nominal)

    return Effect(("geom_friction",), change)


def _column(values: Array, like: Array) -> Array:
    """Values (k,) as a column that multiplies the rows of `like` (k, ...)."""
    return values.reshape(-1, *(1,) * (like.ndim - 1))
