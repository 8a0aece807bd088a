"""The declaration of what may differ between robots, and one draw of it."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from footfall.common.config import load
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.sample import Sample

Array = Any
DEFAULT = Path(__file__).parent / "default.yaml"


@dataclass(frozen=True)
class Randomisation:
    """What differs from one episode to the next. A field that is absent keeps its nominal value."""

    # body
    friction: Distribution | None = None  # foot on ground, coefficient
    link_mass: Distribution | None = None  # scale of each body's mass (and inertia with it)
    payload_kg: Distribution | None = None  # added to the base
    com_offset_m: Distribution | None = None  # of the base, each axis
    inertia: Distribution | None = None  # scale of each body's inertia, beyond its mass
    armature: Distribution | None = None  # scale of reflected inertia, each joint
    # motors
    joint_friction: Distribution | None = None  # scale, each joint
    joint_damping: Distribution | None = None  # viscous, N m s/rad, each joint
    motor_strength: Distribution | None = None  # delivered over commanded torque, each joint
    kp: Distribution | None = None  # scale, each joint
    kd: Distribution | None = None  # scale, each joint
    battery: Distribution | None = None  # scale of stall torque and no-load speed
    # timing
    action_delay_s: Distribution | None = None
    observation_delay_s: Distribution | None = None
    # sensors
    encoder_bias: Distribution | None = None  # rad, each joint
    gyro_bias: Distribution | None = None  # rad/s, each axis
    gravity_bias: Distribution | None = None  # on the projected gravity, each axis


def load_randomisation(path: Path = DEFAULT) -> Randomisation:
    """Read a declaration from YAML; raises UserError if it is malformed."""
    return load(path, Randomisation)


def sample_shapes(joints: int, bodies: int) -> dict[str, tuple[int, ...]]:
    """Shape of each field of a sample."""
    per_joint, per_body, vector = (joints,), (bodies,), (3,)
    return {
        "friction": (),
        "link_mass": per_body,
        "payload_kg": (),
        "com_offset_m": vector,
        "inertia": per_body,
        "armature": per_joint,
        "joint_friction": per_joint,
        "joint_damping": per_joint,
        "motor_strength": per_joint,
        "kp": per_joint,
        "kd": per_joint,
        "battery": (),
        "action_delay_s": (),
        "observation_delay_s": (),
        "encoder_bias": per_joint,
        "gyro_bias": vector,
        "gravity_bias": vector,
    }


def draw(randomisation: Randomisation, uniform: Callable[[int], Array], joints: int, bodies: int) -> Sample:
    """One robot out of the declared family.

    Args:
        randomisation: the declaration.
        uniform: gives k independent numbers in [0, 1), shape (k,); called once.
        joints: number of joints.
        bodies: number of bodies of the model, the world left out.
    """
    shapes = sample_shapes(joints, bodies)
    sizes = {name: shape[0] if shape else 1 for name, shape in shapes.items()}
    numbers = uniform(sum(sizes.values()))
    drawn, start = {}, 0
    for field in fields(randomisation):
        stop = start + sizes[field.name]
        distribution: Distribution | None = getattr(randomisation, field.name)
        if distribution is not None:
            drawn[field.name] = distribution.quantile(numbers[start:stop]).reshape(shapes[field.name])
        start = stop
    return Sample(**drawn)
