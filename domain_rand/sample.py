"""One draw: the differences of a particular robot from the nominal one."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation
from footfall.robots.actuator import JointCommand, Motor
from footfall.robots.kinds import Parts
from footfall.robots.winding import Winding

Array = Any
T = TypeVar("T", bound=NamedTuple)

# Drawn values for an episode, by the quantity's name; absent quantities are nominal. For shapes see
# `sample_shapes`, for units and meanings `Randomisation`.
Sample = dict[str, Array]


def sample_shapes(joints: int, bodies: int, foot_sensors: int = 0) -> dict[str, tuple[int, ...]]:
    """Shape of each quantity; the world does not count as a body."""
    parts = Parts(joints, bodies, foot_sensors)
    return {name: quantity.kind.shape(parts) for name, quantity in QUANTITIES.items()}


def draw(
    randomisation: Randomisation,
    uniform: Callable[[int], Array],
    joints: int,
    bodies: int,
    foot_sensors: int = 0,
) -> Sample:
    """Draw one robot.

    Args:
        randomisation: the declaration.
        uniform: returns k independent numbers in [0, 1), shape (k,); called once.
        joints: number of joints.
        bodies: number of bodies of the model, without the world.
        foot_sensors: number of force sensors at the feet.
    """
    parts = Parts(joints, bodies, foot_sensors)
    sizes = {name: quantity.kind.size(parts) for name, quantity in QUANTITIES.items()}
    numbers = uniform(sum(sizes.values()))
    drawn, start = {}, 0
    for name, shape in sample_shapes(joints, bodies, foot_sensors).items():
        stop = start + sizes[name]
        distribution: Distribution | None = getattr(randomisation, name)
        if distribution is not None:
            drawn[name] = distribution.quantile(numbers[start:stop]).reshape(shape)
        start = stop
    return drawn


def towards_nominal(sample: Sample, share: Array | float, friction: float) -> Sample:
    """The sampled robot moved towards the nominal one.

    Args:
        sample: a draw.
        share: share of the distance from the nominal robot to keep, 0 to 1.
        friction: nominal coefficient of the feet on the ground.
    """
    moved = {}
    for name, value in sample.items():
        nominal = QUANTITIES[name].nominal
        nominal = friction if nominal is None else nominal
        moved[name] = nominal + share * (value - nominal)
    return moved


def randomised_motor(motor: Motor, sample: Sample) -> Motor:
    """The motors of the sampled robot, from the nominal ones."""
    return changed(motor, sample, "motor")


def randomised_command(command: JointCommand, sample: Sample) -> JointCommand:
    """The command with the true stiffness and damping of the sampled robot's motors."""
    return changed(command, sample, "command")


def randomised_winding(winding: Winding | None, sample: Sample) -> Winding | None:
    """The thermal parameters of the sampled robot, from the nominal ones; None without a thermal model."""
    return None if winding is None else changed(winding, sample, "winding")


def sensor_bias(sample: Sample, reading: str) -> Array | None:
    """Bias of the sampled robot's sensor, in the shape of the reading; None without bias."""
    drawn = [sample[name] for name, each in QUANTITIES.items() if each.bias_of == reading and name in sample]
    return sum(drawn[1:], start=drawn[0]) if drawn else None


def battery_charge(sample: Sample, otherwise: float | None = None) -> Any:
    """Initial charge of the sampled robot's battery, 0 to 1; `otherwise` if it is not randomised."""
    drawn = (sample[name] for name, each in QUANTITIES.items() if each.charge and name in sample)
    return next(drawn, otherwise)


def changed(values: T, sample: Sample, effect_on: str) -> T:
    """Values with a sample's effects; `effect_on` names the effect's field of `Quantity`."""
    for name, quantity in QUANTITIES.items():
        effect = getattr(quantity, effect_on)
        if effect is not None and name in sample:
            new = {field: effect.change(getattr(values, field), sample[name]) for field in effect.fields}
            values = values._replace(**new)
    return values
