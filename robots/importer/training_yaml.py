"""Writes `training.yaml`: the presets' figures of a small quadruped, scaled to another size."""

from footfall.robots.commands import CommandRange
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.pose import Pose

# The robot for which the presets (train/presets/) were tuned, and values for it that depend on size.
MASS_KG, REACH_M = 13.0, 0.45
FREQUENCY_HZ, SWING_HEIGHT_M = 2.2, 0.08
TORQUE, POWER = -1.2e-3, -6.8e-3
CROWDED_FEET, FOOT_DISTANCE_M = -40.0, 0.12  # less than the presets': other robots may stand on narrower feet
RANGE_FACTOR = 1.2  # largest command in training over the largest in scenarios


def training_yaml(machine: Machine, pose: Pose, commands: CommandRange, gait_name: str | None) -> str:
    """The text of `training.yaml`, with a gait if there is one for this machine.

    Lengths are scaled by the legs' reach, times by its square root, forces by the mass (dynamic similarity:
    Alexander and Jayes 1983, A dynamic similarity hypothesis for the gaits of quadrupedal mammals), and the
    costs of torque and power are scaled so that a machine of the same build has the same costs.
    """
    mass = machine.mass / MASS_KG
    length = pose.reach_m / REACH_M
    time = length**0.5
    torque, power = TORQUE / (mass * length) ** 2, POWER / (mass * length / time)
    ranges = {name: [RANGE_FACTOR * bound for bound in bounds] for name, bounds in vars(commands).items()}
    gait = (
        f"  gait: {{name: {gait_name}, frequency_hz: {FREQUENCY_HZ / time:.3g}}}\n"
        if gait_name
        else "  gait: null # no gait in policies/gaits.yaml has this number of feet on each side\n"
    )
    standing = (
        ""
        if machine.stands_still
        else "    standing_command: 0.0 # the robot steps in place: it cannot stand still\n"
    )
    return f"""\
# Changes to the presets, which suit a quadruped of {MASS_KG:g} kg on legs of {REACH_M:g} m: lengths, times,
# and the costs of torque and power are scaled to this robot's size. Not tuned.
env:
{gait}  commands:
    ranges: {{{", ".join(f"{axis}: [{low:.2g}, {high:.2g}]" for axis, (low, high) in ranges.items())}}}
{standing}  rewards:
    torque: {torque:.2g}
    power: {power:.2g}
    swing_height: {{height_m: {SWING_HEIGHT_M * length:.2g}}}
    crowded_feet: {{weight: {CROWDED_FEET / length**2:.3g}, distance_m: {FOOT_DISTANCE_M * length:.2g}}}
"""
