"""Makes a robot folder from a URDF or MJCF."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.actuators import figures_of
from footfall.robots.importer.build import build_machine, shortened
from footfall.robots.importer.controllers_yaml import controllers_yaml, scaled_controllers, size_of
from footfall.robots.importer.leg_pairs import with_leg_pairs
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.motors import ByJoint, choose_drive, peak_torques, value_for, with_armature
from footfall.robots.importer.pose import Pose, standing_pose
from footfall.robots.importer.randomisation_yaml import randomisation_yaml
from footfall.robots.importer.read import read_source
from footfall.robots.importer.robot_yaml import (
    MODEL_FILE,
    Ranges,
    choose_protocols,
    command_range,
    robot_yaml,
)
from footfall.robots.importer.statics import statics
from footfall.robots.importer.training_yaml import training_yaml

LYING_FOUND = (
    "lying pose: legs folded until the base is on the ground; the robot stands up from it in simulation"
)
LYING_NOT_FOUND = "no lying pose: the robot rests in and stands up from none of the poses tried in simulation"
BIPED_LEGS = 2  # number of legs of a machine that walks upright, with its knees bent forward


@dataclass(frozen=True)
class ImportRequest:
    """The settings of an import."""

    source: Path
    folder: Path  # to make
    protocols: Mapping[str, Ranges]  # motor models with a driver
    feet: tuple[str, ...] = ()  # links that are feet or carry them; empty: found automatically
    forward: str = ""  # axis of the base that points forward; empty: guessed by the legs' names
    up: str = "z"  # axis of the base that points up
    packages: tuple[Path, ...] = ()  # folders with the packages of a URDF's meshes
    peak_torque_nm: ByJoint = field(default_factory=dict)  # overrides the file, by part of a joint's name
    # Names in actuators.yaml, by part of a joint's name.
    actuators: Mapping[str, str] = field(default_factory=dict)
    speed_rad_s: ByJoint = field(default_factory=dict)
    armature: ByJoint = field(default_factory=dict)  # reflected inertia, kg m^2
    # Randomisation ranges for quadrupeds of usual size, (lowest, highest) by name: see randomisation_yaml.
    defaults: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    gaits_of: Callable[[Robot], Sequence[str]] = lambda _: ()  # names; the first is used
    # (n,) rad; None if the robot cannot lie.
    find_lying_pose: Callable[[Robot], np.ndarray | None] | None = None


class Imported(NamedTuple):
    """The folder, and the guesses that were made, one line each."""

    folder: Path
    guesses: tuple[str, ...]


def import_robot(request: ImportRequest) -> Imported:
    """Write a robot folder.

    Raises:
        UserError: the folder exists, or the source is not a legged machine that footfall can move. Nothing is
            written in that case.
    """
    folder = request.folder
    if folder.exists() or folder.is_symlink():
        raise UserError(f"{folder} exists already: give another --out, or remove it")
    source = read_source(request.source, request.packages)
    machine, guesses = build_machine(source, _name(folder), request.feet, request.forward, request.up)
    _refuse_unknown(machine, request)
    pose = standing_pose(machine, source.pose_rad)
    published = figures_of(request.actuators)
    peak = peak_torques(machine, source, {**published.peak_torque_nm, **request.peak_torque_nm}, pose.reach_m)
    machine, armature_guesses = with_armature(machine, peak, {**published.armature, **request.armature})
    model = mujoco.MjModel.from_xml_string(model_xml(machine))
    qpos = _standing_qpos(model, machine, pose)
    names = tuple(hinge.name for hinge in machine.hinges)
    standing = statics(model, names, machine.legs, qpos)
    drive = choose_drive(
        machine,
        source,
        peak,
        {**published.speed_rad_s, **request.speed_rad_s},
        standing,
        published.gear_ratio,
    )
    walking = scaled_controllers(
        size_of(model, _placed(model, qpos), machine.legs),
        len(machine.legs),
        drive.stiffest(machine),
    )
    protocols, out_of_range = choose_protocols(machine, drive, request.protocols, (walking.kp, walking.kd))
    touching = _touching_links(model, qpos)
    paired, leg_pairs = with_leg_pairs(machine, pose)
    guesses += [*published.sources, *armature_guesses, *drive.guesses]
    guesses += _beyond_rated(names, standing.torque_nm, published.rated_torque_nm)
    guesses += _about_pose(machine, pose, has_keyframe=bool(source.pose_rad)) + _about_wiring(out_of_range)
    if touching:
        guesses.append(f"{len(touching)} pairs of links that overlap in the default pose do not collide")
    guesses.append(_about_leg_pairs(leg_pairs))
    origin = f"Made from {request.source.name} by footfall robot new."

    def robot_text(lying: Mapping[str, float] | None = None) -> str:
        """The text of `robot.yaml`, with a lying pose if there is one."""
        return robot_yaml(machine, pose, drive, protocols, [origin, *_as_comment(guesses)], lying)

    def dependent_texts(robot: Robot) -> dict[str, str]:
        """Texts of files that depend on the loaded robot: on its gaits and its lying pose."""
        lying = None
        if request.find_lying_pose is not None:
            found = request.find_lying_pose(robot)
            lying = None if found is None else dict(zip(robot.joint_names, found.tolist(), strict=True))
            guesses.append(LYING_FOUND if lying else LYING_NOT_FOUND)
        gaits = request.gaits_of(robot)
        return {
            "robot.yaml": robot_text(lying),
            "training.yaml": training_yaml(
                machine, pose, command_range(machine, pose), next(iter(gaits), None)
            ),
            "controllers.yaml": controllers_yaml(walking, gaits),
        }

    texts = {
        MODEL_FILE: model_xml(
            paired, pose.height_m, touching, leg_pairs, [origin, "robot.yaml lists the guesses."]
        ),
        "robot.yaml": robot_text(),
        "randomisation.yaml": randomisation_yaml(machine, pose, request.defaults),
    }
    _write(folder, texts, dependent_texts, request.source)
    return Imported(folder, tuple(guesses))


def _beyond_rated(joints: Sequence[str], torque_nm: np.ndarray, rated: ByJoint) -> list[str]:
    """A line about joints that need more than their rated torque to stand; empty if there are none."""
    found = [
        f"{joint} {abs(torque):.3g} of {limit:.3g} N m"
        for joint, torque in zip(joints, torque_nm, strict=True)
        if (limit := value_for(joint, rated)) is not None and abs(torque) > limit
    ]
    return [f"motors stand beyond their rated torque: {shortened(found)}"] if found else []


def _about_pose(machine: Machine, pose: Pose, *, has_keyframe: bool) -> list[str]:
    """Lines about the default pose.

    Args:
        machine, pose: robot and its default pose.
        has_keyframe: whether the source has a keyframe. If the pose is another one, the keyframe folds the
            legs.
    """
    lines = []
    if len(machine.legs) == BIPED_LEGS and pose.knees_forward_m < 0.0:
        lines.append(
            f"the knees bend backward: does x of '{machine.links[0].name}' point forward (--forward)?"
        )
    if pose.given:
        lines.append("default pose: that of the file's keyframe, with a level base")
    else:
        keyframe = " (the file's keyframe folds the legs)" if has_keyframe else ""
        lines.append(f"default pose: knees bent, centre of mass above the feet{keyframe}")
    if not machine.stands_still:
        lines.append(
            "start: held up until the robot steps in place, since it cannot stand still on two points"
        )
    return lines


def _about_wiring(out_of_range: list[str]) -> list[str]:
    """Lines about buses and protocols; `out_of_range` are joints whose ranges no protocol has."""
    lines = ["bus, id and protocol of each motor are placeholders, and so is the IMU's bus"]
    if out_of_range:
        lines.append(f"no protocol has the ranges of {shortened(out_of_range)}: the widest was taken")
    return lines


def _about_leg_pairs(pairs: Sequence[tuple[str, str]]) -> str:
    if not pairs:
        return "legs do not collide in training: their capsules collided in no random pose, or rarely"
    listed = shortened([f"{first} with {second}" for first, second in pairs])
    return (
        f"legs collide in training through {len(pairs)} pairs of capsules, each costs training time: {listed}"
    )


def _name(folder: Path) -> str:
    """The robot's name: that of the folder, with invalid characters replaced."""
    name = "".join(c if c.isalnum() or c in "-_" else "_" for c in folder.resolve().name)
    return name or "robot"


def _as_comment(guesses: list[str]) -> list[str]:
    return ["Guessed, to be checked:", *(f"- {guess}" for guess in guesses)]


def _refuse_unknown(machine: Machine, request: ImportRequest) -> None:
    """Raise UserError for a part of a joint's name that occurs in no joint's name."""
    names = [hinge.name for hinge in machine.hinges]
    for option, values in (
        ("--peak-torque", request.peak_torque_nm),
        ("--speed", request.speed_rad_s),
        ("--armature", request.armature),
        ("--actuator", request.actuators),
    ):
        for part in values:
            if not any(value_for(name, {part: 0.0}) is not None for name in names):
                raise UserError(f"{option}: no joint has '{part}' in its name: there are {', '.join(names)}")


def _standing_qpos(model: mujoco.MjModel, machine: Machine, pose: Pose) -> np.ndarray:
    qpos = model.qpos0.copy()
    qpos[:7] = (0.0, 0.0, pose.height_m, 1.0, 0.0, 0.0, 0.0)
    for hinge in machine.hinges:
        qpos[model.joint(hinge.name).qposadr] = pose.joints[hinge.name]
    return qpos


def _placed(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return data


def _touching_links(model: mujoco.MjModel, qpos: np.ndarray) -> list[tuple[str, str]]:
    """Pairs of links that collide in a pose, without repetitions."""
    data = _placed(model, qpos)
    pairs = {tuple(sorted(model.geom_bodyid[geoms].tolist())) for geoms in data.contact.geom}
    return [(model.body(a).name, model.body(b).name) for a, b in sorted(pairs)]


def _write(
    folder: Path,
    texts: Mapping[str, str],
    dependent_texts: Callable[[Robot], Mapping[str, str]],
    source: Path,
) -> None:
    """Write the files into a new folder if footfall can load them.

    Args:
        folder: the new folder.
        texts: contents of the files, by name.
        dependent_texts: returns further or replaced texts for the robot that the files describe.
        source: the file that a refusal names, since the new folder does not remain.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".new-") as scratch:
            made = Path(scratch) / folder.name
            made.mkdir()
            _write_all(made, texts)
            _write_all(made, dependent_texts(_loaded(made, source)))
            _loaded(made, source)
            made.rename(folder)
    except OSError as error:
        raise UserError(f"cannot write {folder}: {error.strerror or error}") from None


def _loaded(made: Path, source: Path) -> Robot:
    """The robot that a new folder describes. Raises UserError that names the source, not the folder."""
    try:
        return load_robot(made.resolve())
    except UserError as error:
        raise UserError(str(error).replace(f"{made.resolve() / 'robot.yaml'}:", f"{source}:")) from None


def _write_all(folder: Path, texts: Mapping[str, str]) -> None:
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
