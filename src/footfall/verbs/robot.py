"""`footfall robot`: bring in a robot, and look one over."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from footfall.common.installation import install_extras
from footfall.common.outputs import check_outputs, write_text
from footfall.options import Names, OptionalPath, RobotName, Seconds, Seed

if TYPE_CHECKING:
    from footfall.plant.walking import ControllerResult

robot = App(name="robot", help="Bring in a robot of your own, or look one over.")

SOMETHING_WRONG = 1


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


Axis = Literal["x", "-x", "y", "-y", "z", "-z"]


def _names_by_joint(_: type, tokens: Any) -> dict[str, str]:
    """'DM-J4310-2EC-48V' for all joints, or 'hip=A,knee=B' by part of their names."""
    entries = (entry.rpartition("=") for entry in tokens[0].value.split(","))
    return {part.strip(): name.strip() for part, _, name in entries}


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
    forward: Axis | None = None
    """Axis of the base that points forward (default: guessed by legs called left and right, else x)."""
    up: Axis = "z"
    """Axis of the base that points up."""
    packages: Annotated[tuple[Path, ...], Parameter(consume_multiple=True, negative=())] = ()
    """Folders that hold the packages of a URDF's meshes, beside those above the URDF and ROS_PACKAGE_PATH."""
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
    """Motors by name (robots/importer/actuators.yaml): torque, speed, inertia and gear as published."""
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
            forward=options.forward or "",
            up=options.up,
            packages=options.packages,
            actuators=options.actuator,
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
    """How long it has to stand, s, and each of its controllers to stand or walk."""
    controllers: bool = True
    """Whether its hand-written controllers are tested."""
    picture: Path | None = None
    """JPEG to write: how each controller stands or walks."""
    seed: Seed = 0


@robot.command
def check(robot: RobotName, /, *, options: CheckOptions = CheckOptions()) -> int:
    """Print a robot's tree and feet; let it stand and walk in simulation; exit 1 if something is wrong."""
    from footfall import robot_check as told
    from footfall.plant.lying import lying_test
    from footfall.plant.standing import standing_test
    from footfall.plant.walking import controllers_test
    from footfall.robots.description import load_robot
    from footfall.robots.inspection import inspect_robot

    loaded = load_robot(robot)
    looked = inspect_robot(loaded, options.seed)
    told.show_tree(loaded, looked)
    told.show_feet(looked)
    held = loaded.description.held_start
    standing = None if held else standing_test(loaded, options.duration, options.seed)
    told.show_standing(loaded, standing)
    lying = None if loaded.lying_pose is None else lying_test(loaded, options.seed)
    told.show_lying(lying)
    results = controllers_test(loaded, options.duration, options.seed) if options.controllers else []
    told.show_controllers(results)
    wrong = [
        *looked.findings(stands_still=not held),
        *told.beyond_frames(loaded),
        *told.wrong_standing(loaded, standing),
        *told.wrong_lying(lying),
        *told.wrong_controllers(results),
    ]
    for finding in wrong:
        print(f"wrong: {finding}")
    if not wrong:
        print("nothing wrong was found")
    if options.picture is not None:
        _draw(loaded.folder, results, options.picture)
    return SOMETHING_WRONG if wrong else 0


@robot.command
def urdf(robot: RobotName, /, *, out: OptionalPath = None) -> None:
    """Write a robot's URDF, made from its MJCF, for RViz, Foxglove, planners and libraries of kinematics.

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
    """Write a picture of the controllers' walks, or say why there is none."""
    try:
        from footfall.evaluate.report.stills import Walk, draw_walks
    except ImportError:
        print(f"no picture: {install_extras('report')}")
        return
    walks = [Walk(result.name, result.trouble, result.trace) for result in results]
    trouble = draw_walks(folder, walks, path)
    print(f"no picture: {trouble}" if trouble else f"wrote {path}")
