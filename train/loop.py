"""The training loop, of every trainer."""

from footfall.train import cluster
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.folder import Run
from footfall.train.runs.journal import FailureCheck, Journal
from footfall.train.runs.stop import StopRequest
from footfall.train.trainer import Trainer


def learn(run: Run, trainer: Trainer, display: Display) -> None:
    """Run the remaining iterations; log each one while the next is computed.

    A first Ctrl-C or SIGTERM ends the training after the iteration at hand, with a checkpoint.

    Raises:
        KeyboardInterrupt: it was stopped before its last iteration.
        UserError: the training has failed, or its end cannot be written.
    """
    last, stopped = run.config.ppo.iterations, False
    with cluster.all_or_none():
        main = cluster.is_main_process()
        journal = Journal(run, trainer.iteration, display) if main else FailureCheck(run)
    with StopRequest() as stop:
        while trainer.iteration < last and not stopped:
            metrics = trainer.iterate()
            journal.report(trainer.iteration, metrics)
            stopped, due = map(bool, cluster.broadcast(stop.requested, journal.checkpoint_due))
            if due:
                journal.save(trainer.save)
        journal.flush()
        (saved,) = cluster.broadcast(checkpoint.path_of(run.checkpoints, trainer.iteration).exists())
        if not saved:
            with cluster.all_or_none():
                trainer.save()
    journal.close()
    if trainer.iteration < last:
        raise KeyboardInterrupt
