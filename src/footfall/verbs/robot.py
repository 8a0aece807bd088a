"""`footfall robot`: bring in a robot, and look one over."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import App, Parameter

from footfall.options import Names, RobotName, Seconds, Seed

if TYPE_CHECKING:
    from footfall.plant.lying import LyingResult
    from footfall.plant.standing import StandingResult
    from footfall.robots.description import Robot
    from footfall.robots.inspection import Inspection

robot = App(name="robot", help="Bring in a robot of your own, or look one over.")

SOMETHING_WRONG = 1
MOST_SUNK = 0.15  # share of the standing height
MOST_TILT_RAD = 0.17
MOST_TORQUE_SHARE = 0.8


def _by_joint(_: type, tokens: Any) -> dict[str, float]:
    """'23.7' for all joints, or 'hip=23.7,knee=35.5' by part of their names."""
    text = tokens[0].value
    values: dict[str, float] = {}
    for entry in text.split(","):
        part, _, number = entry.rpartition("=")
        try:
            values[part.strip()] = float(number)
        except ValueError:
            values[part.strip()] = -1.0
    if not all(0.0 < value < 1e6 for value in values.values()):
        raise ValueError(f"expected a number above 0, or such as hip=23.7,knee=35.5, found '{text}'")
    return values


ByJoint = Annotated[
    dict[str, float],
    Parameter(converter=_by_joint, n_tokens=1, accepts_keys=False, metavar="X|JOINT=X,…", negative=()),
]


@Parameter(name="*")
@dataclass(frozen=True)
class NewOptions:
    """What to make a robot of, and what its file does not say."""

    source: Annotated[Path, Parameter(name="--from")]
    """URDF or MJCF of the robot."""
    out: Path
    """Folder to make; its name becomes the robot's."""
    feet: Names = ()
    """Links that are feet or carry them (default: those called feet, or the lowest)."""
    packages: Annotated[tuple[Path, ...], Parameter(consume_multiple=True, negative=())] = ()
    """Folders that hold the packages of a URDF's meshes, beside those above the URDF and ROS_PACKAGE_PATH."""
    peak_torque: ByJoint = field(default_factory=dict)
    """Peak torque, N m, instead of the file's: one for all, or by part of the joints' names."""
    speed: ByJoint = field(default_factory=dict)
    """No-load speed, rad/s, likewise."""
    armature: ByJoint = field(default_factory=dict)
    """Reflected inertia, kg m^2, likewise: the rotor's times the gear ratio squared; URDF has none."""


@robot.command
def new(*, options: NewOptions) -> None:
    """Make a robot folder of a URDF or MJCF, and say what was guessed."""
    from footfall.deploy.drivers.mit import RANGES
    from footfall.domain_rand.randomisation import default_ranges
    from footfall.plant.lying import find_lying_pose
    from footfall.policies.gaits import gaits_of
    from footfall.robots.description import load_robot
    from footfall.robots.importer.create import ImportRequest, import_robot

    made = import_robot(
        ImportRequest(
            source=options.source,
            folder=options.out,
            protocols=RANGES,
            feet=options.feet,
            packages=options.packages,
            peak_torque_nm=options.peak_torque,
            speed_rad_s=options.speed,
            armature=options.armature,
            usual=default_ranges(),
            gaits_of=gaits_of,
            find_lying_pose=find_lying_pose,
        )
    )
    loaded = load_robot(options.out.resolve())
    feet = len(loaded.description.feet)
    print(f"wrote {made.folder}: {len(loaded.joint_names)} joints, {feet} feet. Guessed, to be checked:")
    for guess in made.guesses:
        print(f"- {guess}")
    print(f"look it over with: footfall robot check {made.folder}")


@Parameter(name="*")
@dataclass(frozen=True)
class CheckOptions:
    """How to test a robot."""

    duration: Seconds = 4.0
    """How long it has to stand, s."""
    seed: Seed = 0


@robot.command
def check(robot: RobotName, /, *, options: CheckOptions = CheckOptions()) -> int:
    """Print a robot's tree, feet and reach, and let it stand in simulation; exit 1 if something is wrong."""
    from footfall.plant.lying import lying_test
    from footfall.plant.standing import standing_test
    from footfall.robots.description import load_robot
    from footfall.robots.inspection import inspect_robot

    loaded = load_robot(robot)
    looked = inspect_robot(loaded, options.seed)
    _show_tree(loaded, looked)
    _show_feet(looked)
    standing = standing_test(loaded, options.duration, options.seed)
    _show_standing(loaded, standing)
    lying = None if loaded.lying_pose is None else lying_test(loaded, options.seed)
    _show_lying(lying)
    wrong = [
        *looked.findings(),
        *_beyond_frames(loaded),
        *_wrong_standing(loaded, standing),
        *_wrong_lying(lying),
    ]
    for finding in wrong:
        print(f"wrong: {finding}")
    if not wrong:
        print("nothing wrong was found")
    return SOMETHING_WRONG if wrong else 0


def _show_tree(robot: "Robot", looked: "Inspection") -> None:
    rows = []
    for link in looked.links:
        driven = [name for name in link.joints if name in robot.joint_names]
        figures = [_joint_row(robot, robot.joint_index(name)) for name in driven] or [[""] * 5]
        rows.append(["  " * link.depth + link.name, f"{link.mass_kg:.3f}", *figures[0]])
        rows += [["", "", *more] for more in figures[1:]]
    _print_table(["link", "kg", "joint", "range, rad", "default", "peak, N m", "kp, N m/rad"], rows)
    x, y, z = looked.centre_m
    print(f"total {looked.mass_kg:.2f} kg, centre of mass {x:.3f} {y:.3f} {z:.3f} m from the base's origin\n")


def _joint_row(robot: "Robot", i: int) -> list[str]:
    return [
        robot.joint_names[i],
        f"{robot.lower_rad[i]:.2f} to {robot.upper_rad[i]:.2f}",
        f"{robot.default_pose[i]:.2f}",
        f"{robot.motor.peak_torque[i]:g}",
        f"{robot.kp[i]:.0f}",
    ]


def _show_feet(looked: "Inspection") -> None:
    rows = [
        [
            foot.name,
            " ".join(f"{value:.3f}" for value in foot.place),
            f"{1e3 * foot.gap_m:.1f}",
            f"{foot.reach_m[0]:.3f} to {foot.reach_m[1]:.3f}",
        ]
        for foot in looked.feet
    ]
    _print_table(
        ["foot", "place in the default pose, m", "above the ground, mm", "reach of the leg, m"], rows
    )
    side = "inside" if looked.margin_m >= 0.0 else "outside"
    print(f"the centre of mass is {1e3 * abs(looked.margin_m):.0f} mm {side} the feet\n")


def _show_standing(robot: "Robot", standing: "StandingResult") -> None:
    hardest = int(standing.torque_share.argmax())
    share = f"{100 * standing.torque_share[hardest]:.0f} % of its peak torque"
    print(f"standing test, {standing.stood_s:.1f} s on the joint law over the simulated bus:")
    print(f"  sank {1e3 * standing.sank_m:.0f} mm of {1e3 * robot.description.standing_height_m:.0f}")
    print(f"  tilted {np.degrees(standing.tilt_rad):.1f} degrees, moved {1e3 * standing.moved_m:.0f} mm")
    print(f"  hardest at work: {robot.joint_names[hardest]}, {share}\n")


def _wrong_standing(robot: "Robot", standing: "StandingResult") -> Iterator[str]:
    if not standing.stood:
        why = standing.fall_reason or "; ".join(standing.faults)
        yield f"it does not stand by itself: {why} after {standing.stood_s:.1f} s"
        return
    if standing.sank_m > MOST_SUNK * robot.description.standing_height_m:
        yield f"it sinks by {1e3 * standing.sank_m:.0f} mm: the gains are low, or the pose asks for too much"
    if standing.tilt_rad > MOST_TILT_RAD:
        yield f"it tilts by {np.degrees(standing.tilt_rad):.0f} degrees"
    for name, share in zip(robot.joint_names, standing.torque_share, strict=True):
        if share > MOST_TORQUE_SHARE:
            yield f"joint {name} needs {100 * share:.0f} % of its peak torque to stand"
    for foot, share in zip(robot.description.feet, standing.feet_down, strict=True):
        if share < 0.5:
            yield f"foot {foot.name} is in the air"


def _show_lying(lying: "LyingResult | None") -> None:
    if lying is None:
        print("no lying pose (lying_rad in robot.yaml): it cannot lie down before its motors go off\n")
        return
    print("lying test, from the ground to the default pose and back:")
    print(f"  base {1e3 * max(lying.clearance_m, 0.0):.0f} mm above the ground at the end")
    print(f"  tilted {np.degrees(lying.tilt_rad):.1f} degrees\n")


def _wrong_lying(lying: "LyingResult | None") -> Iterator[str]:
    if lying is not None and lying.trouble:
        yield f"it does not stand up from its lying pose and go back to it: {lying.trouble}"


def _beyond_frames(robot: "Robot") -> Iterator[str]:
    """Gains that a motor's frames cannot carry: they would be cut."""
    from footfall.deploy.drivers.mit import RANGES

    for joint, kp, kd in zip(robot.description.joints, robot.kp, robot.kd, strict=True):
        protocol = robot.description.motors[joint.motor].protocol
        ranges = RANGES.get(protocol)
        if ranges is None:
            continue
        for gain, value, most in (("kp", kp, ranges.kp), ("kd", kd, ranges.kd)):
            if value > most:
                yield f"joint {joint.name}: {gain} is {value:.3g}, frames of {protocol} carry {most:g}"


def _print_table(header: list[str], rows: list[list[str]]) -> None:
    """Columns as wide as they need to be, also where the output is no terminal."""
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    for row in (header, *rows):
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
