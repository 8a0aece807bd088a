"""What a robot senses of itself, and what of it a learned policy may know."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

from footfall.common.config import require_between
from footfall.common.rotations import projected_gravity
from footfall.robots import kinds
from footfall.robots.kinds import Kind, Parts

Array = Any  # a NumPy or a JAX array
Readings = dict[str, Array]  # each reading of READINGS by name, shapes (..., size)


class Sensed(NamedTuple):
    """One decoded set of readings, as they came over the bus; in training, the simulation's true ones."""

    gyro: Array  # (3,) rad/s, body frame
    acceleration: Array  # (3,) m/s^2, proper acceleration at the IMU, body frame; not simulated in training
    quaternion: Array  # (4,) unit, body to world, w x y z; its yaw drifts on a real robot
    joint_position: Array  # (n,) rad
    joint_velocity: Array  # (n,) rad/s
    joint_torque: Array  # (n,) N m, as the motors report it


class Reading(NamedTuple):
    """The declaration of a reading."""

    kind: Kind  # how many numbers, and their mirror image
    source: Callable[[Sensed], Array]  # the same on the robot and in training
    unit_length: bool = False  # a direction: normalised again whenever bias or noise was added


def reading(kind: Kind, source: Callable[[Sensed], Array], unit_length: bool = False) -> Any:
    """A field of `Noise`: it declares a reading."""
    return field(default=0.0, metadata={"declares": Reading(kind, source, unit_length)})


@dataclass(frozen=True)
class Noise:
    """The readings that a policy may know, and the half-width of the uniform noise on each.

    A field is all that a reading needs: its value is a setting, its default declares the reading. There is
    an observation term of the same name (policies/observation.py).
    """

    gyro: float = reading(kinds.ROTATION, lambda sensed: sensed.gyro)  # rad/s, body frame
    gravity: float = reading(  # direction in the body frame, (0, 0, -1) when upright; noise on each component
        kinds.VECTOR, lambda sensed: projected_gravity(sensed.quaternion), unit_length=True
    )
    joint_position: float = reading(kinds.JOINTS, lambda sensed: sensed.joint_position)  # rad
    joint_velocity: float = reading(kinds.JOINTS, lambda sensed: sensed.joint_velocity)  # rad/s

    def __post_init__(self) -> None:
        require_between(self, 0.0, 100.0, *(each.name for each in fields(self)))


READINGS: dict[str, Reading] = {each.name: each.metadata["declares"] for each in fields(Noise)}


def read(sensed: Sensed) -> Readings:
    """Every reading of what was sensed."""
    return {name: declared.source(sensed) for name, declared in READINGS.items()}


def readings_size(joints: int) -> int:
    """Numbers in a robot's readings."""
    return sum(declared.kind.size(Parts(joints)) for declared in READINGS.values())


def as_vector(readings: Readings) -> Array:
    """Readings laid end to end, shape (..., readings_size)."""
    xp = readings["gyro"].__array_namespace__()
    return xp.concat([readings[name] for name in READINGS], axis=-1)


def from_vector(vector: Array, joints: int) -> Readings:
    """The readings (or as many numbers that belong to them) that lie end to end in a vector (..., size)."""
    parts, start = {}, 0
    for name, declared in READINGS.items():
        stop = start + declared.kind.size(Parts(joints))
        parts[name] = vector[..., start:stop]
        start = stop
    return parts
