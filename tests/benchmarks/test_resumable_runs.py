"""A benchmark's results are kept in its file and continued after an interruption."""

from pathlib import Path
from typing import Any

from resumable_runs import read_runs, run_resumable

TASKS = [("a", 1), ("b", 2), ("c", 3)]


def _double(task: tuple[str, int]) -> dict[str, Any]:
    if task[0] == "b":
        raise ValueError("no b today")
    return {"name": task[0], "doubled": 2 * task[1]}


def _never(task: tuple[str, int]) -> dict[str, Any]:
    raise AssertionError("it was run again")


def test_results_come_in_the_tasks_order_and_failures_and_runs_beyond_the_time_are_named(
    tmp_path: Path,
) -> None:
    late = run_resumable(_never, TASKS, tmp_path / "late.jsonl", workers=1, time_limit_s=0.0)
    assert late == ([], ["3 of 3 runs are left for another call"])
    results, errors = run_resumable(_double, TASKS, tmp_path / "runs.jsonl", workers=1)
    assert results == [{"name": "a", "doubled": 2}, {"name": "c", "doubled": 6}]
    assert errors == ["('b', 2): ValueError: no b today"]


def test_finished_rows_are_kept_and_a_truncated_row_is_run_again(tmp_path: Path) -> None:
    out = tmp_path / "runs.jsonl"
    out.write_text('{"task": ["a", 1], "result": {"kept": true}}\n{"task": ["c", 3], "resu')
    assert list(read_runs(out)) == ['["a", 1]']
    results, _ = run_resumable(_never, TASKS[:1], out, workers=1)
    assert results == [{"kept": True}]
    results, _ = run_resumable(_double, TASKS, out, workers=1)
    assert results == [{"kept": True}, {"name": "c", "doubled": 6}]
    assert list(read_runs(out)) == ['["a", 1]', '["c", 3]']
