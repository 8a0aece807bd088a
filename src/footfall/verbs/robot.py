"""`footfall robot`: import a robot, or check one."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from footfall.common.installation import extras_command
from footfall.common.outputs import check_outputs, write_text
from footfall.options import Names, OptionalPath, RobotName, Seconds, Seed

if TYPE_CHECKING:
    from footfall.plant.walking import ControllerResult

robot = App(name="robot", help="Import your own robot, or check one.")

FAILED = 1


def _by_joint(_: type, tokens: Any) -> dict[str, float]:
    """Parse '23.7' for all joints, or 'hip=23.7,knee=35.5' by parts of their names."""
    text = tokens[0].value
    values: dict[str, float] = {}
    for entry in text.split(","):
        part, _, number = entry.rpartition("=")
        try:
            values[part.strip()] = float(number)
        except ValueError:
            values[part.strip()] = -1.0
    if not all(0.0 < value < 1e6 for value in values.values()):
        raise ValueError(f"expected a positive number, or pairs such as hip=23.7,knee=35.5, found '{text}'")
    return values


ByJoint = Annotated[
    dict[str, float],
    Parameter(converter=_by_joint, n_tokens=1, accepts_keys=False, metavar="X|JOINT=X,…", negative=()),
]


Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


def _names_by_joint(_: type, tokens: Any) -> dict[str, str]:
    """Parse 'DM-J4310-2EC-48V' for all joints, or 'hip=A,knee=B' by parts of their names."""
    entries = (entry.rpartition("=") for entry in tokens[0].value.split(","))
    return {part.strip(): name.strip() for part, _, name in entries}


@Parameter(name="*")
@dataclass(frozen=True)
class NewOptions:
    """Source of a robot, and values that its file does not contain."""

    source: Annotated[Path, Parameter(name="--from")]
    """URDF or MJCF of the robot."""
    out: Path
    """Folder to create; its name becomes the robot's name."""
    feet: Names = ()
    """Links that are feet or carry them (default: links named foot, else the lowest links)."""
    forward: Axis | None = None
    """Forward axis of the base (default: from the names of left and right legs, else x)."""
    up: Axis = "z"
    """Upward axis of the base."""
    packages: Annotated[tuple[Path, ...], Parameter(consume_multiple=True, negative=())] = ()
    """Folders with the packages of a URDF's meshes, in addition to the URDF's parents and
    ROS_PACKAGE_PATH."""
    actuator: Annotated[
        dict[str, str],
        Parameter(
            converter=_names_by_joint,
            n_tokens=1,
            accepts_keys=False,
            metavar="NAME|JOINT=NAME,…",
            negative=(),
        ),
    ] = field(default_factory=dict)
    """Motors by name (robots/importer/actuators.yaml): published torque, speed, inertia and gear ratio."""
    peak_torque: ByJoint = field(default_factory=dict)
    """Peak torque, N m, replacing the file's: one value for all, or by parts of the joints' names."""
    speed: ByJoint = field(default_factory=dict)
    """No-load speed, rad/s, in the same form."""
    armature: ByJoint = field(default_factory=dict)
    """Reflected inertia, kg m^2, in the same form: rotor inertia times gear ratio squared; URDF has none."""


@robot.command
def new(*, options: NewOptions) -> None:
    """Create a robot folder from a URDF or MJCF, and list the guesses."""
    from footfall.deploy.drivers.mit import RANGES
    from footfall.domain_rand.randomisation import default_ranges
    from footfall.plant.lying import find_lying_pose
    from footfall.policies.gaits import gaits_of
    from footfall.robots.description import load_robot
    from footfall.robots.importer.create import ImportRequest, import_robot

    imported = import_robot(
        ImportRequest(
            source=options.source,
            folder=options.out,
            protocols=RANGES,
            feet=options.feet,
            forward=options.forward or "",
            up=options.up,
            packages=options.packages,
            actuators=options.actuator,
            peak_torque_nm=options.peak_torque,
            speed_rad_s=options.speed,
            armature=options.armature,
            defaults=default_ranges(),
            gaits_of=gaits_of,
            find_lying_pose=find_lying_pose,
        )
    )
    loaded = load_robot(options.out.resolve())
    feet = len(loaded.description.feet)
    print(f"wrote {imported.folder}: {len(loaded.joint_names)} joints, {feet} feet. Guesses to check:")
    for guess in imported.guesses:
        print(f"- {guess}")
    print(f"check it with: footfall robot check {imported.folder}")


@Parameter(name="*")
@dataclass(frozen=True)
class CheckOptions:
    """Tests of a robot."""

    duration: Seconds = 4.0
    """Duration of the standing test and of each controller's test, s."""
    controllers: bool = True
    """Test the hand-written controllers."""
    picture: Path | None = None
    """JPEG to write: each controller's walk or stance."""
    seed: Seed = 0


@robot.command
def check(robot: RobotName, /, *, options: CheckOptions = CheckOptions()) -> int:
    """Print a robot's tree and feet, test standing and walking in simulation; exit 1 if something is
    wrong."""
    from footfall import robot_check
    from footfall.deploy.config import deploy_config
    from footfall.domain_rand.randomisation import randomisation_of
    from footfall.plant.lying import lying_test
    from footfall.plant.standing import standing_test
    from footfall.plant.walking import controllers_test
    from footfall.policies.registry import controllers_of
    from footfall.robots.description import load_robot
    from footfall.robots.inspection import inspect_robot

    loaded = load_robot(robot)
    randomisation_of(loaded)  # refuses ranges that no training could read
    deploy_config(loaded)  # refuses limits with which no run could begin
    if options.controllers:
        controllers_of(loaded)  # refuses a file of settings that names an unknown controller
    inspection = inspect_robot(loaded, options.seed)
    robot_check.show_tree(loaded, inspection)
    robot_check.show_feet(inspection)
    held_start = loaded.description.held_start
    standing = None if held_start else standing_test(loaded, options.duration, options.seed)
    robot_check.show_standing(loaded, standing)
    lying = None if loaded.lying_pose is None else lying_test(loaded, options.seed)
    robot_check.show_lying(lying)
    results = controllers_test(loaded, options.duration, options.seed) if options.controllers else []
    robot_check.show_controllers(results)
    findings = [
        *inspection.findings(stands_still=not held_start),
        *robot_check.gains_beyond_frames(loaded),
        *robot_check.standing_findings(loaded, standing),
        *robot_check.lying_findings(lying),
        *robot_check.controller_findings(results),
    ]
    for finding in findings:
        print(f"wrong: {finding}")
    if not findings:
        print("nothing wrong was found")
    if options.picture is not None:
        _draw(loaded.folder, results, options.picture)
    return FAILED if findings else 0


@robot.command
def urdf(robot: RobotName, /, *, out: OptionalPath = None) -> None:
    """Write a robot's URDF, generated from its MJCF, for RViz, Foxglove, planners and kinematics libraries.

    Parameters
    ----------
    out:
        File to write (default: standard output).
    """
    check_outputs(out)
    from footfall.robots.description import load_robot
    from footfall.robots.urdf import urdf as as_urdf

    text = as_urdf(load_robot(robot))
    if out is None:
        print(text, end="")
    else:
        write_text(out, text)


def _draw(folder: Path, results: "list[ControllerResult]", path: Path) -> None:
    """Write a picture of the controllers' walks, or print why there is none."""
    try:
        from footfall.evaluate.report.stills import Walk, draw_walks
    except ImportError:
        print(f"no picture: {extras_command('report')}")
        return
    walks = [Walk(r.name, r.trouble, r.trace) for r in results if r.trace is not None]
    trouble = draw_walks(folder, walks, path)
    print(f"no picture: {trouble}" if trouble else f"wrote {path}")
