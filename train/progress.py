"""How far a run has come; with several processes, process 0 reads the folder for all."""

from pathlib import Path

from footfall.common.errors import UserError
from footfall.train import cluster
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Run


def stopped_message(run: Run) -> str:
    """One line: the steps of a stopped run, and the command to continue it."""
    newest, ppo = checkpoint.latest(run.checkpoints), run.config.ppo
    steps = int(newest.stem) * ppo.steps_per_iteration if newest else 0
    return (
        f"stopped after {steps:,} of {ppo.iterations * ppo.steps_per_iteration:,} steps;"
        f" continue with: footfall train --resume {run.folder}"
    )


def is_finished(run: Run) -> bool:
    """Whether process 0 finds the last checkpoint and the exported policy."""
    newest = checkpoint.latest(run.checkpoints)
    done = newest is not None and int(newest.stem) >= run.config.ppo.iterations
    (finished,) = cluster.broadcast(done and run.policy.is_file())
    return bool(finished)


def newest_checkpoint(run: Run) -> Path | None:
    """The newest checkpoint of process 0, or None; a shared disk may show an older one to other processes.

    Raises:
        UserError: this process does not see it.
    """
    newest = checkpoint.latest(run.checkpoints)
    (iteration,) = cluster.broadcast(int(newest.stem) if newest else 0)
    if iteration == 0:
        return None
    path = checkpoint.path_of(run.checkpoints, iteration)
    if not path.is_file():
        raise UserError(f"process 0 resumes from {path}, which this process cannot see yet: try again")
    return path
