"""Printed results of `footfall robot check`, and their limits."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from footfall.plain_table import print_table

if TYPE_CHECKING:
    from footfall.plant.lying import LyingResult
    from footfall.plant.standing import StandingResult
    from footfall.plant.walking import ControllerResult
    from footfall.robots.description import Robot
    from footfall.robots.inspection import Inspection

MAX_SINK_SHARE = 0.15  # share of the standing height
MAX_TILT_RAD = 0.17
MAX_TORQUE_SHARE = 0.8


def show_tree(robot: "Robot", inspection: "Inspection") -> None:
    rows = []
    for link in inspection.links:
        driven = [name for name in link.joints if name in robot.joint_names]
        figures = [_joint_row(robot, robot.joint_index(name)) for name in driven] or [[""] * 5]
        rows.append(["  " * link.depth + link.name, f"{link.mass_kg:.3f}", *figures[0]])
        rows += [["", "", *other_joint] for other_joint in figures[1:]]
    print_table(["link", "kg", "joint", "range, rad", "default", "peak, N m", "kp, N m/rad"], rows)
    x, y, z = inspection.centre_m
    centre = f"centre of mass {x:.3f} {y:.3f} {z:.3f} m from the base's origin"
    print(f"total {inspection.mass_kg:.2f} kg, {centre}\n")


def _joint_row(robot: "Robot", i: int) -> list[str]:
    return [
        robot.joint_names[i],
        f"{robot.lower_rad[i]:.2f} to {robot.upper_rad[i]:.2f}",
        f"{robot.default_pose[i]:.2f}",
        f"{robot.motor.peak_torque[i]:g}",
        f"{robot.kp[i]:.0f}",
    ]


def show_feet(inspection: "Inspection") -> None:
    rows = [
        [
            foot.name,
            " ".join(f"{value:.3f}" for value in foot.position),
            f"{1e3 * foot.gap_m:.1f}",
            f"{foot.reach_m[0]:.3f} to {foot.reach_m[1]:.3f}",
        ]
        for foot in inspection.feet
    ]
    print_table(
        ["foot", "position in the default pose, m", "above the ground, mm", "reach of the leg, m"], rows
    )
    side = "inside" if inspection.margin_m >= 0.0 else "outside"
    print(f"the centre of mass is {1e3 * abs(inspection.margin_m):.0f} mm {side} the feet\n")


def show_standing(robot: "Robot", standing: "StandingResult | None") -> None:
    if standing is None:
        print("no standing test: hold this robot up in a run until it steps in place (held_start)\n")
        return
    most_loaded = int(standing.torque_share.argmax())
    share = f"{100 * standing.torque_share[most_loaded]:.0f} % of its peak torque"
    print(f"standing test, {standing.stood_s:.1f} s with the joint law over the simulated bus:")
    print(f"  sank {1e3 * standing.sank_m:.0f} mm of {1e3 * robot.description.standing_height_m:.0f}")
    print(f"  tilted {np.degrees(standing.tilt_rad):.1f} degrees, moved {1e3 * standing.moved_m:.0f} mm")
    print(f"  highest load: {robot.joint_names[most_loaded]}, {share}\n")


def standing_findings(robot: "Robot", standing: "StandingResult | None") -> Iterator[str]:
    if standing is None:
        return
    if not standing.stood:
        reason = standing.fall_reason or "; ".join(standing.faults)
        yield f"the robot does not stand: {reason} after {standing.stood_s:.1f} s"
        return
    if standing.sank_m > MAX_SINK_SHARE * robot.description.standing_height_m:
        sank_mm = 1e3 * standing.sank_m
        yield f"the robot sinks by {sank_mm:.0f} mm: the gains are low, or the pose is hard to hold"
    if standing.tilt_rad > MAX_TILT_RAD:
        yield f"the robot tilts by {np.degrees(standing.tilt_rad):.0f} degrees"
    for name, share in zip(robot.joint_names, standing.torque_share, strict=True):
        if share > MAX_TORQUE_SHARE:
            yield f"joint {name} needs {100 * share:.0f} % of its peak torque to stand"
    for foot, share in zip(robot.description.feet, standing.feet_down, strict=True):
        if share < 0.5:
            yield f"foot {foot.name} is in the air"


def show_lying(lying: "LyingResult | None") -> None:
    if lying is None:
        print("no lying test: without lying_rad in robot.yaml the robot does not lie down at the end\n")
        return
    print("lying test, from the ground to the default pose and back:")
    print(f"  base {1e3 * max(lying.clearance_m, 0.0):.0f} mm above the ground at the end")
    print(f"  tilted {np.degrees(lying.tilt_rad):.1f} degrees\n")


def lying_findings(lying: "LyingResult | None") -> Iterator[str]:
    if lying is not None and lying.trouble:
        yield f"the robot does not stand up from its lying pose and lie down again: {lying.trouble}"


def show_controllers(results: "Sequence[ControllerResult]") -> None:
    """Print how each controller stood or walked."""
    if not results:
        return
    rows = [
        [
            result.name,
            f"{result.command_m_s:.2f}",
            f"{result.speed_m_s:.2f}",
            result.outcome,
        ]
        for result in results
    ]
    print_table(["controller", "command, m/s", "speed, m/s", "in simulation"], rows)
    print()


def controller_findings(results: "Sequence[ControllerResult]") -> Iterator[str]:
    """Controllers that did not stand or walk, one line each."""
    for result in results:
        if result.trouble:
            yield f"controller {result.name}: {result.trouble}"


def gains_beyond_frames(robot: "Robot") -> Iterator[str]:
    """Gains above the range of the motor's CAN frames, which would be clamped."""
    from footfall.deploy.drivers.mit import RANGES

    for joint, kp, kd in zip(robot.description.joints, robot.kp, robot.kd, strict=True):
        protocol = robot.description.motors[joint.motor].protocol
        ranges = RANGES.get(protocol)
        if ranges is None:
            continue
        for gain, value, limit in (("kp", kp, ranges.kp), ("kd", kd, ranges.kd)):
            if value > limit:
                yield f"joint {joint.name}: {gain} is {value:.3g}, above the {limit:g} of {protocol} frames"
