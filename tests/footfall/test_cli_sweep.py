"""`footfall sweep`: its request, its tables and its exit status."""

import math
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from recorder import Recorder
from shell import Shell

from footfall.train.sweeps.results import Point, Trial

pytestmark = pytest.mark.skipif(find_spec("ray") is None, reason="needs Ray: install footfall[sweep]")


@pytest.fixture
def swept(called: Recorder) -> SimpleNamespace:
    """The result of a sweep."""
    settings = {"ppo.clip_param": 0.2, "ppo.epochs": 3}
    trial = Trial(folder="trial-0", settings=settings, seed=4, value=1.23456, steps=12345, error="")
    point = Point(settings=settings, mean=2.34567, spread=0.5, seeds=3, failed=0, unfinished=0)
    state = SimpleNamespace(trials=[trial], points=[point], unfinished=0)
    for name in ("sweep", "resume_sweep"):
        answer = lambda *_: (state.trials, state.points, state.unfinished)  # noqa: E731
        called.replace(f"footfall.train.sweeps.sweep.{name}", answer)
    return state


def test_options_and_tables(shell: Shell, called: Recorder, swept: SimpleNamespace) -> None:
    swept.points.append(swept.points[0]._replace(mean=2.5, spread=math.nan, seeds=1, failed=2, unfinished=4))
    outcome = shell("sweep", "space.yaml", "--out", "mine")
    assert outcome.status == 0
    assert called.of("sweep") == ((Path("space.yaml"), Path("mine")), {})
    rows = [line.split() for line in outcome.out.splitlines()]
    assert ["trial-0", "4", "0.2", "3", "1.235", "12,345"] in rows
    assert ["0.2", "3", "2.346", "±", "0.5", "3"] in rows
    assert ["0.2", "3", "2.5", "unknown", "1", "2", "4"] in rows


def test_a_sweep_is_resumed_in_its_folder(shell: Shell, called: Recorder, swept: SimpleNamespace) -> None:
    assert shell("sweep", "--resume", "mine").status == 0
    assert called.of("resume_sweep") == ((Path("mine"),), {})
    assert "leave --out out" in shell.refuses("sweep", "--resume", "mine", "--out", "x")
    assert "give either" in shell.refuses("sweep")
    assert "give either" in shell.refuses("sweep", "a.yaml", "--resume", "mine")


def test_failed_and_remaining_runs_set_the_exit_status(shell: Shell, swept: SimpleNamespace) -> None:
    swept.trials = [swept.trials[0], swept.trials[0]._replace(error="it broke")]
    for swept.unfinished, status, text in ((0, 1, "it broke"), (2, 130, "footfall sweep --resume mine")):
        outcome = shell("sweep", "space.yaml", "--out", "mine")
        assert outcome.status == status
        assert text in outcome.out
