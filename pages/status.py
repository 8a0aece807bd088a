"""The status text of the page."""

from dataclasses import dataclass, field

import numpy as np

WAITING = "**waiting for the first checkpoint**"
QUIET_S = 120.0  # time without new metrics after which the training may have been stopped


@dataclass
class Status:
    """State of the training and of the walk."""

    title: str
    folder: str
    total_steps: int  # of the whole training
    steps_per_iteration: int
    finished: bool = False  # whether the final policy exists
    trained_steps: int = 0
    metrics_age_s: float | None = None  # None before the first metrics
    exporting: int | None = None  # iteration of the checkpoint that is being exported
    iteration: int | None = None  # of the walking policy
    policies: int = 0  # number of policies that have walked so far
    mode: str = ""
    episodes: int = 0
    falls: int = 0
    last_fall: str = ""
    walked_s: float = 0.0  # since the last start
    restart_s: float = 0.0  # time after which the next episode starts
    command: np.ndarray = field(default_factory=lambda: np.zeros(3))  # m/s, m/s, rad/s
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))  # in the same units, true and smoothed
    pace: float = 1.0  # simulated time over wall time
    problem: str = ""


def as_markdown(status: Status) -> str:
    """The status as a table, with a line if there is no policy yet."""
    rows = [("Training", _training(status))]
    if status.policies:
        falls = f"{status.falls} in {status.episodes} starts"
        rows += [("Policy", _policy(status))]
        if status.mode:  # from the first frame on
            walked = f"{status.walked_s:.0f} of {status.restart_s:g} s, then the next"
            rows += [
                ("Robot", f"{status.mode.lower()}, {status.pace:.2f} × real time"),
                ("Start", f"number {status.episodes}: {walked}"),
            ]
        rows += [
            ("Falls", f"{falls}: {status.last_fall}" if status.last_fall else falls),
            ("Forward", _velocity(status, 0, "m/s")),
            ("Left", _velocity(status, 1, "m/s")),
            ("Yaw", _velocity(status, 2, "rad/s")),
        ]
    table = "\n".join(f"| {name} | {text} |" for name, text in rows)
    notes = [f"Not usable: {status.problem}"] if status.problem else []
    if _is_quiet(status):
        notes.append(
            f"If the training was stopped, continue it with `footfall train --resume {status.folder}`"
        )
    waiting = [] if status.policies else [_waiting(status)]
    return "\n\n".join([f"**{status.title}**", *waiting, f"| | |\n| --- | --- |\n{table}", *notes])


def _waiting(status: Status) -> str:
    if status.exporting is None:
        return WAITING
    return f"**preparing the policy of iteration {status.exporting:,}**"


def _training(status: Status) -> str:
    if status.metrics_age_s is None:
        return "finished, without its metrics" if status.finished else "no metrics yet"
    if status.finished:
        return f"**finished** after {status.trained_steps:,} steps, {_age(status.metrics_age_s)} ago"
    share = min(status.trained_steps / status.total_steps, 1.0)
    progress = f"{status.trained_steps:,} of {status.total_steps:,} steps ({share:.0%})"
    return f"{progress}, nothing new for {_age(status.metrics_age_s)}" if _is_quiet(status) else progress


def _is_quiet(status: Status) -> bool:
    return not status.finished and status.metrics_age_s is not None and status.metrics_age_s > QUIET_S


def _age(seconds: float) -> str:
    """A duration in its largest fitting unit."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{max(seconds, 0.0):.0f} s"


def _policy(status: Status) -> str:
    if status.iteration is None:
        return "the run's policy.onnx"
    return f"of iteration {status.iteration:,}, {status.iteration * status.steps_per_iteration:,} steps"


def _velocity(status: Status, axis: int, unit: str) -> str:
    return f"{status.velocity[axis]:+.2f} of {status.command[axis]:+.2f} {unit}"
