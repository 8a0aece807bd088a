"""`footfall sweep`."""

from datetime import UTC, datetime
from pathlib import Path

from footfall.common.errors import UserError
from footfall.train.entry import learning_libraries


def sweep(file: Path | None = None, /, *, out: Path | None = None, resume: Path | None = None) -> int:
    """Train over a space of settings and seeds on Ray Tune; exit 1 if a trial failed, 130 if interrupted.

    Parameters
    ----------
    file
        YAML file that says what to sweep (see docs/training.md).
    out
        Folder to make (default: runs/sweep-TIME); each trial is a run folder in it.
    resume
        Folder of a sweep to continue.
    """
    if (file is None) == (resume is None):
        raise UserError("give either a sweep's YAML file or --resume with its folder")
    if resume is not None and out is not None:
        raise UserError("--resume brings the sweep's own folder: leave --out out")
    with learning_libraries():
        from footfall.train.sweeps.sweep import RESULTS, resume_sweep
        from footfall.train.sweeps.sweep import sweep as run_sweep

    if resume is not None:
        folder, (trials, unfinished) = resume, resume_sweep(resume)
    else:
        assert file is not None
        folder = out or Path("runs") / f"sweep-{datetime.now(UTC):%Y%m%d-%H%M%S}"
        trials, unfinished = run_sweep(file, folder)
    _show(trials)
    print(f"wrote {folder / RESULTS}")
    if unfinished:
        print(f"{unfinished} unfinished; continue with: footfall sweep --resume {folder}")
        raise KeyboardInterrupt
    return 1 if any(trial.error for trial in trials) else 0


def _show(trials: list) -> None:
    from rich.console import Console
    from rich.table import Table

    names = list(trials[0].settings) if trials else []
    table = Table("run", "seed", *names, "result", "steps", "", box=None)
    for t in trials:
        settings = [
            f"{value:.4g}" if isinstance(value, float) else str(value) for value in t.settings.values()
        ]
        table.add_row(t.folder, str(t.seed), *settings, f"{t.value:.4g}", f"{t.steps:,}", t.error)
    Console().print(table)
