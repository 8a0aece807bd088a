"""`footfall diagnose`."""

from pathlib import Path

from footfall.train.entry import learning_libraries


def diagnose(run: Path, /) -> int:
    """Replay a failed training up to its first non-finite value; exit 0 if it fails again, 1 if not.

    Parameters
    ----------
    run
        Run folder of the failed training.
    """
    with learning_libraries():
        from footfall.train import api
    result = api.diagnose(run, report=lambda text: print(text, flush=True))
    failure = result.failure
    if result.differences:
        print(f"the replay is approximate: it failed with {'; '.join(result.differences)}")
    print(f"iteration {failure.iteration}, original run: {failure.reason}")
    print(f"iteration {failure.iteration}, replay: {result.reason or 'no failure'}")
    print(f"first: {result.finding}")
    if result.saved is not None:
        print(f"the environment before that step was saved to {result.saved}")
    return 0 if result.reason is not None else 1
