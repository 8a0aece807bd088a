"""`footfall sweep`."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from footfall.common.errors import UserError
from footfall.options import OptionalPath
from footfall.train.entry import learning_libraries

if TYPE_CHECKING:
    from footfall.train.sweeps.results import Point, Trial


def sweep(file: OptionalPath = None, /, *, out: OptionalPath = None, resume: OptionalPath = None) -> int:
    """Train over a space of settings and seeds on Ray Tune; exit 1 if a trial failed, 130 if interrupted.

    Parameters
    ----------
    file
        YAML file with the settings to sweep (see docs/training.md).
    out
        Folder to create (default: runs/sweep-TIME); each trial is a run folder in it.
    resume
        Folder of a sweep to continue.
    """
    if (file is None) == (resume is None):
        raise UserError("give either a sweep's YAML file or --resume with its folder")
    if resume is not None and out is not None:
        raise UserError("--resume uses the sweep's own folder: omit --out")
    with learning_libraries():
        from footfall.train.sweeps.sweep import POINTS, RESULTS, resume_sweep
        from footfall.train.sweeps.sweep import sweep as run_sweep

    if resume is not None:
        folder, (trials, points, unfinished) = resume, resume_sweep(resume)
    else:
        assert file is not None
        folder = out or Path("runs") / f"sweep-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        trials, points, unfinished = run_sweep(file, folder)
    _show_trials(trials)
    _show_points(points)
    print(f"wrote {folder / RESULTS} and {folder / POINTS}")
    if unfinished:
        print(f"{unfinished} unfinished; continue with: footfall sweep --resume {folder}")
        raise KeyboardInterrupt
    return 1 if any(trial.error for trial in trials) else 0


def _show_trials(trials: "list[Trial]") -> None:
    names = list(trials[0].settings) if trials else []
    rows = [
        [t.folder, str(t.seed), *map(_short, t.settings.values()), _short(t.value), f"{t.steps:,}", t.error]
        for t in trials
    ]
    _show(["run", "seed", *names, "result", "steps", ""], rows)


def _show_points(points: "list[Point]") -> None:
    """Show means over seeds with their deviation: a smaller difference between points may be chance."""
    names = list(points[0].settings) if points else []
    rows = [
        [
            *map(_short, p.settings.values()),
            _short(p.mean),
            "unknown" if math.isnan(p.spread) else f"± {_short(p.spread)}",
            str(p.seeds),
            str(p.failed or ""),
            str(p.unfinished or ""),
        ]
        for p in points
    ]
    _show([*names, "mean result", "deviation between seeds", "seeds", "failed", "unfinished"], rows)


def _show(header: list[str], rows: list[list[str]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(*header, box=None)
    for row in rows:
        table.add_row(*row)
    Console().print(table)


def _short(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
