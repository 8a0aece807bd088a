"""The training loop that all trainers share."""

from footfall.train import cluster
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.failure import TrainingFailedError, failure_of, record_failure
from footfall.train.runs.folder import Run
from footfall.train.runs.journal import Journal
from footfall.train.runs.pending import PendingMetrics
from footfall.train.runs.stop import StopRequest
from footfall.train.trainer import Trainer


def learn(run: Run, trainer: Trainer, display: Display) -> None:
    """Run the remaining iterations; log each one while the next is computed.

    A first Ctrl-C or SIGTERM ends the training after the current iteration, with a checkpoint.

    Raises:
        KeyboardInterrupt: the training was stopped before its last iteration.
        UserError: the training failed, or its last checkpoint cannot be written.
    """
    with cluster.all_or_none():
        journal = Journal(run, trainer.iteration, display) if cluster.is_main_process() else None
    try:
        _iterate(run, trainer, journal)
    except TrainingFailedError as failed:
        raise record_failure(run, failed, trainer.can_diagnose) from None
    finally:
        if journal is not None:
            journal.close()
    if trainer.iteration < run.config.ppo.iterations:
        raise KeyboardInterrupt


def _iterate(run: Run, trainer: Trainer, journal: Journal | None) -> None:
    """Train to the end or to a stop request, with a checkpoint at the end. Processes stay in step."""

    def receive(iteration: int, metrics: dict[str, float]) -> None:
        if journal is not None:
            journal.log(iteration, metrics)
        reason = failure_of(metrics, run.config.diverged_limit)
        if reason is not None:
            raise TrainingFailedError(iteration, reason)

    stopped = False
    with PendingMetrics(receive) as pending, StopRequest() as stop:
        while trainer.iteration < run.config.ppo.iterations and not stopped:
            metrics = trainer.iterate()
            pending.report(trainer.iteration, metrics)
            due = journal is not None and journal.checkpoint_due
            stopped, due = map(bool, cluster.broadcast(stop.requested, due))
            if due:
                pending.flush()
                if journal is None:
                    trainer.save()
                else:
                    journal.save(trainer.save)
        pending.flush()
        (saved,) = cluster.broadcast(checkpoint.path_of(run.checkpoints, trainer.iteration).exists())
        if not saved:
            with cluster.all_or_none():
                trainer.save()
