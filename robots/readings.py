"""The sensor values of a robot, and the readings that a learned policy may use."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np

from footfall.common.config import require_between
from footfall.common.errors import UserError
from footfall.common.rotations import projected_gravity, shift_gravity
from footfall.robots import kinds
from footfall.robots.kinds import Kind, Parts

Array = Any  # a NumPy or a JAX array
Readings = dict[str, Array]  # each reading of READINGS by name, shapes (..., size)


NO_FORCES = np.zeros(0)
NO_FORCES.flags.writeable = False


class Sensed(NamedTuple):
    """One decoded set of sensor values from the bus; in training, the simulation's true values.

    The annotation of a field gives its number of components. Observations, logs and simulated sensors use
    this field order and these sizes.
    """

    gyro: Annotated[Array, kinds.ROTATION]  # rad/s, body frame
    acceleration: Annotated[Array, kinds.VECTOR]  # m/s^2, proper, at the IMU, body frame; None in training
    quaternion: Annotated[Array, kinds.QUATERNION]  # body to world, w x y z; its yaw drifts on a real robot
    joint_position: Annotated[Array, kinds.JOINTS]  # rad
    joint_velocity: Annotated[Array, kinds.JOINTS]  # rad/s
    joint_torque: Annotated[Array, kinds.JOINTS]  # N m, as reported by the motors
    # N, force on each foot by its sensor, NaN for a silent sensor; empty for a robot without force sensors.
    foot_force: Annotated[Array, kinds.FOOT_AMOUNTS] = NO_FORCES


SENSED: dict[str, Kind] = {
    name: hint.__metadata__[0] for name, hint in get_type_hints(Sensed, include_extras=True).items()
}


def sensed_sizes(joints: int, foot_sensors: int = 0) -> dict[str, int]:
    """Number of components of each field of `Sensed`, in field order."""
    return {name: kind.size(Parts(joints, feet=foot_sensors)) for name, kind in SENSED.items()}


class Reading(NamedTuple):
    """The declaration of a reading: a function of one field of `Sensed`."""

    kind: Kind  # number of components, and their mirror image
    sensed: str  # field of `Sensed`
    source: Callable[[Array], Array] | None = None  # reading from the field's value; None: the value itself
    # The field's value with an offset of the reading applied, as plain numbers. A simulated sensor needs it
    # to add bias and noise to a reading with a source; without a source, the offset is added.
    shift: Callable[[Sequence[float], Sequence[float]], Sequence[float]] | None = None
    unit_length: bool = False  # a direction: normalised after bias or noise is added

    @property
    def can_shift(self) -> bool:
        """Whether a simulated sensor can add bias and noise to it."""
        return self.source is None or self.shift is not None


def reading(kind: Kind, sensed: str, **rest: Any) -> Any:
    """A field of `Noise` that declares a reading of a field of `Sensed`; `rest`: fields of `Reading`."""
    return field(default=0.0, metadata={"declares": Reading(kind, sensed, **rest)})


@dataclass(frozen=True)
class Noise:
    """Half-width of the uniform noise on each reading that a policy may use.

    Each field declares a reading: its name, its source, and how bias and noise act on it. Training, the
    simulated robot and the log follow the declaration. An observation term has the same name
    (policies/observation.py).
    """

    gyro: float = reading(kinds.ROTATION, "gyro")  # rad/s, body frame
    gravity: float = reading(  # direction in the body frame, (0, 0, -1) when upright; noise on each component
        kinds.VECTOR, "quaternion", source=projected_gravity, shift=shift_gravity, unit_length=True
    )
    joint_position: float = reading(kinds.JOINTS, "joint_position")  # rad
    joint_velocity: float = reading(kinds.JOINTS, "joint_velocity")  # rad/s

    def __post_init__(self) -> None:
        require_between(self, 0.0, 100.0, *(each.name for each in fields(self)))


READINGS: dict[str, Reading] = {each.name: each.metadata["declares"] for each in fields(Noise)}


def read(sensed: Sensed) -> Readings:
    """All readings of sensed values.

    Raises:
        UserError: a reading needs a field that training does not simulate.
    """
    return {name: _read(name, declared, sensed) for name, declared in READINGS.items()}


def _read(name: str, declared: Reading, sensed: Sensed) -> Array:
    value = getattr(sensed, declared.sensed)
    if value is None:
        raise UserError(f"reading '{name}' needs {declared.sensed}, which training does not simulate")
    return value if declared.source is None else declared.source(value)


def readings_size(joints: int) -> int:
    """Number of components of all readings."""
    return sum(declared.kind.size(Parts(joints)) for declared in READINGS.values())


def as_vector(readings: Readings) -> Array:
    """Concatenated readings, shape (..., readings_size)."""
    xp = readings["gyro"].__array_namespace__()
    return xp.concat([readings[name] for name in READINGS], axis=-1)


def from_vector(vector: Array, joints: int) -> Readings:
    """The inverse of `as_vector`: splits a vector (..., readings_size), for instance of noise."""
    parts, start = {}, 0
    for name, declared in READINGS.items():
        stop = start + declared.kind.size(Parts(joints))
        parts[name] = vector[..., start:stop]
        start = stop
    return parts
