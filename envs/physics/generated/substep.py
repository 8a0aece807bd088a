"""One physics step of one robot as expressions: joint law, dynamics, contacts, solver, integration."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from footfall.envs.physics.generated.algebra import rotation_matrix, turned_about, vector
from footfall.envs.physics.generated.contacts import Geometry, LinkPose
from footfall.envs.physics.generated.dynamics import Inertia, body_inertia, dynamics
from footfall.envs.physics.generated.expression import Graph, Scalar, cos, round_to_integer, sin, sqrt
from footfall.envs.physics.generated.geom_pairs import PLANE
from footfall.envs.physics.generated.limbs import Part, whole_robot
from footfall.envs.physics.generated.rows import contact_rows, geom_friction, limit_rows
from footfall.envs.physics.generated.solver import newton_step
from footfall.envs.physics.generated.tree import BASE, BASE_DOFS, Tree, read_tree, rotation
from footfall.envs.physics.interface import GRAVITY, GROUND, Drive, Motion, joint_effort
from footfall.robots.actuator import Lag, Motor
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses


class Precision(NamedTuple):
    """Functions and constants that depend on the floating-point precision."""

    sin_cos: Callable[[Scalar], tuple[Scalar, Scalar]]
    rounding: float  # relative


Place = Any  # index in an array: an int, or a tuple of each limb's
Values = dict[Place, Scalar]  # elements of an array


class Substep(NamedTuple):
    """A physics step as expressions of named arrays.

    The program is the robot's, or that of any of its limbs, which run side by side (`limbs.py`).
    """

    state: dict[str, int]  # width of each array carried from step to step, by the field's name in Motion
    fixed_inputs: dict[str, int]  # width of each array that is constant during a control step
    step_inputs: dict[str, int]  # width of each array with a row for each physics step
    following: dict[str, Values]  # the state after the step
    trace: dict[str, Values]  # results of the step, by the field's name in Trace
    limbs: int = 1  # number of programs for each robot
    partners: tuple[tuple[int, ...], ...] = ()  # for each exchange: which limb's value each limb reads

    @property
    def results(self) -> list[Scalar]:
        """All outputs."""
        arrays = [*self.following.values(), *self.trace.values()]
        return [value for array in arrays for value in array.values()]


def substep(
    model: mujoco.MjModel,
    robot: Robot,
    fields: dict[str, tuple[int, ...]],
    precision: Precision,
    effects: tuple[str, ...] = (),
    part: Part | None = None,
) -> Substep:
    """The physics step of a model that passes `refusals` and `contact_refusals`.

    Args:
        model: nominal.
        robot: the robot of the model.
        fields: shapes of the fields that differ between robots: model fields, `GROUND` and `GRAVITY`. All
            others are the model's.
        precision: floating-point precision of the program's numbers.
        effects: optional fields of `Motor` that the motors have.
        part: the limb that the program is for, or the whole robot.
    """
    part = part or whole_robot(model, read_tree(model))
    graph, count = part.graph, len(robot.joint_names)
    state = {"qpos": model.nq, "qvel": model.nv, "qacc_warmstart": model.nv}
    if "lag_s" in effects:
        state["lagged_torque"] = count
    _, dofs = joint_addresses(model, robot)
    joints = [int(joint) for joint in np.argsort(dofs) if dofs[joint] in part.tree.dofs]
    places = dict.fromkeys(("qvel", "qacc_warmstart"), part.tree.dofs)
    places |= {"qpos": [*range(7), *(hinge.dof + 1 for hinge in part.tree.hinges)]}
    places |= dict.fromkeys(("torque", "lagged_torque"), joints)
    motion = Motion(**{name: vector(*(graph.input(name, k) for k in places[name])) for name in state})
    fixed_inputs = dict.fromkeys(("kp", "kd", "encoder_bias", *_motor_inputs(effects)), count)
    fixed_inputs |= {name: math.prod(shape) for name, shape in fields.items()}
    values = {name: graph.inputs(name, *shape) for name, shape in fields.items()}

    def field(name: str) -> np.ndarray:
        return values[name] if name in values else getattr(model, name)

    drives = [_drive(graph, joint, effects) for joint in joints]
    torques_before = [None] * len(joints) if motion.lagged_torque is None else motion.lagged_torque
    coordinates = [part.tree.dofs.index(dof) for dof in dofs[joints]]
    timestep_s = float(model.opt.timestep)
    efforts = [
        joint_effort(drive, drive.target, motion.qpos[k + 1], motion.qvel[k], timestep_s, torque_before)
        for drive, k, torque_before in zip(drives, coordinates, torques_before, strict=True)
    ]
    torque: list[Scalar] = [0.0] * len(part.tree.dofs)
    inertia = list(field("dof_armature")[part.tree.dofs])
    inertia[:BASE_DOFS] = [value * part.share for value in inertia[:BASE_DOFS]]
    for dof, effort in zip(coordinates, efforts, strict=True):
        torque[dof] = effort.torque
        inertia[dof] = inertia[dof] + effort.inertia

    gravity = values.get(GRAVITY, model.opt.gravity)
    following, feet = _step(
        model, robot, part, motion, torque, inertia, field, values.get(GROUND), gravity, precision
    )
    end = following._replace(lagged_torque=[effort.lagged_torque for effort in efforts])

    def placed(name: str, values: Sequence[Scalar]) -> Values:
        return dict(zip(places[name], values, strict=True))

    return Substep(
        state=state,
        fixed_inputs=fixed_inputs,
        step_inputs={"target": count},
        following={name: placed(name, getattr(end, name)) for name in state},
        trace={
            "qpos": placed("qpos", following.qpos),
            "qvel": placed("qvel", following.qvel),
            "foot_position": feet,
            "torque": placed("torque", [effort.motor_torque for effort in efforts]),
        },
    )


def _motor_inputs(effects: tuple[str, ...]) -> list[str]:
    """Names of the input arrays with motor parameters; a lag comes as its shares over a physics step."""
    needed = [name for name in Motor._fields if name not in Motor._field_defaults or name in effects]
    inputs = [f"motor.{name}" for name in needed if name != "lag_s"]
    return inputs + ([f"lag.{name}" for name in Lag._fields] if "lag_s" in effects else [])


def _drive(graph: Graph, joint: int, effects: tuple[str, ...]) -> Drive:
    """Target, gains, motor parameters and encoder bias of one joint."""
    read: dict[str, dict[str, Scalar]] = {"motor": {}, "lag": {}}
    for source in _motor_inputs(effects):
        part, name = source.split(".")
        read[part][name] = graph.input(source, joint)
    lag = Lag(**read["lag"]) if read["lag"] else None
    kp, kd, bias = (graph.input(name, joint) for name in ("kp", "kd", "encoder_bias"))
    return Drive(graph.input("target", joint), kp, kd, Motor(**read["motor"]), bias, lag)


def _step(
    model: mujoco.MjModel,
    robot: Robot,
    part: Part,
    motion: Motion,
    torque: list[Scalar],
    armature: list[Scalar],
    field: Callable[[str], np.ndarray],
    ground: np.ndarray | None,
    gravity: np.ndarray,
    precision: Precision,
) -> tuple[Motion, Values]:
    """The motion after a step, and the part's foot points at its beginning, in the world."""
    tree = part.tree
    timestep_s = float(model.opt.timestep)
    qpos, qvel = motion.qpos, motion.qvel
    base_turn, angles = rotation_matrix(qpos[3:7]), qpos[7:]
    to_base = base_turn.T
    turns = []
    for hinge, angle in zip(tree.hinges, angles, strict=True):
        sine, cosine = precision.sin_cos(angle - hinge.zero_rad)
        turns.append(hinge.rotation @ turned_about(hinge.axis, sine, cosine))

    unconstrained = dynamics(
        tree, turns, _inertias(model, part, field), qvel[3:6], list(qvel[6:]), to_base @ gravity
    )
    mass = dict(unconstrained.mass)
    for dof in range(len(qvel)):
        mass[dof, dof] = mass[dof, dof] + armature[dof]
    force = [t - b for t, b in zip(torque, unconstrained.bias, strict=True)]
    for link, hinge in enumerate(tree.hinges):
        passive = hinge.stiffness * (hinge.relaxed_rad - angles[link]) - hinge.damping * qvel[6 + link]
        force[6 + link] = force[6 + link] + passive

    geometry = Geometry(model, tree, _poses(tree, turns), base_turn, qpos[:3])
    velocity_in_base, warmstart = _in_base(to_base, qvel), _in_base(to_base, motion.qacc_warmstart)
    points = np.concatenate(foot_geoms(model, robot.description)).tolist()
    rows = []
    for geom_pair in part.geom_pairs:
        one, two = geom_pair.geoms
        on_ground = model.geom_type[one] == PLANE and two in points and ground is not None
        plane = ground[points.index(two)] if on_ground and ground is not None else None
        friction = geom_friction(model, geom_pair.geoms, field("geom_friction"))
        for contact in geometry.contacts(geom_pair, plane):
            rows.append(contact_rows(contact, model, part, geometry.poses, velocity_in_base, friction))
    for pair in part.pairs:
        contact = geometry.between_limbs(pair, part)
        rows.append(contact_rows(contact, model, part, geometry.poses, velocity_in_base, 0.0, pair))
    rows.extend(limit_rows(model, tree, angles, velocity_in_base))

    acceleration = warmstart
    for _ in range(model.opt.iterations):
        acceleration = newton_step(mass, force, acceleration, rows, precision.rounding, part)
    linear = base_turn @ vector(*acceleration[:3])
    acceleration = [*linear, *acceleration[3:]]
    velocity = [v + timestep_s * a for v, a in zip(qvel, acceleration, strict=True)]
    position = [x + timestep_s * v for x, v in zip(qpos[:3], velocity[:3], strict=True)]
    quaternion = _turned(qpos[3:7], vector(*velocity[3:6]) * timestep_s)
    new_angles = [q + timestep_s * v for q, v in zip(angles, velocity[6:], strict=True)]
    feet: Values = {
        3 * k + axis: x
        for k, point in enumerate(points)
        if int(model.geom_bodyid[point]) in tree.bodies
        for axis, x in enumerate(geometry.in_world(geometry.centre(point)))
    }
    return Motion([*position, *quaternion, *new_angles], velocity, acceleration), feet


def _inertias(model: mujoco.MjModel, part: Part, field: Callable[[str], np.ndarray]) -> dict[int, Inertia]:
    """Inertia of each link and of the part's share of the base, in the link's frame."""
    masses, centres, principal = field("body_mass"), field("body_ipos"), field("body_inertia")
    inertias: dict[int, Inertia] = {}
    for body, (link, turn, position) in part.tree.bodies.items():
        inertia = body_inertia(masses[body], centres[body], rotation(model.body_iquat[body]), principal[body])
        inertia = inertia.seen_from(turn, position)
        inertias[link] = inertias[link] + inertia if link in inertias else inertia
    return inertias | {BASE: inertias[BASE].part(part.share)}


def _poses(tree: Tree, turns: list[np.ndarray]) -> dict[int, LinkPose]:
    poses = {BASE: LinkPose(np.eye(3), np.zeros(3))}
    for link, (hinge, turn) in enumerate(zip(tree.hinges, turns, strict=True)):
        parent = poses[hinge.parent]
        poses[link] = LinkPose(parent.turn @ turn, parent.position + parent.turn @ hinge.position)
    return poses


def _in_base(to_base: np.ndarray, values: np.ndarray) -> list[Scalar]:
    """MuJoCo's velocities or accelerations, with the base's linear part rotated into the base's frame."""
    return [*(to_base @ values[:3]), *values[3:]]


def _turned(quaternion: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """A unit quaternion after a rotation by this vector in the body's frame, rad.

    For the half angle h, cos(h) and sin(h) / h are power series in h^2: within 1e-9 for a rotation of 1 rad.
    """
    half = angle * 0.5
    square = half @ half
    sine = _series(square, (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880))
    cosine = _series(square, (1.0, -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800))
    w, x, y, z = quaternion
    a, b, c = half * sine
    turned = vector(
        w * cosine - x * a - y * b - z * c,
        w * a + x * cosine + y * c - z * b,
        w * b - x * c + y * cosine + z * a,
        w * c + x * b - y * a + z * cosine,
    )
    return turned / sqrt(turned @ turned)


def _series(x: Scalar, coefficients: tuple[float, ...]) -> Scalar:
    """A polynomial by Horner's rule, the constant term first."""
    total: Scalar = 0.0
    for coefficient in reversed(coefficients):
        total = coefficient + x * total
    return total


def library_sin_cos(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Sine and cosine, by the back end's own functions."""
    return sin(angle), cos(angle)


def single_sin_cos(angle: Scalar) -> tuple[Scalar, Scalar]:
    """Sine and cosine, within 2e-7 for angles of a few turns.

    Power series of a quarter of the angle; the angle is doubled twice.
    """
    turns = round_to_integer(angle * (0.5 / math.pi))
    x = (angle - 2.0 * math.pi * turns) * 0.25
    square = x * x
    sine = x * _series(square, (1.0, -1 / 6, 1 / 120, -1 / 5040, 1 / 362880))
    # 1 - cosine, which is more accurate near 0 than the cosine.
    versine = square * _series(square, (1 / 2, -1 / 24, 1 / 720, -1 / 40320))
    for _ in range(2):
        sine, versine = 2.0 * sine * (1.0 - versine), 2.0 * sine * sine
    return sine, 1.0 - versine


SINGLE, DOUBLE = Precision(single_sin_cos, 4e-7), Precision(library_sin_cos, 1e-15)
