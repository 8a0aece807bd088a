"""Sections of a recording that are simulated separately, each from its own start."""

from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.identify.recording import Recording

MARGIN_S = 0.05  # time of commands before a window: the longest delay
SETTLED_S = 0.01  # time at a window's start whose readings are not used: earlier torque still has an effect
MIN_READING_SHARE = 0.9  # of the usual number of readings: a window with a longer gap is skipped
FIT_POINTS = 5  # number of readings on either side for estimating a start


class Windows(NamedTuple):
    """W windows of the same length: commands on the physics grid, readings at their own times."""

    command: np.ndarray  # (margin + S, W, 5, n) in effect from each physics step on, before delays
    margin: int  # number of physics steps before the windows' starts
    step_s: float
    time_s: np.ndarray  # (W, R, n) times of the readings, since the start of the window
    position: np.ndarray  # (W, R, n) rad
    torque: np.ndarray  # (W, R, n) N m; NaN where motors report none
    start: np.ndarray  # (W, 2, n) estimated position and velocity as read
    acceleration: np.ndarray  # (W, n) estimated at the start, rad/s^2
    source: np.ndarray  # (W,) index of each window's recording

    @property
    def width(self) -> int:
        """Number of windows."""
        return self.command.shape[1]

    def take(self, chosen: np.ndarray) -> "Windows":
        """A subset of the windows."""
        return self._replace(
            command=self.command[:, chosen],
            time_s=self.time_s[chosen],
            position=self.position[chosen],
            torque=self.torque[chosen],
            start=self.start[chosen],
            acceleration=self.acceleration[chosen],
            source=self.source[chosen],
        )


def joined(parts: list[Windows]) -> Windows:
    """Windows of several recordings, cut to the smallest number of readings per window."""
    rows = min(part.time_s.shape[1] for part in parts)
    return parts[0]._replace(
        command=np.concatenate([part.command for part in parts], axis=1),
        time_s=np.concatenate([part.time_s[:, :rows] for part in parts]),
        position=np.concatenate([part.position[:, :rows] for part in parts]),
        torque=np.concatenate([part.torque[:, :rows] for part in parts]),
        start=np.concatenate([part.start for part in parts]),
        acceleration=np.concatenate([part.acceleration for part in parts]),
        source=np.concatenate([np.full(part.width, number) for number, part in enumerate(parts)]),
    )


def first_window_s(recording: Recording) -> float:
    """Start of a recording's first window."""
    return float(recording.time_s[0] + MARGIN_S + FIT_POINTS * recording.period_s)


def cut(
    recording: Recording, joints: np.ndarray, length_s: float, step_s: float, max_hz: float = 250.0
) -> Windows:
    """Consecutive windows of a recording, without windows in which readings are missing.

    Args:
        recording: recording of the whole robot.
        joints: indices of a leg's joints in the recording.
        length_s: length of a window.
        step_s: physics time step.
        max_hz: maximum rate of readings; further ones are left out.

    Raises:
        UserError: the recording is shorter than one window.
    """
    begin = first_window_s(recording)
    end = recording.time_s[-1] - FIT_POINTS * recording.period_s
    count = int((end - begin) / length_s)
    if count < 1:
        raise UserError(
            f"{recording.source} has {end - begin:.1f} s of motion: a window takes {length_s:g} s"
        )
    margin, steps = round(MARGIN_S / step_s), round(length_s / step_s)
    stride = max(1, round(1.0 / (max_hz * recording.period_s)))
    arrival_s = recording.read_s[:, joints].min(axis=1)
    starts = begin + length_s * np.arange(count)
    start_rows, first_rows, end_rows = (
        np.searchsorted(arrival_s, starts + offset + 1e-9) for offset in (0.0, SETTLED_S, length_s)
    )
    complete = end_rows - first_rows >= MIN_READING_SHARE * np.median(end_rows - first_rows)
    rows = int((end_rows - first_rows)[complete].min()) // stride
    if not rows:
        raise UserError(f"{recording.source} has hardly any readings in windows of {length_s:g} s")
    parts: dict[str, list[np.ndarray]] = {
        name: [] for name in ("command", "time", "position", "torque", "start")
    }
    for window in np.flatnonzero(complete):
        start_s = starts[window]
        grid = start_s + step_s * np.arange(-margin, steps)
        active = np.searchsorted(recording.time_s, grid + 1e-9, side="right") - 1
        parts["command"].append(recording.command[active.clip(0)][:, :, joints])
        chosen = first_rows[window] + stride * np.arange(rows)
        parts["time"].append(recording.read_s[chosen][:, joints] - start_s)
        parts["position"].append(recording.position[chosen][:, joints])
        parts["torque"].append(recording.torque[chosen][:, joints])
        parts["start"].append(_start(recording, joints, int(start_rows[window]), start_s))
    return Windows(
        np.stack(parts["command"], axis=1),
        margin,
        step_s,
        np.stack(parts["time"]),
        np.stack(parts["position"]),
        np.stack(parts["torque"]),
        np.stack(parts["start"])[:, :2],
        2.0 * np.stack(parts["start"])[:, 2],
        np.zeros(int(complete.sum()), int),
    )


def _start(recording: Recording, joints: np.ndarray, row: int, start_s: float) -> np.ndarray:
    """Fit a parabola to the readings around a time: its coefficients there, (3, n)."""
    around = slice(max(row - FIT_POINTS, 0), row + FIT_POINTS)
    coefficients = []
    for joint in joints:
        time_s = recording.read_s[around, joint] - start_s
        curve = np.polynomial.polynomial.polyfit(time_s, recording.position[around, joint], 2)
        coefficients.append(curve)
    return np.array(coefficients).T
