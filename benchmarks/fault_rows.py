"""The fault table: rows of runs with a fault, counts of runs without one, and docs/faults.json.

Not a benchmark itself: `fault_table.py` calls it.
"""

import json
import math
import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from fault_kinds import KINDS
from fault_kinds.kind import FaultKind
from fault_runs import title_of
from fault_subjects import SUBJECTS, Subject
from healthy_runs import KINDS as HEALTHY

from footfall.deploy.modes import Mode

ROUNDING = 0.04  # share of peak torque: largest rounding error of a frame, for the smallest motors


def rows(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each robot, policy and kind of fault, in the order of the table of kinds."""
    found = []
    for subject in SUBJECTS:
        for kind in KINDS:
            of_kind = [run for run in runs if _subject(run) == subject and run["kind"] == title_of(kind)]
            injected = [run for run in of_kind if run.get("came", True)]
            if injected:
                found.append(_row(subject, kind, injected))
    return found


def _subject(run: dict[str, Any]) -> Subject:
    return Subject(run["robot"], run["policy"], run.get("ground", ""))


def _row(subject: Subject, kind: FaultKind, runs: list[dict[str, Any]]) -> dict[str, Any]:
    seconds = [run["seconds"] for run in runs if run["seconds"] is not None]
    in_time = sum(s <= (kind.within_s or math.inf) + 1e-9 for s in seconds)
    detected = sum(run["detected"] for run in runs)
    worst = {name: max(run[name] for run in runs) for name in ("torque_over", "outside_rad", "rate_share")}
    within_limits = (
        worst["torque_over"] <= ROUNDING and worst["outside_rad"] <= 1e-3 and worst["rate_share"] <= 1.01
    )
    idle = sum(run["fell"] and run["final_state"] == Mode.IDLE.value for run in runs)
    stiff = any(run.get("stiff_when_damped") for run in runs)
    expected = kind.within_s is None or in_time >= 0.99 * len(runs)
    return {
        **subject._asdict(),
        "kind": title_of(kind),
        "group": kind.group,
        "runs": len(runs),
        "detected": detected,
        "in_time": in_time,
        "limit_s": kind.within_s,
        "median_s": float(np.median(seconds)) if seconds else None,
        "longest_s": max(seconds, default=None),
        **worst,
        "stiff": sum(run["stiff"] for run in runs),
        "final_states": dict(Counter(run["final_state"] for run in runs)),
        "fell": sum(run["fell"] for run in runs),
        "idle_after_a_fall": idle,
        "reason": kind.reason,
        "faults": dict(Counter(_without_figures(run["fault"]) for run in runs).most_common(3)),
        "stiff_when_damped": stiff,
        "as_expected": expected and within_limits and not idle and not stiff,
    }


def _without_figures(fault: str) -> str:
    return re.sub(r"^.*\(can\d+, id \d+\): ", "", re.sub(r"-?\d+\.\d+|\d+(?=%)", "…", fault))


def table(found: Sequence[dict[str, Any]], healthy: Sequence[dict[str, Any]]) -> str:
    """Content of docs/faults.json: rows of faults, and counts of runs without one; a row a line."""
    parts = {"healthy": _healthy_rows(healthy), "rows": [_published(row) for row in found]}
    blocks = [
        f'"{name}": [\n' + ",\n".join(json.dumps(row, ensure_ascii=False) for row in part) + "\n]"
        for name, part in parts.items()
    ]
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def _healthy_rows(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for subject in SUBJECTS:
        for kind in HEALTHY:
            of_kind = [run for run in runs if _subject(run) == subject and run["kind"] == kind]
            if of_kind:
                rows.append(
                    {
                        "policy": subject.policy,
                        "robot": subject.robot,
                        "ground": subject.ground or "level",
                        "kind": kind,
                        "runs": len(of_kind),
                        "false_alarms": sum(bool(run["alarm"]) for run in of_kind),
                        "fell": sum(run["fell"] for run in of_kind),
                    }
                )
    return rows


def _published(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "policy": row["policy"],
        "robot": row["robot"],
        "ground": row["ground"] or "level",
        "group": row["group"],
        "fault": row["kind"].removesuffix(f" ({row['group']})"),
        "noticed": row["detected"],
        "runs": row["runs"],
        "median_ms": _ms(row["median_s"]),
        "longest_ms": _ms(row["longest_s"]),
        "limit_ms": _ms(row["limit_s"]),
        "commands": _worst(row),
        "ends": dict(sorted(row["final_states"].items())),
        "fell_first": row["fell"],
        "as_expected": row["as_expected"],
        "reason": row["reason"] if row["as_expected"] else row["reason"] or "missed",
    }


def _ms(seconds: float | None) -> int | None:
    return None if seconds is None else round(1e3 * seconds)


def _worst(row: dict[str, Any]) -> str:
    """The limit that a command exceeded, if any."""
    if row["group"] == "at the start" and not row["stiff"]:
        return "no stiffness"
    exceeded = []
    if row["torque_over"] > ROUNDING:
        exceeded.append(f"torque over by {row['torque_over']:.0%} of the peak")
    if row["outside_rad"] > 1e-3:
        exceeded.append(f"target {row['outside_rad']:.2f} rad outside")
    if row["rate_share"] > 1.01:
        exceeded.append(f"target at {row['rate_share']:.1f} times its rate")
    if row["stiff_when_damped"]:
        exceeded.append("stiffness while damped")
    return ", ".join(exceeded) or "within"
