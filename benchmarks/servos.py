"""Fits position servos that move a pendulum; held-out errors of these and of the published fits.

    pip install "footfall[train,report]"
    python benchmarks/servos.py xl330 --data FOLDER --workers 2 --plot xl330.png

FOLDER holds JSON files of github.com/Rhoban/bam (Apache-2.0): xl330 of commit af22604, sts3250 of b53408c.
The servo is the joint law's voltage-driven motor: duty from the position error, back-EMF, a resistance that
rises with the duty, Coulomb, Stribeck, load and viscous friction, and a delay. Windows of 1 s are simulated
from their own initial states, which are refined under a prior. xl330: each gain is held out in turn. sts3250
has one gain: each of the four recordings is held out; a prediction is refused if the other three do not
support it. The fit is least squares with little weight for outliers.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from recordings.servo_logs import MODELS, SERVOS, folds, logs, makers_problem, problem
from recordings.tables import interval, plot_windows, table
from resumable_runs import add_options, run_resumable

from footfall.identify.null_space import null_directions
from footfall.identify.shooting import Shooting

SUPPORTED = 0.5  # largest half-width of an interval, relative to the value, of a reported figure
PREDICTED = 3.0  # largest ratio of held-out to fitted error of a supported prediction
AT_BOUND = 0.01  # largest distance from a bound, in scales, of a figure that counts as at its bound
LONG_S = 5.9  # windows long enough to show drift
Task = tuple[str, str, str, str, int]  # folder, servo, model; "all", "without" or "draw"; fold or seed


def run(task: Task) -> dict[str, Any]:
    """Run one fit."""
    folder, servo, model, kind, number = task
    windows = problem(folder, servo, model)
    used = windows.recordings
    if kind == "without":
        used = np.setdiff1d(used, folds(folder, servo)[number][1])
    if kind == "draw":
        used = np.random.default_rng(number).choice(used, len(used))
    return {"numbers": windows.of(used).fit().tolist()}


def mean_error_mrad(windows: Shooting, numbers: np.ndarray, members: Sequence[int]) -> float:
    """Mean absolute error over windows of some recordings, mrad."""
    error = windows.errors(numbers)[np.isin(windows.recording, members)]
    return float(1e3 * np.abs(error).mean())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("servo", choices=SERVOS)
    parser.add_argument("--data", type=Path, required=True, help="folder of the JSON files")
    parser.add_argument("--draws", type=int, default=40, help="draws of recordings, for intervals")
    parser.add_argument("--plot", type=Path, help="PNG of held-out windows")
    add_options(parser)
    options = parser.parse_args()
    folder, servo = str(options.data.resolve()), options.servo
    all_folds = range(len(folds(folder, servo)))
    tasks: list[Task] = [
        (folder, servo, model, kind, number)
        for model in MODELS
        for kind, number in (("all", 0), *(("without", fold) for fold in all_folds))
    ]
    tasks += [(folder, servo, "joint law", "draw", seed) for seed in range(options.draws)]
    done, failed = run_resumable(run, tasks, options.out, options.workers, options.time_limit)
    if failed:
        sys.exit("\n".join(failed))
    fits = {task[2:5]: np.array(each["numbers"]) for task, each in zip(tasks, done, strict=True)}
    report_errors(folder, servo, fits)
    report_numbers(problem(folder, servo, "joint law"), fits)
    if options.plot is not None:
        plot(options.plot, folder, servo, fits)


def report_errors(folder: str, servo: str, fits: dict[tuple[str, str, int], np.ndarray]) -> None:
    """Print held-out errors of each model and of the published fits."""
    parts = folds(folder, servo)
    rows = []
    for name, values in SERVOS[servo].makers.items():
        short_and_long = [makers_problem(folder, servo, window_s) for window_s in (1.0, LONG_S)]
        numbers = np.array([values[each.name] for each in short_and_long[0].parameters])
        short, long = (
            [mean_error_mrad(windows, numbers, members) for _, members in parts] for windows in short_and_long
        )
        rows.append([f"makers: {name}", *_cells(short), f"{np.mean(long):.1f}", ""])
    for model in MODELS:
        short_and_long = [problem(folder, servo, model, window_s) for window_s in (1.0, LONG_S)]
        short, long = (
            [
                mean_error_mrad(windows, fits[model, "without", fold], members)
                for fold, (_, members) in enumerate(parts)
            ]
            for windows in short_and_long
        )
        fitted_errors = [
            mean_error_mrad(short_and_long[0], fits[model, "all", 0], members) for _, members in parts
        ]
        refused = [
            name
            for (name, _), held_out, fitted in zip(parts, short, fitted_errors, strict=True)
            if held_out > PREDICTED * fitted
        ]
        rows.append([model, *_cells(short), f"{np.mean(long):.1f}", f"{np.mean(fitted_errors):.1f}"])
        for name in refused:
            print(f"{model}: the other recordings do not support a prediction of {name}: refused")
    head = ["held out, mrad over 1 s", *(name for name, _ in parts), "mean", f"over {LONG_S:g} s", "fitted"]
    print(table(head, rows))


def _cells(errors: Sequence[float]) -> list[str]:
    return [*(f"{each:.1f}" for each in errors), f"{np.mean(errors):.1f}"]


def report_numbers(windows: Shooting, fits: dict[tuple[str, str, int], np.ndarray]) -> None:
    """Print the joint law's parameters; those that the recordings do not determine are refused."""
    fitted = fits["joint law", "all", 0]
    draws = np.array([numbers for (_, kind, _), numbers in fits.items() if kind == "draw"])
    rows = []
    for index, parameter in enumerate(windows.parameters):
        low, high = interval(list(draws[:, index])) if len(draws) else interval([])
        value = f"{fitted[index]:.4g}"
        if min(low - parameter.low, parameter.high - high) < AT_BOUND * parameter.scale:
            value = f"refused: {value} is at its bound"
        elif high - low > 2.0 * SUPPORTED * abs(fitted[index]):
            value = f"refused: {value} is not determined"
        rows.append([parameter.name, parameter.unit, value, f"{low:.4g} to {high:.4g}"])
    print(table(["joint law", "unit", "fit to all", "95 % over recordings"], rows))
    print(as_robot(dict(zip([each.name for each in windows.parameters], fitted, strict=True))))
    residual, slope = windows.slopes(fitted)
    names = [each.name for each in windows.parameters]
    found = null_directions(slope.reshape(-1, len(names)), names, float(np.sqrt((residual**2).mean())))
    print("\n".join(f"not determined: {each.text}" for each in found) or "every direction is determined")


def as_robot(value: dict[str, float], supply_v: float = 1.0) -> str:
    """The fit in the form of robot.yaml and MJCF, per volt of the supply."""
    return (
        f"robot.yaml, for each V: stall_torque_nm {value['kt'] * supply_v / value['resistance']:.4g},"
        f" no_load_speed_rad_s {supply_v / value['kt']:.4g}; voltage_driven true,"
        f" duty_resistance {value['duty_resistance']:.3g}, load_friction {value['load_friction']:.3g},"
        f" stribeck_friction_nm {value['stribeck']:.3g}, stribeck_speed_rad_s {value['stribeck_speed']:.3g}\n"
        f"MJCF: armature {value['armature']:.3g}, frictionloss {value['coulomb']:.3g},"
        f" damping {value['viscous']:.3g}\n"
    )


def plot(path: Path, folder: str, servo: str, fits: dict[tuple[str, str, int], np.ndarray]) -> None:
    """Plot the motion of the last model, with each recording held out."""
    model = list(MODELS)[-1]
    windows = problem(folder, servo, model)
    error = np.zeros_like(windows.measured)
    for fold, (_, members) in enumerate(folds(folder, servo)):
        held_out = np.isin(windows.recording, members)
        error[held_out] = windows.errors(fits[model, "without", fold])[held_out]
    names = [log.name for log in logs(folder, servo)]
    plot_windows(path, windows.measured, error, windows.recording, names, ("position, rad",))


if __name__ == "__main__":
    main()
