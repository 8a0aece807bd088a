"""A proposed robot folder: identified bodies and motors, and randomisation ranges around them."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import yaml

from footfall.common.config import read_yaml
from footfall.common.errors import UserError
from footfall.common.outputs import write_text
from footfall.domain_rand.randomisation import OWN_FILE
from footfall.identify.fit import LegFit
from footfall.identify.parameters import ALL_QUANTITIES
from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec
from footfall.robots.spec_edits import make_inertia_explicit

IN_MODEL = (  # written to the model: ranges are around the model's values
    "armature",
    "joint_friction",
    "joint_damping",
    "link_mass",
)
RANGED = (  # only in randomisation.yaml: ranges are around the identified values
    *("motor_strength", "kp", "kd", "encoder_bias", "torque_lag_s"),
    *("stribeck_friction", "load_friction", "backlash_rad", "gear_compliance"),
)
# Learned by an actuator net, if there is one: ranges are around nominal.
LEARNED = ("motor_strength", "kp", "kd", "torque_lag_s")


def propose(
    robot: Robot, fits: Sequence[LegFit], sources: Sequence[str], folder: Path, with_net: bool = False
) -> Path:
    """Write a robot folder with the identified parameters.

    Args:
        robot: nominal robot, whose folder is copied.
        fits: fits of its legs.
        sources: names of the recordings, for the provenance.
        folder: new folder.
        with_net: True if an actuator net for this folder will be trained: ranges of the quantities that the
            net learns are then around nominal.

    Raises:
        UserError: the folder exists, or cannot be written.
    """
    if folder.exists():
        raise UserError(f"{folder} exists: give another --out, nothing is overwritten")
    try:
        shutil.copytree(robot.folder, folder, ignore=shutil.ignore_patterns("__pycache__"))
    except (OSError, shutil.Error) as error:
        raise UserError(f"cannot write {folder}: {error}") from None
    write_text(folder / robot.description.model, _mjcf(robot, fits))
    write_text(folder / OWN_FILE, _ranges(robot, fits, sources, folder / OWN_FILE, with_net))
    return folder


def _mjcf(robot: Robot, fits: Sequence[LegFit]) -> str:
    """The robot's MJCF with identified inertias and friction."""
    spec = load_spec(robot.xml_path)
    make_inertia_explicit(spec)
    for fit in fits:
        leg = fit.leg
        for row, name in enumerate(leg.joint_names):
            joint = spec.joint(name)
            armature, friction, damping = (
                fit.value(each, name) for each in ("armature", "joint_friction", "joint_damping")
            )
            if armature is not None:
                joint.armature = armature * float(leg.armature[row])
            if friction is not None:
                joint.frictionloss = friction * float(leg.motor.friction[row])
            if damping is not None:
                _set_damping(joint, damping + float(leg.motor.damping[row]))
        for name in leg.body_names:
            mass = fit.value("link_mass", name)
            if mass is not None:
                body = spec.body(name)
                body.mass, body.inertia = mass * body.mass, mass * np.array(body.inertia)
    spec.compile()
    text: str = spec.to_xml()
    return text


def _set_damping(joint: mujoco.MjsJoint, damping: float) -> None:
    """Viscous damping of a joint, which MjSpec stores as a number or as an array."""
    values = np.zeros_like(np.atleast_1d(joint.damping), dtype=float)
    values[0] = damping
    joint.damping = values if np.ndim(joint.damping) else damping


def _ranges(
    robot: Robot, fits: Sequence[LegFit], sources: Sequence[str], own_file: Path, with_net: bool
) -> str:
    """Content of randomisation.yaml: the robot's own ranges of quantities not identified, then new ones."""
    lines = [
        "# Identified from the robot's own motion by `footfall identify fit`. Ground friction,",
        "# payload and centre of mass cannot be identified this way and keep their ranges.",
        f"# Nominal robot: {robot.name}, digest {robot.digest}.",
        *(f"# Recording: {source}" for source in sources),
    ]
    ranges = {}
    for name in (*IN_MODEL, *RANGED):
        limits = _range(name, fits, name in IN_MODEL or (with_net and name in LEARNED))
        if limits is not None:
            ranges[name] = limits
    delays = [each.value for fit in fits for each in fit.estimates if each.parameter.quantity == "delay_s"]
    if delays:
        floor = ALL_QUANTITIES["delay_s"].floor
        ranges["action_delay_s"] = max(0.0, min(delays) - floor), max(delays) + floor
    if own_file.is_file():
        lines += [line for line in own_file.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
        kept = {name: value for name, value in (read_yaml(own_file) or {}).items() if name not in ranges}
        lines += yaml.safe_dump(kept, default_flow_style=None, sort_keys=False).splitlines() if kept else []
    lines += [f"{name}: {{low: {low:.5g}, high: {high:.5g}}}" for name, (low, high) in ranges.items()]
    return "\n".join(lines) + "\n"


def _range(name: str, fits: Sequence[LegFit], about_nominal: bool) -> tuple[float, float] | None:
    """A quantity's range; None if it was not identified."""
    quantity = ALL_QUANTITIES[name]
    estimates = [each for fit in fits for each in fit.estimates if each.parameter.quantity == name]
    if not estimates:
        return None
    half = max(quantity.floor, *((each.high - each.low) / 2.0 for each in estimates))
    if about_nominal:
        middle = quantity.nominal
        return max(0.0, middle - half) if quantity.low >= 0.0 else middle - half, middle + half
    low, high = min(each.value for each in estimates) - half, max(each.value for each in estimates) + half
    return (max(quantity.low, low) if quantity.low >= 0.0 else low), high


def table_rows(fits: Sequence[LegFit]) -> list[tuple[str, str, str, str, str]]:
    """Owner, quantity, value, interval and unit of each parameter, estimated or frozen."""
    rows = []
    for fit in fits:
        for each in fit.estimates:
            unit = each.parameter.declaration.unit or "x nominal"
            rows.append(
                (
                    each.parameter.owner,
                    each.parameter.quantity,
                    f"{each.value:.4g}",
                    f"{each.low:.4g} to {each.high:.4g}",
                    unit,
                )
            )
        rows += [(each.owner, each.quantity, "not identifiable", "", "") for each in fit.frozen]
    return rows
