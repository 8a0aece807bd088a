"""The display of a training: a live table on a terminal, plain lines elsewhere."""

import time
from contextlib import suppress
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

PLAIN_INTERVAL_S = 5.0
TABLE_WIDTH = 80
OTHER_LINES = 5  # terminal lines for the progress, the headings and the last messages
LOG_ONLY = ("learning/policy_dist_",)  # prefixes of metrics that the terminal does not show
SUMMARY = {
    "reward/total": "reward {:.2f}",
    "episode/length_s": "episode {:.1f} s",
    "tracking/linear_error_m_s": "error {:.3f} m/s",
    "tracking/yaw_error_rad_s": "{:.3f} rad/s",
}


class Display:
    """Shows progress; a context manager."""

    def __init__(self, total_steps: int, console: Console | None = None) -> None:
        self._console = console or Console()
        self._total = total_steps
        self._is_terminal = self._console.is_terminal
        self._progress = Progress(
            TextColumn("{task.description}"), BarColumn(20), TextColumn("{task.percentage:>3.0f} %"),
            TimeElapsedColumn(), TextColumn("elapsed,"), TimeRemainingColumn(), TextColumn("left"),
            console=self._console,
        )  # fmt: skip
        self._task = self._progress.add_task("starting", total=total_steps)
        self._screen = Live(self._progress, console=self._console, refresh_per_second=4)
        self._printed = 0.0

    def __enter__(self) -> "Display":
        if self._is_terminal:
            self._screen.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._is_terminal:
            self._screen.__exit__(kind, error, trace)

    def report(self, text: str) -> None:
        """Show one line above the live table; an output that fails does not end the training."""
        with suppress(OSError, SystemExit):  # a full disk; a closed pipe, for which rich raises SystemExit
            self._console.print(text, highlight=False, soft_wrap=True)

    def show_stage(self, stage: str) -> None:
        """Show a stage before the first iteration, such as "compiling"."""
        self._progress.update(self._task, description=stage)
        if not self._is_terminal:
            self.report(stage)

    def update(self, steps: int, steps_per_s: float, metrics: dict[str, float]) -> None:
        """Show the metrics of an iteration, and the progress after it."""
        progress = f"{min(steps, self._total):,} of {self._total:,} steps, {steps_per_s:,.0f} per s"
        self._progress.update(self._task, completed=min(steps, self._total), description="training")
        now = time.monotonic()
        is_last = steps >= self._total
        if self._is_terminal:
            free_lines = self._console.height - OTHER_LINES
            self._screen.update(Group(self._progress, Text(progress), metrics_table(metrics, free_lines)))
        elif now - self._printed > PLAIN_INTERVAL_S or is_last:
            self._printed = now
            remaining_s = max(self._total - steps, 0) / max(steps_per_s, 1.0)
            self.report(f"{progress}, {remaining_s:.0f} s left, {_summary(metrics)}")


def _summary(metrics: dict[str, float]) -> str:
    """The available metrics of `SUMMARY`, in one line."""
    return ", ".join(text.format(metrics[name]) for name, text in SUMMARY.items() if name in metrics)


def _short(value: float) -> str:
    return f"{value:.1e}" if 0.0 < abs(value) < 0.01 else f"{value:.3f}"


def metrics_table(metrics: dict[str, float], rows: int) -> Table:
    """Rewards on the left, their total first; on the right tracking, episodes and learning.

    Args:
        metrics: metrics by name, GROUP/NAME.
        rows: most rows to show; the log has the others.
    """
    visible = {name: value for name, value in metrics.items() if not name.startswith(LOG_ONLY)}
    rewards = sorted((n for n in visible if n.startswith("reward/")), key=lambda n: (n != "reward/total", n))
    groups = ("tracking/", "episode/", "learning/")
    others = [name for group in groups for name in sorted(visible) if name.startswith(group)]
    table = Table.grid(padding=(0, 2), expand=False)
    table.width = TABLE_WIDTH
    for justify in ("left", "right", "left", "right"):
        table.add_column(justify=justify, no_wrap=True)
    for row in range(min(max(len(rewards), len(others)), max(rows, 1))):
        cells = [
            text
            for names in (rewards, others)
            for text in ((names[row], _short(visible[names[row]])) if row < len(names) else ("", ""))
        ]
        table.add_row(*cells)
    return table
