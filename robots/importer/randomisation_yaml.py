"""Writes `randomisation.yaml`: loads that suit a small quadruped, for a machine of another size."""

from footfall.robots.importer.machine import Machine
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.training_yaml import MASS_KG, REACH_M

PAYLOAD_KG, COM_OFFSET_M = (-1.0, 2.0), (-0.03, 0.03)  # of domain_rand/default.yaml
MOST_TAKEN = 0.5  # share of the base's mass that a load below zero may take away


def randomisation_yaml(machine: Machine, pose: Pose) -> str:
    """The text of `randomisation.yaml`: loads are scaled by the mass, lengths by the legs' reach."""
    low, high = (kg * machine.mass / MASS_KG for kg in PAYLOAD_KG)
    low = max(low, -MOST_TAKEN * machine.links[0].mass)
    left, right = (metres * pose.reach_m / REACH_M for metres in COM_OFFSET_M)
    return f"""\
# What differs between robots of this kind, where domain_rand/default.yaml means another: its load on a
# quadruped of {MASS_KG:g} kg, and the offset of its centre of mass on legs of {REACH_M:g} m, by size.
payload_kg: {{low: {low:.2g}, high: {high:.2g}}}
com_offset_m: {{low: {left:.2g}, high: {right:.2g}}}
"""
