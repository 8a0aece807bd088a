"""The log of metrics: TensorBoard events, and lines of JSON."""

import json
import math
from pathlib import Path

import pytest

pytest.importorskip("tensorboard")

from small_disk import fill
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from footfall.common.errors import CannotWriteError
from footfall.train.runs.metrics import MetricsLog


def test_tensorboard_reads_the_log_and_drops_repeated_steps(tmp_path: Path) -> None:
    for first, steps in ((0, (10, 20, 30)), (20, (30, 40))):  # killed after 30, resumed from 20
        log = MetricsLog(tmp_path, first)
        for step in steps:
            log.write(step, {"reward/total": step + first / 100, "reward/huge": -1e39})
        log.close()
    events = EventAccumulator(str(tmp_path / "events"))
    events.Reload()
    read = {event.step: event.value for event in events.Scalars("reward/total")}
    assert read == pytest.approx({10: 10.0, 20: 20.0, 30: 30.2, 40: 40.2})
    assert {event.value for event in events.Scalars("reward/huge")} == {-math.inf}
    lines = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [10, 20, 30, 40]


def test_a_resumed_log_keeps_its_earlier_rows(tmp_path: Path) -> None:
    path = tmp_path / "metrics.jsonl"
    path.write_text('{"step": 10}\n{"step": 20}\nhalf a li\n{"no": 1}\n{"step": 30}\n')
    MetricsLog(tmp_path, 20).close()
    assert path.read_text() == '{"step": 10}\n{"step": 20}\n'


def test_a_record_that_does_not_fit_on_the_disk_leaves_no_part(disk: Path) -> None:
    log = MetricsLog(disk, 0)
    log.write(1, {"reward/total": 1.0})
    filler = fill(disk)
    long = {f"reward/{k}": 1.0 for k in range(2000)}  # more than the rest of the last page
    with pytest.raises(CannotWriteError, match="No space left on device"):
        log.write(2, long)
    filler.unlink()
    log.write(1000, {"reward/total": 2.0})
    log.close()
    lines = [json.loads(line) for line in (disk / "metrics.jsonl").read_text().splitlines()]
    assert lines == [{"step": 1, "reward/total": 1.0}, {"step": 1000, "reward/total": 2.0}]
