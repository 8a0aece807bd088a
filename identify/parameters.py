"""Parameters of a leg that can be fitted, one row per quantity, and values for many candidates at once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.identify.leg import FixedLeg
from footfall.robots.actuator import Motor


class Quantity(NamedTuple):
    """A quantity to fit, for each joint or each body."""

    owner_kind: str  # "joint" or "body"
    unit: str  # "" for a factor on the nominal value
    nominal: float
    low: float
    high: float
    scale: float  # typical difference between two robots
    floor: float  # minimum half-width of a range
    field: str = ""  # field of `Motor`, for an effect that is fitted only on request


# Of several quantities that are unidentifiable together, the first one is frozen. So quantities that a
# datasheet gives, or that can be weighed, come first. Floors: run-to-run deviation of fits on one robot.
QUANTITIES = {
    "link_mass": Quantity("body", "", 1.0, 0.5, 2.0, 0.1, 0.03),
    "friction_speed": Quantity("joint", "", 1.0, 0.1, 10.0, 0.5, 0.5),
    "torque_lag_s": Quantity("joint", "s", 0.0, 0.0, 0.03, 0.003, 0.001),
    "kd": Quantity("joint", "", 1.0, 0.3, 3.0, 0.2, 0.1),
    "kp": Quantity("joint", "", 1.0, 0.5, 2.0, 0.1, 0.03),
    "encoder_bias": Quantity("joint", "rad", 0.0, -0.2, 0.2, 0.01, 0.003),
    "delay_s": Quantity("joint", "s", 0.002, 0.0, 0.04, 0.004, 0.002),
    "motor_strength": Quantity("joint", "", 1.0, 0.3, 2.0, 0.1, 0.03),
    "joint_damping": Quantity("joint", "N m s/rad", 0.0, 0.0, 2.0, 0.05, 0.01),
    "joint_friction": Quantity("joint", "", 1.0, 0.0, 10.0, 0.3, 0.15),
    "armature": Quantity("joint", "", 1.0, 0.1, 8.0, 0.3, 0.05),
}
# Fitted on request, if the quantities above do not explain the motion.
EFFECTS = {
    "stribeck_friction": Quantity("joint", "N m", 0.0, 0.0, 5.0, 0.1, 0.05, "stribeck"),
    "load_friction": Quantity("joint", "", 0.0, 0.0, 0.5, 0.03, 0.01, "load_friction"),
    "backlash_rad": Quantity("joint", "rad", 0.0, 0.0, 0.1, 0.002, 0.001, "backlash"),
    "gear_compliance": Quantity("joint", "rad/(N m)", 0.0, 0.0, 0.05, 0.001, 0.0005, "compliance"),
    "link_com": Quantity("body", "", 1.0, -1.0, 4.0, 0.1, 0.03),  # centre of mass from the joint
}
ALL_QUANTITIES = QUANTITIES | EFFECTS
FREEZING_ORDER = (*EFFECTS, *QUANTITIES)


@dataclass(frozen=True)
class Parameter:
    """One parameter of a fit."""

    quantity: str
    owner: str  # name of a joint or body

    @property
    def declaration(self) -> Quantity:
        return ALL_QUANTITIES[self.quantity]

    @property
    def label(self) -> str:
        """Text for tables."""
        return f"{self.owner} {self.quantity}"


class Values(NamedTuple):
    """Parameter values of K candidates for a leg with n joints and m bodies."""

    armature: np.ndarray  # (K, n) kg m^2
    motor: Motor  # fields (K, 1, n)
    encoder_bias: np.ndarray  # (K, 1, n) rad
    kp: np.ndarray  # (K, 1, n) relative to the commanded stiffness
    kd: np.ndarray  # (K, 1, n) relative to the commanded damping
    delay_s: np.ndarray  # (K, n) from a command's tick to its effect, including the readings' delay
    link_mass: np.ndarray  # (K, m) relative to the nominal masses
    link_com: np.ndarray  # (K, m) relative to the nominal centres of mass in the bodies' frames


def parameters_of(leg: FixedLeg, effects: Sequence[str] = ()) -> tuple[Parameter, ...]:
    """All parameters of a leg, including those of some of `EFFECTS`."""
    names = (*effects, *QUANTITIES)
    return tuple(Parameter(name, owner) for name in names for owner in _owners(leg, name))


def _owners(leg: FixedLeg, name: str) -> tuple[str, ...]:
    return {"joint": leg.joint_names, "body": leg.body_names}[ALL_QUANTITIES[name].owner_kind]


def nominal(parameters: Sequence[Parameter]) -> np.ndarray:
    """Nominal values of parameters, (p,)."""
    return np.array([each.declaration.nominal for each in parameters])


def values_of(leg: FixedLeg, parameters: Sequence[Parameter], numbers: np.ndarray) -> Values:
    """The candidates given by the columns of `numbers`, (p, K); all other parameters are nominal."""
    count = numbers.shape[1]
    row_of = {(each.quantity, each.owner): row for row, each in enumerate(parameters)}

    def of_owners(name: str) -> np.ndarray:
        """Values of a quantity, (K, owners)."""
        rows = [row_of.get((name, owner)) for owner in _owners(leg, name)]
        return np.stack(
            [np.full(count, ALL_QUANTITIES[name].nominal) if row is None else numbers[row] for row in rows],
            axis=1,
        )

    def of_joints(name: str) -> np.ndarray:
        return of_owners(name)[:, None, :]

    motor, ones = leg.motor, np.ones((count, 1, leg.count))
    fields = {name: value * ones for name, value in motor._asdict().items() if value is not None}
    for name in {each.quantity for each in parameters if each.declaration.field}:
        field = EFFECTS[name].field
        fields[field] = fields.get(field, 0.0) + of_joints(name)
    return Values(
        armature=leg.armature * of_owners("armature"),
        motor=motor._replace(
            **fields
            | {
                "friction": motor.friction * of_joints("joint_friction"),
                "damping": motor.damping + of_joints("joint_damping"),
                "friction_speed": motor.friction_speed * of_joints("friction_speed"),
                "strength": motor.strength * of_joints("motor_strength"),
                "lag_s": (0.0 if motor.lag_s is None else motor.lag_s) + of_joints("torque_lag_s"),
            }
        ),
        encoder_bias=of_joints("encoder_bias"),
        kp=of_joints("kp"),
        kd=of_joints("kd"),
        delay_s=of_owners("delay_s"),
        link_mass=of_owners("link_mass"),
        link_com=of_owners("link_com"),
    )
