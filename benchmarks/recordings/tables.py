"""Tables and plots of benchmarks on recordings."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

MAX_DRAWN = 12  # plotted windows of each recording


def interval(values: Sequence[float]) -> tuple[float, float]:
    """2.5 and 97.5 % quantiles of values; NaN without values."""
    if not values:
        return float("nan"), float("nan")
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def plot_windows(
    path: Path,
    measured: np.ndarray,
    errors: np.ndarray,
    recording: np.ndarray,
    names: Sequence[str],
    channels: Sequence[str],
) -> None:
    """Plot measured and simulated motion in some windows of each recording, one recording below the other.

    Args:
        path: PNG to write.
        measured: (W, R, c).
        errors: simulated minus measured, (W, R, c).
        recording: recording of each window, (W,).
        names: names of the recordings.
        channels: names of the c columns.
    """
    import matplotlib.pyplot as plt

    recordings = np.unique(recording)
    figure, axes = plt.subplots(
        len(recordings), len(channels), figsize=(7 * len(channels), 2.2 * len(recordings)), squeeze=False
    )
    length = measured.shape[1]
    for row, each in enumerate(recordings):
        chosen = np.flatnonzero(recording == each)
        chosen = chosen[:: max(1, len(chosen) // MAX_DRAWN)]
        for column, channel in enumerate(channels):
            axis = axes[row, column]
            for index, window in enumerate(chosen):
                at = index + np.arange(length) / length
                truth = measured[window, :, column]
                axis.plot(at, truth, "k", linewidth=1.6)
                axis.plot(at, truth + errors[window, :, column], "C1", linewidth=0.9)
            axis.set_ylabel(channel, fontsize=8)
            axis.set_title(f"{names[row]}: measured (black), simulated and held out (orange)", fontsize=8)
            axis.set_xlabel("window", fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=70)
    plt.close(figure)
