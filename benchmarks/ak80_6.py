"""Fits a double pendulum of two T-Motor AK80-6; held-out errors of this and of the published fit.

    pip install "footfall[train,report]"
    python benchmarks/ak80_6.py --data FOLDER --workers 2 --plot ak80_6.png

FOLDER holds the CSV files design_A.0_2022… of github.com/dfki-ric-underactuated-lab/double_pendulum
(BSD-3). Where a file has both commanded and measured torques, the commanded ones drive the simulation.
Windows of 0.5 s are simulated from their own initial states, which are refined under a prior. All recordings
have the same weight. Blocks of 2.5 s are held out, a third of them in each of three fits; then each recording
in turn. All fits have the same model, the joint law with load and Stribeck friction: no choice depends on
held-out motion. Intervals are bootstrapped over recordings.

The share of motion that is explained compares the error with the motion from each window's start. The
published set is simulated by the same code: its friction torque c atan(100 v) has c pi/2 as Coulomb friction.
"""

import argparse
import functools
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from recordings.double_pendulum import BASE, EFFECTS, GRAVITY, STEP_S, acceleration
from recordings.rollout import Inputs, rollouts
from recordings.tables import interval, plot_windows, table
from resumable_runs import add_options, run_resumable

from footfall.common.errors import UserError
from footfall.identify.null_space import null_directions
from footfall.identify.shooting import Shooting

WINDOW_S, READ_HZ, MARGIN_S = 0.5, 125.0, 0.05
PARAMETERS = (*BASE, *EFFECTS)
NAMES = [each.name for each in PARAMETERS]
SIGMA_RAD = 0.005  # standard deviation of a reading, the unit of errors
START_SIGMA = (0.003, 0.003, 0.3, 0.3)  # rad, rad/s
FIT_POINTS = 5  # readings on either side from which a start is estimated
PUBLISHED = {  # design A, model 2.0: I1, I2, rotor, friction, m1, m2, r1, r2, l1 as base parameters
    "inertia_1": 0.1346,
    "inertia_12": 0.0235,
    "inertia_2": 0.0267,
    "coupling": 0.604 * 0.3 * 0.184,
    "gravity_1": (0.559 + 0.604) * 0.3 * GRAVITY,
    "gravity_2": 0.604 * 0.184 * GRAVITY,
    "coulomb_1": 0.093 * math.pi / 2,
    "coulomb_2": 0.078 * math.pi / 2,
    "viscous_1": 0.001,
    "viscous_2": 0.001,
    "strength_2": 1.0,
}
BLOCK, FOLDS = 5, 3  # windows that are held out together; fits, each without its share of the blocks
Task = tuple[str, str, int]  # folder; "fit", "blocks", "recording" or "draw"; fold, recording or seed


def read(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, s, (T,), positions, rad, and torques that drove the motors, N m, (T, 2)."""
    names = path.open().readline().strip().split(",")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    columns = dict(zip(names, rows.T, strict=True))

    def pair(*stems: str) -> np.ndarray:
        for stem in stems:
            if f"{stem}1" in columns:
                return np.stack([columns[f"{stem}1"], columns[f"{stem}2"]], axis=1)
        raise UserError(f"{path} has none of the columns {', '.join(f'{stem}1' for stem in stems)}")

    return columns["time"], pair("pos_meas", "pos"), pair("tau_con", "tau")


@functools.cache
def files(folder: str) -> tuple[Path, ...]:
    """The recordings.

    Raises:
        UserError: there are fewer than two.
    """
    found = tuple(sorted(Path(folder).glob("design_A*.csv")))
    if len(found) < 2:
        raise UserError(f"{folder} holds {len(found)} files design_A….csv: two are needed, see --help")
    return found


@functools.cache
def problem(folder: str) -> Shooting:
    """All windows of all recordings."""
    margin, steps = round(MARGIN_S / STEP_S), round(WINDOW_S / STEP_S)
    torques, read_at, measured, starts, recording = [], [], [], [], []
    for index, path in enumerate(files(folder)):
        time_s, position, torque = read(path)
        begin = time_s[0] + MARGIN_S + 0.02
        for window in range(int((time_s[-1] - begin - 0.02) / WINDOW_S)):
            start_s = begin + window * WINDOW_S
            middles = start_s + STEP_S * (np.arange(-margin, steps) + 0.5)
            torques.append(np.stack([np.interp(middles, time_s, torque[:, j]) for j in (0, 1)], axis=1))
            rows = np.searchsorted(time_s, start_s + np.arange(int(WINDOW_S * READ_HZ)) / READ_HZ)
            read_at.append((time_s[rows] - start_s) / STEP_S)
            measured.append(position[rows])
            first = int(np.searchsorted(time_s, start_s))
            neighbours = slice(first - FIT_POINTS, first + FIT_POINTS)
            curve = np.polynomial.polynomial.polyfit(time_s[neighbours] - start_s, position[neighbours], 2)
            starts.append(curve[:2].ravel())
            recording.append(index)
    inputs = Inputs(np.stack(torques), margin, STEP_S, np.array(read_at))
    return Shooting(
        rollouts(acceleration, inputs, PARAMETERS, ("delay_1", "delay_2"), (None, "strength_2")),
        PARAMETERS,
        np.array(measured),
        np.full(2, SIGMA_RAD),
        np.array(starts),
        np.array(START_SIGMA),
        np.array(recording),
    )


def run(task: Task) -> dict[str, Any]:
    """One fit: to all recordings, to all but one, or to a draw of them."""
    folder, kind, number = task
    all_of_them = problem(folder)
    if kind == "fit":
        return {"numbers": all_of_them.fit().tolist()}
    if kind == "draw":
        drawn = np.random.default_rng(number).choice(all_of_them.recordings, len(all_of_them.recordings))
        return {"numbers": all_of_them.of(drawn).fit().tolist()}
    mask = held_out(all_of_them, kind, number)
    return {"numbers": all_of_them.of(all_of_them.recordings, excluded=mask).fit().tolist()}


def held_out(windows: Shooting, kind: str, number: int) -> np.ndarray:
    """Held-out windows, (W,): of one recording, or every third block of all."""
    if kind == "recording":
        return windows.recording == number
    first = np.searchsorted(windows.recording, windows.recording)
    result: np.ndarray = (np.arange(len(first)) - first) // BLOCK % FOLDS == number
    return result


def explained(errors: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Share of the motion from each window's start that a fit explains, (2,); arguments are (W, R, 2)."""
    motion = measured - measured[:, :1]
    result: np.ndarray = 1.0 - (errors**2).sum(axis=(0, 1)) / (motion**2).sum(axis=(0, 1))
    return result


def derived(numbers: np.ndarray) -> dict[str, float]:
    """Numbers by name, with the length of the upper link, m."""
    found = dict(zip(NAMES, map(float, numbers), strict=True))
    return {"length_1": GRAVITY * found["coupling"] / found["gravity_2"], **found}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the CSV files")
    parser.add_argument("--draws", type=int, default=40, help="draws of recordings, for intervals")
    parser.add_argument("--plot", type=Path, help="PNG of held-out windows")
    add_options(parser)
    options = parser.parse_args()
    folder = str(options.data.resolve())
    count = len(files(folder))
    tasks: list[Task] = [
        (folder, "fit", 0),
        *((folder, "blocks", fold) for fold in range(FOLDS)),
        *((folder, "recording", number) for number in range(count)),
        *((folder, "draw", seed) for seed in range(options.draws)),
    ]
    done, failed = run_resumable(run, tasks, options.out, options.workers, options.time_limit)
    if failed:
        sys.exit("\n".join(failed))
    fits = {task[1:]: np.array(each["numbers"]) for task, each in zip(tasks, done, strict=True)}
    names = [path.stem.removeprefix("design_A.0_") for path in files(folder)]
    report_parameters(fits)
    errors = report_motion(problem(folder), fits, names)
    report_null(problem(folder), fits["fit", 0])
    if options.plot is not None:
        windows = problem(folder)
        channels = "shoulder, rad", "elbow, rad"
        plot_windows(options.plot, windows.measured, errors, windows.recording, names, channels)


def report_parameters(fits: dict[tuple[str, int], np.ndarray]) -> None:
    """Print parameters with intervals, beside the published ones."""
    draws = [derived(numbers) for (kind, _), numbers in fits.items() if kind == "draw"]
    published, rows = {"length_1": 0.3, **PUBLISHED}, []
    for name, value in derived(fits["fit", 0]).items():
        low, high = interval([each[name] for each in draws])
        published_value = published.get(name)
        difference = f"{100 * (value / published_value - 1):+.1f} %" if published_value else ""
        rows.append(
            [name, f"{value:.4g}", f"{low:.4g} to {high:.4g}", f"{published_value or 0:.4g}", difference]
        )
    print(table(["parameter", "fit", "95 % over recordings", "published", "difference"], rows))


def report_motion(windows: Shooting, fits: dict[tuple[str, int], np.ndarray], names: list[str]) -> np.ndarray:
    """Print what fits explain of motion that they have not seen; errors with held-out blocks, (W, R, 2)."""
    errors = {kind: np.zeros_like(windows.measured) for kind in ("blocks", "recording")}
    for (kind, number), numbers in fits.items():
        if kind in errors:
            mask = held_out(windows, kind, number)
            errors[kind][mask] = windows.errors(numbers)[mask]
    sets = [*errors.values(), windows.errors(np.array([PUBLISHED.get(name, 0.0) for name in NAMES]))]
    rows = []
    for index, name in enumerate([*names, "all"]):
        rows_of_file = windows.recording == index if index < len(names) else windows.recording >= 0
        shares = [explained(each[rows_of_file], windows.measured[rows_of_file]) for each in sets]
        rms = 1e3 * np.sqrt((sets[0][rows_of_file] ** 2).mean(axis=(0, 1)))
        cells = [", ".join(f"{100 * share:.2f}" for share in each) for each in shares]
        rows.append([name, *cells, ", ".join(f"{each:.1f}" for each in rms)])
    head = [
        "explained of joints 1, 2, %",
        "held-out blocks",
        "held-out recording",
        "published set",
        "rms, mrad",
    ]
    print(table(head, rows))
    return errors["blocks"]


def report_null(windows: Shooting, fitted: np.ndarray) -> None:
    """Print directions of parameters that the recordings do not determine."""
    residual, slope = windows.slopes(fitted)
    found = null_directions(slope.reshape(-1, len(NAMES)), NAMES, float(np.sqrt((residual**2).mean())))
    print("\n".join(f"not determined: {each.text}" for each in found) or "every direction is determined")


if __name__ == "__main__":
    main()
