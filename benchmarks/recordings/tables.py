"""What benchmarks on recordings print and draw."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footfall.identify.shooting import Shooting

MOST_DRAWN = 12  # windows of each recording


def interval(values: Sequence[float]) -> tuple[float, float]:
    """2.5 and 97.5 % of values; NaN without any."""
    if not values:
        return float("nan"), float("nan")
    low, high = np.percentile(values, (2.5, 97.5))
    return float(low), float(high)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def plot_windows(
    path: Path, windows: Shooting, errors: np.ndarray, names: Sequence[str], channels: Sequence[str]
) -> None:
    """Draw measured and simulated motion, the first windows of each recording, one below the other."""
    import matplotlib.pyplot as plt

    recordings = windows.recordings
    figure, axes = plt.subplots(
        len(recordings), len(channels), figsize=(7 * len(channels), 2.2 * len(recordings)), squeeze=False
    )
    length = windows.measured.shape[1]
    for row, recording in enumerate(recordings):
        chosen = np.flatnonzero(windows.recording == recording)
        chosen = chosen[:: max(1, len(chosen) // MOST_DRAWN)]
        for column, channel in enumerate(channels):
            axis = axes[row, column]
            for place, window in enumerate(chosen):
                at = place + np.arange(length) / length
                measured = windows.measured[window, :, column]
                axis.plot(at, measured, "k", linewidth=1.6)
                axis.plot(at, measured + errors[window, :, column], "C1", linewidth=0.9)
            axis.set_ylabel(channel, fontsize=8)
            axis.set_title(f"{names[row]}: measured (black), simulated and held out (orange)", fontsize=8)
            axis.set_xlabel("window", fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=70)
    plt.close(figure)
