"""Replay: runs policies again on the inputs in a run's log, with the changes during the run."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from footfall.common.config import structure
from footfall.common.errors import UserError
from footfall.deploy.changes import Change
from footfall.deploy.handover import Handover, HandoverConfig
from footfall.deploy.last_resort import in_one_line
from footfall.deploy.log_file import Entry, LogFile, read_log
from footfall.deploy.log_numbers import unflatten
from footfall.deploy.timed_policy import WrongSizeError
from footfall.policies.height_scan import common_height_scan
from footfall.policies.policy import Policy, PolicyInput
from footfall.robots.actuator import JointCommand

INPUTS, DECISIONS, CHANGES = "/policy/inputs", "/policy/command", "/policy/changes"
OTHERS, HANDOVER = "other_policies", "handover"  # metadata of a run with several policies
GET_UP = "get_up_policy"  # metadata of a run with consent to get up after a fall


@dataclass(frozen=True)
class Replay:
    """Comparison of a policy's decisions with those in a log."""

    steps: int
    complete: bool  # whether the run ended properly
    damaged: int  # parts of the log that could not be read
    worst_difference: float  # largest absolute difference of any number; inf if one is NaN
    first_difference: str  # text on the first difference beyond the tolerance; empty if there is none


def replay(
    path: Path,
    policy: Policy,
    tolerance: float = 0.0,
    others: Sequence[Policy] = (),
    get_up: Policy | None = None,
) -> Replay:
    """Give a policy the inputs in a log, and compare its decisions with those in the log.

    Args:
        path: the log.
        policy: policy to run, usually that of the log.
        tolerance: smaller differences are not reported.
        others: further policies of the run.
        get_up: get-up policy of the run; None for none.

    Raises:
        UserError: the log cannot be read, has no policy steps, or is from another robot; or the tolerance is
            negative or not finite.
    """
    if not 0.0 <= tolerance < math.inf:
        raise UserError(f"tolerance is {tolerance:g}: it must be finite and not negative")
    log = read_log(path, (INPUTS, DECISIONS, CHANGES))
    joints = log.joints
    policies = Handover((policy, *others), _config(log), get_up)
    all_policies = [policy, *others, *([] if get_up is None else [get_up])]
    scan = common_height_scan([each.contract for each in all_policies])
    points = 0 if scan is None else scan.size
    changes = _changes(log)
    worst, first, steps = 0.0, "", 0
    for index, (inputs_entry, decision) in enumerate(_steps(log)):
        inputs = _inputs(log, inputs_entry, points)
        logged = _numbers(log, decision)
        if len(logged) != 5 * len(joints):
            raise UserError(f"{path}: step {index} has {len(logged)} numbers for {len(joints)} joints")
        try:
            now_us = round(inputs.time_s * 1e6)
            while changes and changes[0][0] <= inputs_entry.time_ns:
                policies.apply(changes.popleft()[1], now_us)
            replayed = policies.step(now_us, inputs).ravel()
        except WrongSizeError:
            raise UserError(
                f"{path} is from a robot with {len(joints)} joints: the policy does not fit"
            ) from None
        except Exception as error:  # a policy may raise anything on a damaged log, or another policy's log
            raise UserError(f"{path}: the policy fails at step {index}: {in_one_line(error)}") from None
        steps += 1
        difference = _difference(replayed, logged)
        worst = max(worst, float(difference.max()))
        if not first and difference.max() > tolerance:
            field, joint = divmod(int(difference.argmax()), len(joints))
            first = (
                f"step {index} ({inputs.time_s:.3f} s): {JointCommand._fields[field]} of"
                f" {joints[joint]} was {logged[difference.argmax()]:.9g},"
                f" is {replayed[difference.argmax()]:.9g}"
            )
    if not steps:
        raise UserError(f"{path} has no policy steps: the run ended before the robot walked")
    return Replay(steps, log.complete, log.damaged, worst, first)


def _steps(log: LogFile) -> list[tuple[Entry, Entry]]:
    """Inputs and decisions, paired by time; the last input may have no decision."""
    decided = {entry.time_ns: entry for entry in log.entries if entry.topic == DECISIONS}
    inputs = [entry for entry in log.entries if entry.topic == INPUTS]
    return [(entry, decided[entry.time_ns]) for entry in inputs if entry.time_ns in decided]


def _changes(log: LogFile) -> deque[tuple[int, Change]]:
    """Changes of the run with their times, ns."""
    try:
        return deque(
            (entry.time_ns, Change.from_json(entry.message.data))
            for entry in log.entries
            if entry.topic == CHANGES
        )
    except (AttributeError, ValueError) as error:
        raise UserError(f"{log.path}: {error}") from None


def _config(log: LogFile) -> HandoverConfig:
    """Settings of handovers in the run."""
    settings = log.metadata.get(HANDOVER)
    return HandoverConfig() if settings is None else structure(settings, HandoverConfig, str(log.path))


def _inputs(log: LogFile, inputs_entry: Entry, scan_points: int) -> PolicyInput:
    try:
        return unflatten(_numbers(log, inputs_entry), len(log.joints), scan_points, log.foot_sensors)
    except ValueError as error:
        raise UserError(f"{log.path}: {error}") from None


def _numbers(log: LogFile, entry: Entry) -> np.ndarray:
    """Numbers of a message; raises UserError if it has none, because a log may declare any type."""
    try:
        return np.array(entry.message.data, dtype=float).reshape(-1)
    except (AttributeError, TypeError, ValueError):
        raise UserError(f"{log.path}: {entry.topic} has no numbers at {entry.time_ns} ns") from None


def _difference(replayed: np.ndarray, logged: np.ndarray) -> np.ndarray:
    """Absolute differences of numbers; infinite if only one of the two is NaN."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(replayed - logged)
    same = (replayed == logged) | (np.isnan(replayed) & np.isnan(logged))
    return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))
