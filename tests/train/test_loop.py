"""The training loop and what it says, with a trainer that computes nothing."""

import io
import json
import os
import re
import signal
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import pytest

pytest.importorskip("jax")

import jax.numpy as jnp
from rich.console import Console
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from footfall.common.errors import UserError
from footfall.train import api, cluster
from footfall.train.config import load_preset
from footfall.train.loop import learn
from footfall.train.runs import checkpoint, provenance
from footfall.train.runs.display import Display
from footfall.train.runs.folder import Provenance, Run, create_run
from footfall.train.runs.journal import FailureCheck, Journal
from footfall.train.runs.metrics import MetricsLog

ITERATIONS = 4
STEPS = 256  # of an iteration
METRICS = {
    "reward/total": 1.5,
    "reward/alive": 0.5,
    "episode/length_s": 2.0,
    "tracking/linear_error_m_s": 0.25,
    "tracking/yaw_error_rad_s": 0.5,
    "learning/policy_dist_mean_std": 0.6,
    "learning/kl_mean": 0.0004,
}


class FakeTrainer:
    """Counts its iterations; metrics are a device's, computed when asked for."""

    device_errors: ClassVar[tuple[type[Exception], ...]] = ()

    def __init__(self, run: Run, before_iteration: Callable[[int], None] = lambda _: None) -> None:
        self.run, self.before_iteration = run, before_iteration
        self.iteration = 0
        self.asked: list[str] = []

    @staticmethod
    def prefetch(run: Any, robot: Any) -> None: ...

    def prepare(self, say: Any) -> None: ...

    def restore(self, path: Path) -> None:
        self.iteration = int(path.stem)

    def iterate(self) -> dict[str, Any]:
        self.before_iteration(self.iteration + 1)
        self.iteration += 1
        self.asked.append(f"iterate {self.iteration}")
        return {name: jnp.float32(value) for name, value in METRICS.items()}

    def save(self) -> None:
        self.asked.append(f"save {self.iteration}")
        checkpoint.write(self.run.checkpoints, self.iteration, b"state")

    def export(self, path: Path) -> float:
        return 0.0


@pytest.fixture
def run(tmp_path: Path) -> Run:
    smoke = load_preset("smoke")
    config = replace(smoke, ppo=replace(smoke.ppo, total_steps=ITERATIONS * STEPS), checkpoint_interval_s=1e6)
    made = Provenance("go1", 0, "smoke", "brax", "cpu", "unknown", "now", {})
    return create_run(tmp_path / "run", made, config)


def quiet() -> Display:
    return Display(ITERATIONS * STEPS, Console(file=io.StringIO()))


def logged(run: Run) -> list[dict[str, float]]:
    return [json.loads(line) for line in (run.folder / "metrics.jsonl").read_text().splitlines()]


def test_it_iterates_to_the_end_logs_each_iteration_and_saves_the_last(run: Run) -> None:
    trainer = FakeTrainer(run)
    learn(run, trainer, quiet())
    assert trainer.asked == ["iterate 1", "iterate 2", "iterate 3", "iterate 4", "save 4"]
    assert [line["step"] for line in logged(run)] == [STEPS * k for k in range(1, ITERATIONS + 1)]


def test_an_iteration_is_logged_while_the_next_one_is_computed(run: Run) -> None:
    seen = []

    def look(iteration: int) -> None:
        seen.append((iteration, len(logged(run))))

    learn(run, FakeTrainer(run, look), quiet())
    assert seen == [(1, 0), (2, 0), (3, 1), (4, 2)]


def test_metrics_that_are_there_already_are_logged_at_once(run: Run) -> None:
    journal = Journal(run, 0, quiet())
    journal.report(1, METRICS)
    assert len(logged(run)) == 1


def test_a_checkpoint_is_saved_when_it_is_due_and_after_its_metrics(run: Run) -> None:
    often = replace(run, config=replace(run.config, checkpoint_interval_s=0.0))
    trainer = FakeTrainer(often)
    learn(often, trainer, quiet())
    assert trainer.asked == [f"{what} {k}" for k in range(1, ITERATIONS + 1) for what in ("iterate", "save")]


def test_a_first_signal_ends_it_after_the_iteration_with_a_checkpoint(run: Run) -> None:
    def stop(iteration: int) -> None:
        if iteration == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    trainer = FakeTrainer(run, stop)
    with pytest.raises(KeyboardInterrupt):
        learn(run, trainer, quiet())
    assert trainer.asked == ["iterate 1", "iterate 2", "save 2"]
    assert [line["step"] for line in logged(run)] == [STEPS, 2 * STEPS]


def test_a_signal_in_the_last_iteration_interrupts_nothing(run: Run) -> None:
    def stop(iteration: int) -> None:
        if iteration == ITERATIONS:
            os.kill(os.getpid(), signal.SIGINT)

    trainer = FakeTrainer(run, stop)
    try:
        learn(run, trainer, quiet())  # and what follows exports its policy
    except KeyboardInterrupt:
        pytest.fail("a training that is complete counts as interrupted")
    assert trainer.asked[-2:] == ["iterate 4", "save 4"]


def test_what_is_saved_already_is_not_saved_again(run: Run) -> None:
    trainer = FakeTrainer(run)
    learn(run, trainer, quiet())
    trainer.asked.clear()
    learn(run, trainer, quiet())
    assert trainer.asked == []


def test_a_second_signal_interrupts_at_once(run: Run) -> None:
    def stop(iteration: int) -> None:
        if iteration == 2:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)

    trainer = FakeTrainer(run, stop)
    with pytest.raises(KeyboardInterrupt):
        learn(run, trainer, quiet())
    assert trainer.asked == ["iterate 1"]


def test_other_processes_stop_and_save_when_the_main_one_says(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "is_main_process", lambda: False)
    said = iter([(0, 0), (0, 1), (1, 0), (0,)])  # stop, checkpoint due; at last: it is not saved
    monkeypatch.setattr(cluster, "broadcast", lambda *_: next(said))
    trainer = FakeTrainer(run)
    with pytest.raises(KeyboardInterrupt):
        learn(run, trainer, quiet())
    assert trainer.asked == ["iterate 1", "iterate 2", "save 2", "iterate 3", "save 3"]
    assert not (run.folder / "metrics.jsonl").exists()


def test_a_failure_is_noticed_by_every_process(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "is_main_process", lambda: False)
    journal = FailureCheck(run)
    journal.report(1, {"learning/total_loss": jnp.float32("nan")})
    with pytest.raises(UserError, match="iteration 1: learning/total_loss is not finite; see process 0"):
        journal.report(2, METRICS)


def test_a_stopped_run_says_how_far_it_came_and_how_to_go_on(
    run: Run, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(api, "_train_to_the_end", interrupted)
    for kept, steps in ((None, "0"), (3, "768")):
        if kept:
            checkpoint.write(run.checkpoints, kept, b"state")
        with pytest.raises(KeyboardInterrupt):
            api.resume(run.folder)
        said = f"stopped after {steps} of 1,024 steps; continue with: footfall train --resume {run.folder}"
        assert said in capsys.readouterr().out


def test_a_checkpoint_is_due_an_interval_after_the_last_one(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = [100.0]
    monkeypatch.setattr("footfall.train.runs.journal.time", SimpleNamespace(monotonic=lambda: now_s[0]))
    run = replace(run, config=replace(run.config, checkpoint_interval_s=30.0))
    journal = Journal(run, 0, quiet())
    due = []
    for at_s in (129.0, 131.0, 132.0, 160.0, 162.0):
        now_s[0] = at_s
        due.append(journal.checkpoint_due)
        if at_s == 131.0:
            journal.save(lambda: None)
    journal.close()
    assert due == [False, True, False, False, True]


def test_where_no_episode_ended_no_length_is_logged(run: Run) -> None:
    journal = Journal(run, 0, quiet())
    for iteration, length in ((1, 0.0), (2, 1.5)):
        journal.report(iteration, METRICS | {"episode/length_s": length})
    journal.close()
    assert [line.get("episode/length_s") for line in logged(run)] == [None, 1.5]


def test_tensorboard_reads_what_is_logged_and_forgets_what_is_computed_again(tmp_path: Path) -> None:
    for first, steps in ((0, (10, 20, 30)), (20, (30, 40))):  # killed after 30, resumed from 20
        log = MetricsLog(tmp_path, first)
        for step in steps:
            log.write(step, {"reward/total": step + first / 100})
        log.close()
    events = EventAccumulator(str(tmp_path / "events"))
    events.Reload()
    read = {event.step: event.value for event in events.Scalars("reward/total")}
    assert read == pytest.approx({10: 10.0, 20: 20.0, 30: 30.2, 40: 40.2})
    lines = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [10, 20, 30, 40]


class TestDisplay:
    def shown(self, metrics: dict[str, float]) -> list[str]:
        """What a terminal of 80 × 24 shows last."""
        terminal = Console(width=80, height=24, force_terminal=True, color_system=None, file=io.StringIO())
        display = Display(ITERATIONS * STEPS, terminal)
        with display:
            display.doing("compiling")
            display._screen.refresh()
            display.update(2 * STEPS, 1000.0, metrics)
            display._screen.refresh()
        text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\n", terminal.file.getvalue())  # type: ignore[attr-defined]
        return text.splitlines()

    def test_it_says_that_it_compiles_and_for_how_long(self) -> None:
        (compiling, *_) = [line for line in self.shown(METRICS) if "compiling" in line]
        assert "0:00:00 elapsed" in compiling

    def test_the_reward_is_first_names_stand_beside_values_and_details_are_left_to_the_log(self) -> None:
        lines = self.shown(METRICS)
        last = lines[len(lines) - 1 - lines[::-1].index("512 of 1,024 steps, 1,000 per s") :]
        assert last[1].split() == ["reward/total", "1.500", "tracking/linear_error_m_s", "0.250"]
        assert "learning/kl_mean 4.0e-04" in " ".join(" ".join(last).split())
        assert not any("policy_dist" in line for line in lines)

    def test_it_fits_a_small_terminal(self) -> None:
        lines = self.shown(METRICS | {f"reward/term_{k}": 0.0 for k in range(40)})
        last = lines[len(lines) - 1 - lines[::-1].index("512 of 1,024 steps, 1,000 per s") :]
        assert len(last) < 24
        assert max(map(len, last)) <= 80

    def test_without_a_terminal_it_says_lines(self, capsys: pytest.CaptureFixture[str]) -> None:
        display = Display(ITERATIONS * STEPS, Console(width=200))
        display.doing("compiling")
        display.update(2 * STEPS, 256.0, {n: v for n, v in METRICS.items() if n != "episode/length_s"})
        first, second = capsys.readouterr().out.splitlines()
        assert first == "compiling"
        assert second == (
            "512 of 1,024 steps, 256 per s, 2 s left, reward 1.50, episode - s, error 0.250 m/s 0.500 rad/s"
        )


def test_a_revision_tells_one_change_of_the_source_from_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def git(*arguments: str) -> None:
        subprocess.run(
            ["git", "-c", "user.name=a", "-c", "user.email=b", *arguments], cwd=tmp_path, check=True
        )

    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    git("init", "-q")
    source = tmp_path / "source.py"
    (tmp_path / "provenance.py").touch()
    seen = []
    for text in ("one", "two", "three", "one"):
        source.write_text(text)
        if not seen:
            git("add", "-A")
            git("commit", "-q", "-m", "source")
        seen.append(provenance.source_revision())
    clean, two, three, again = seen
    assert re.fullmatch("[0-9a-f]{40}", clean)
    assert two.startswith(f"{clean} with uncommitted changes ")
    assert len({clean, two, three}) == 3
    assert again == clean
    source.write_text("two")
    git("add", "-A")  # staged is not committed
    assert provenance.source_revision() == two


@pytest.mark.parametrize("in_a_repository", [False, True])
def test_without_a_checkout_the_files_themselves_tell(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_a_repository: bool
) -> None:
    """As in an installed wheel, whose environment may lie in somebody else's repository."""
    installed = tmp_path / ".venv" / "footfall"
    (installed / "train" / "runs").mkdir(parents=True)
    (installed / "policies").mkdir()
    source, data = installed / "train" / "api.py", installed / "policies" / "gaits.yaml"
    monkeypatch.setattr(provenance, "__file__", str(installed / "train" / "runs" / "provenance.py"))
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    if in_a_repository:
        (tmp_path / ".gitignore").write_text(".venv")
        for arguments in ("init -q", "add -A", "-c user.name=a -c user.email=b commit -q -m theirs"):
            subprocess.run(["git", *arguments.split()], cwd=tmp_path, check=True)
    seen = []
    for code, gaits in (("one", "trot"), ("two", "trot"), ("one", "pace"), ("one", "trot")):
        source.write_text(code)
        data.write_text(gaits)
        seen.append(provenance.source_revision())
    assert all(re.fullmatch("digest [0-9a-f]{8}", revision) for revision in seen)
    assert len(set(seen)) == 3
    assert seen[3] == seen[0]
