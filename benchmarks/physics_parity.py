"""Difference between the generated physics and MuJoCo C, for random states of any robot.

    python benchmarks/physics_parity.py go1 hexapod g1 [FOLDER ...]

For each robot: random poses at the ground, velocities, targets, and motors and bodies drawn as in the preset
`gpu`. Prints the relative error of the velocities after one physics step and after four, in double
precision (maximum) and in single precision (median, 99th percentile, maximum), the mean number of
contacts, the compilation time of the program, and physics steps per second on one core.
"""

import argparse
import copy
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import mujoco
import numpy as np

from footfall.domain_rand.bodies import body_map, randomised_fields
from footfall.domain_rand.randomisation import Randomisation
from footfall.domain_rand.sample import draw, randomised_command, randomised_motor, sensor_bias
from footfall.envs.physics.generated.arguments import arguments
from footfall.envs.physics.generated.geom_pairs import contact_refusals
from footfall.envs.physics.generated.llvm import Program
from footfall.envs.physics.generated.substep import DOUBLE, SINGLE, substep
from footfall.envs.physics.generated.tree import refusals
from footfall.envs.physics.interface import GRAVITY, GROUND, Drive, joint_effort
from footfall.robots.actuator import JointCommand, Lag, Motor, lag_over
from footfall.robots.description import Robot, load_robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses, training_model
from footfall.train.config import load_preset

STEPS = 4
Arrays = dict[str, np.ndarray]  # by argument name of the program, with robots along the first axis


class Errors(NamedTuple):
    """Relative errors of the velocities, (robots, steps), with numbers of contacts."""

    errors: np.ndarray
    contacts: np.ndarray  # (robots * steps,)
    compile_s: float
    steps_per_s: float


def random_arguments(
    robot: Robot,
    model: mujoco.MjModel,
    count: int,
    randomisation: Randomisation,
    seed: int = 0,
    fallen: bool = False,
) -> Arrays:
    """Random states of a robot family: near the ground, moving, with random targets.

    The robots stand or, with `fallen`, have any attitude and joints anywhere up to slightly beyond their
    limits.
    """
    rng, n = np.random.default_rng(seed), len(robot.joint_names)
    positions, _ = joint_addresses(model, robot)
    feet = np.concatenate(foot_geoms(model, robot.description))
    data = mujoco.MjData(model)
    rows: list[Arrays] = []
    for _ in range(count):
        sample = draw(randomisation, rng.random, n, model.nbody - 1)
        qpos = model.qpos0.copy()
        qpos[:3] = *rng.normal(size=2), 0.0
        attitude = rng.normal(size=4) if fallen else np.r_[1.0, 0.0, 0.0, 0.0] + rng.normal(size=4) * 0.08
        qpos[3:7] = attitude / np.linalg.norm(attitude)
        near_default = robot.default_pose + rng.normal(size=n) * 0.2
        lower, upper = model.jnt_range[1:].T
        qpos[positions] = rng.uniform(lower - 0.05, upper + 0.05) if fallen else near_default
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        qpos[2] = rng.uniform(-0.01, 0.003) - _lowest(model, data, range(model.ngeom) if fallen else feet)
        speed = np.r_[np.full(3, 0.4), np.full(3, 1.0), np.full(model.nv - 6, 2.0)]
        command = JointCommand(robot.default_pose, np.zeros(n), robot.kp, robot.kd, np.zeros(n))
        command = randomised_command(command, sample)
        motor = randomised_motor(robot.motor, sample)
        bias = sensor_bias(sample, "joint_position")
        rows.append(
            {
                "qpos": qpos,
                "qvel": rng.normal(size=model.nv) * speed,
                "qacc_warmstart": rng.normal(size=model.nv) * 10 * speed,
                "target": np.tile(robot.default_pose + rng.normal(size=n) * 0.3, (STEPS, 1)),
                "kp": command.kp,
                "kd": command.kd,
                "encoder_bias": np.zeros(n) if bias is None else bias,
                **{f"motor.{k}": np.broadcast_to(v, n) for k, v in motor._asdict().items() if v is not None},
                **_lag(motor, model.opt.timestep, rng),
                **(randomised_fields(model, sample, body_map(model, robot)) if sample else {}),
            }
        )
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def _lowest(model: mujoco.MjModel, data: mujoco.MjData, geoms: Iterable[int]) -> float:
    """Height of the lowest point among those spheres, capsules and boxes that collide with the floor, m."""
    found = []
    for geom in geoms:
        down, size = np.abs(data.geom_xmat[geom].reshape(3, 3)[2]), model.geom_size[geom]
        reach = {
            mujoco.mjtGeom.mjGEOM_SPHERE: size[0],
            mujoco.mjtGeom.mjGEOM_CAPSULE: size[0] + down[2] * size[1],
            mujoco.mjtGeom.mjGEOM_BOX: down @ size,
        }
        if model.geom_conaffinity[geom] and (kind := mujoco.mjtGeom(model.geom_type[geom])) in reach:
            found.append(data.geom_xpos[geom, 2] - reach[kind])
    return float(min(found))


def _lag(motor: Motor, timestep_s: float, rng: np.random.Generator) -> Arrays:
    """Lag shares over a physics step and initial torque, for motors with lag; empty otherwise."""
    if motor.lag_s is None:
        return {}
    shares = lag_over(motor.lag_s, timestep_s)
    return {
        "lag.at_end": shares.at_end,
        "lag.in_mean": shares.in_mean,
        "lagged_torque": motor.peak_torque * rng.uniform(-1.0, 1.0, len(shares.at_end)),
    }


def _of(states: Arrays, part: str, robot: int) -> Arrays:
    """Arrays of one robot whose names begin with `part` and a dot, by the rest of the name."""
    prefix = f"{part}."
    return {name.removeprefix(prefix): v[robot] for name, v in states.items() if name.startswith(prefix)}


def reference(
    robot: Robot, model: mujoco.MjModel, states: Arrays, fields: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Velocities after each physics step of plain MuJoCo, (robots, steps, nv), and numbers of contacts."""
    positions, dofs = joint_addresses(model, robot)
    model = copy.copy(model)
    model.body_sameframe[:] = 0  # centres of mass may move
    model.opt.ls_iterations = 50  # C counts evaluations; this is enough for its line search to converge
    data, velocities, contacts = mujoco.MjData(model), [], []
    nominal = model.dof_armature.copy()
    for k in range(len(states["qpos"])):
        mujoco.mj_resetData(model, data)
        model.dof_armature[:] = nominal
        for name in fields:
            getattr(model.opt if name == GRAVITY else model, name)[:] = states[name][k]
        for name in ("qpos", "qvel", "qacc_warmstart"):
            getattr(data, name)[:] = states[name][k]
        motor, shares = Motor(**_of(states, "motor", k)), _of(states, "lag", k)
        lag = Lag(**shares) if shares else None
        bias, lagged_torque = states["encoder_bias"][k], states["lagged_torque"][k] if lag else None
        drive = Drive(states["target"][k], states["kp"][k], states["kd"][k], motor, bias, lag)
        armature = model.dof_armature[dofs].copy()
        for target in drive.target:
            measured = data.qpos[positions].copy(), data.qvel[dofs].copy()
            effort = joint_effort(drive, target, *measured, model.opt.timestep, lagged_torque)
            lagged_torque = effort.lagged_torque
            model.dof_armature[dofs] = armature + effort.inertia
            data.qfrc_applied[dofs] = effort.torque
            mujoco.mj_step(model, data)
            velocities.append(data.qvel.copy())
            contacts.append(data.ncon)
    return np.array(velocities).reshape(len(states["qpos"]), -1, model.nv), np.array(contacts)


def compare(
    robot: Robot,
    model: mujoco.MjModel,
    states: Arrays,
    dtype: Any = np.float64,
    other: mujoco.MjModel | None = None,
) -> Errors:
    """Errors of the generated program in this precision relative to MuJoCo C, for the same arguments.

    Args:
        robot: the robot.
        model: model of the program.
        states: random states, as from `random_arguments`, for both.
        dtype: precision of the program.
        other: model for MuJoCo C, if different.
    """
    states = {name: values.astype(dtype).astype(float) for name, values in states.items()}
    not_fields = {"qpos", "qvel", "qacc_warmstart", "lagged_torque", "target", "kp", "kd", "encoder_bias"}
    fields = [name for name in states if name not in not_fields and not name.startswith(("motor.", "lag."))]
    effects = tuple(name for name in Motor._field_defaults if f"motor.{name}" in states)
    shapes = {name: states[name].shape[1:] for name in fields}
    began = time.perf_counter()
    step = substep(model, robot, shapes, DOUBLE if dtype is np.float64 else SINGLE, effects)
    program = Program(step, STEPS, dtype)
    compile_s = time.perf_counter() - began
    count, (inputs, outputs) = len(states["qpos"]), arguments(step)
    arrays = [
        np.ascontiguousarray(states[each.name].reshape(each.shape(count, STEPS)), dtype) for each in inputs
    ]
    arrays += [np.empty(each.shape(count, STEPS), dtype) for each in outputs]
    program(arrays, 0, count)
    velocities = dict(zip((each.name for each in (*inputs, *outputs)), arrays, strict=True))["trace.qvel"]
    changed = [name for name in fields if name != GROUND]
    expected, contacts = reference(robot, other or model, states, changed)
    difference = np.linalg.norm(velocities.astype(float) - expected, axis=2)
    seconds = min(_seconds(program, arrays, count) for _ in range(5))
    return Errors(difference / np.linalg.norm(expected, axis=2), contacts, compile_s, count * STEPS / seconds)


def _seconds(program: Program, arrays: list[np.ndarray], count: int) -> float:
    began = time.process_time()
    program(arrays, 0, count)
    return time.process_time() - began


def main() -> None:
    """Compare, and print one line per robot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="+", metavar="ROBOT")
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name in options.robots:
        robot = load_robot(name)
        model = training_model(robot, 0.005)
        refused = [*refusals(model), *contact_refusals(model)]
        if refused:
            print(f"{name}: not supported: {'; '.join(refused)}")
            continue
        randomisation = load_preset("gpu", robot).env.randomisation
        states = random_arguments(robot, model, options.count, randomisation, options.seed)
        double, single = (compare(robot, model, states, dtype) for dtype in (np.float64, np.float32))
        one, four = (np.quantile(single.errors[:, k], (0.5, 0.99, 1.0)) for k in (0, STEPS - 1))
        print(
            f"{name}: {model.nv} degrees of freedom, {double.contacts.mean():.1f} contacts on average;"
            f" double, maximum: {double.errors[:, 0].max():.1e}, {double.errors[:, -1].max():.1e};"
            f" single: {one[0]:.1e}, {one[1]:.1e}, {one[2]:.1e}"
            f" and {four[0]:.1e}, {four[1]:.1e}, {four[2]:.1e};"
            f" compiled in {single.compile_s:.1f} s; {single.steps_per_s / 1e6:.2f} M steps/s",
            flush=True,
        )


if __name__ == "__main__":
    main()
