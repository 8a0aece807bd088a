"""Writes `randomisation.yaml`: ranges of a small quadruped, scaled to a machine of another size."""

from collections.abc import Mapping

from footfall.robots.importer.machine import Machine
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.training_yaml import MASS_KG, REACH_M

MAX_LOAD_SHARE = 0.5  # largest share of the base's mass that a negative load may remove


def randomisation_yaml(machine: Machine, pose: Pose, defaults: Mapping[str, tuple[float, float]]) -> str:
    """The text of `randomisation.yaml`: loads are scaled by the mass, lengths by the legs' reach.

    Args:
        machine: the robot.
        pose: the default pose.
        defaults: lowest and highest value of each quantity, by name, for quadrupeds of `MASS_KG` on legs of
            `REACH_M`. The file has no entry for quantities that are not in this mapping.
    """
    mass_ratio, length_ratio = machine.mass / MASS_KG, pose.reach_m / REACH_M
    text = f"""\
# Changes to domain_rand/default.yaml: its payload, which suits a quadruped of {MASS_KG:g} kg, and its offset
# of the centre of mass, which suits legs of {REACH_M:g} m, scaled by size.
"""
    if "payload_kg" in defaults:
        low, high = (mass_ratio * kg for kg in defaults["payload_kg"])
        low = max(low, -MAX_LOAD_SHARE * machine.links[0].mass)
        text += f"payload_kg: {{low: {low:.2g}, high: {high:.2g}}}\n"
    if "com_offset_m" in defaults:
        low, high = (length_ratio * metres for metres in defaults["com_offset_m"])
        text += f"com_offset_m: {{low: {low:.2g}, high: {high:.2g}}}\n"
    return text
