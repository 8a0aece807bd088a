"""Injects every kind of fault in `benchmarks/fault_kinds` into walking robots, and counts false alarms.

    python benchmarks/fault_table.py --seeds 100 --healthy 1000 --out faults.jsonl
    python benchmarks/fault_table.py --read faults.jsonl --json docs/faults.json

Finished runs are kept in the file; a second call does not repeat them.

All runs are in lockstep over the simulated bus. The simulator's fall detection only records, because a
real robot has none: a run ends when the robot damps itself, or a while after the fault.
"""

import argparse
from pathlib import Path
from typing import Any

from fault_kinds import KINDS
from fault_kinds.kind import FaultKind
from fault_rows import rows, table
from fault_runs import run_fault, title_of
from fault_subjects import (
    GET_UP,
    POWERED,
    SUBJECTS,
    FaultTask,
    HealthyTask,
    Subject,
    is_first,
    policy_of,
    robot_of,
)
from healthy_runs import KINDS as HEALTHY
from healthy_runs import run_healthy
from resumable_runs import read_runs, run_resumable


def is_tried(subject: Subject, kind: FaultKind) -> bool:
    """Whether the table has this row.

    Wiring, getting up and batteries do not depend on the walking policy.
    """
    has_all_rows = SUBJECTS[subject]
    if not (has_all_rows or kind.main):
        return False
    if kind.wiring:
        possible = not kind.lying or robot_of(subject.robot).lying_pose is not None
        return is_first(subject) and possible
    if kind.getting_up:
        return is_first(subject) and subject.robot in GET_UP
    if kind.powered:
        return is_first(subject) and subject.robot in POWERED
    return not kind.needs_estimate or policy_of(subject.robot, subject.policy).needs_estimate


def measure(options: argparse.Namespace) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[str]]:
    """Run all requested runs: those with a fault, those without, and the errors."""
    chosen = [
        subject
        for subject in SUBJECTS
        if options.policy in (None, subject.policy) and options.ground in (None, subject.ground or "level")
    ]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    kinds = [
        kind
        for kind in KINDS
        if (options.only or "") in title_of(kind)
        and (not options.group or kind.group in options.group)
        and (kind.main or not options.main)
    ]
    kinds_of = {subject: [kind for kind in kinds if is_tried(subject, kind)] for subject in chosen}
    faults = [
        FaultTask(subject.robot, subject.policy, title_of(kind), seed, subject.ground)
        for seed in seeds  # outermost, so that an interrupted run has results of each kind
        for subject in chosen
        for kind in kinds_of[subject]
    ]
    healthy = [
        HealthyTask(subject.robot, subject.policy, kind, seed, subject.ground)
        for seed in range(options.healthy)
        for subject in chosen
        for kind in HEALTHY
    ]
    run_options = (options.out, options.workers, options.time_limit)
    runs, errors = run_resumable(run_fault, faults, *run_options)
    walks, healthy_errors = run_resumable(run_healthy, healthy, *run_options)
    return runs, walks, [*errors, *healthy_errors]


def read(path: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Runs with a fault, and runs without one, from a file."""
    runs = list(read_runs(path).values())
    return [run for run in runs if "alarm" not in run], [run for run in runs if "alarm" in run]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument(
        "--first-seed", type=int, default=0, help="first seed, if several machines share the work"
    )
    parser.add_argument("--workers", type=int)
    parser.add_argument("--healthy", type=int, default=0, help="runs without a fault, of each kind")
    parser.add_argument("--policy", help="only this policy")
    parser.add_argument("--ground", help="only this ground: level, rough or g1_rough")
    parser.add_argument("--main", action="store_true", help="only main rows, for every policy")
    parser.add_argument("--only", help="only kinds whose names contain this")
    parser.add_argument("--group", nargs="+", help="only kinds of these groups, such as wiring")
    parser.add_argument("--out", type=Path, help="file that keeps every run; those in it are not run again")
    parser.add_argument(
        "--time-limit",
        type=float,
        help="seconds after which no run begins; counts anew for the runs without a fault",
    )
    parser.add_argument("--read", type=Path, help="make the table from these runs instead of running any")
    parser.add_argument("--json", type=Path, help="write the table's rows to this file")
    options = parser.parse_args()

    runs, healthy, errors = (*read(options.read), []) if options.read else measure(options)
    found = rows(runs)
    if options.json:
        options.json.write_text(table(found, healthy), encoding="utf-8")
    wrong = [row for row in found if not row["as_expected"]]
    alarms = [run for run in healthy if run["alarm"]]
    print(f"{len(found)} rows, {len(wrong)} not as expected; {len(alarms)} false alarms")
    for row in wrong:
        name = f"{row['policy']} {row['ground']}: {row['kind']}"
        print(f"  {name}: in time {row['in_time']}/{row['runs']}, {row['faults']}")
    for text in [*(f"  alarm: {run}" for run in alarms), *errors]:
        print(text)


if __name__ == "__main__":
    main()
