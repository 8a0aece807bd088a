"""What a user sees of a training: a live table on a terminal, plain lines elsewhere."""

import time
from types import TracebackType

from rich.console import Console, Group
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

PLAIN_INTERVAL_S = 5.0


class Display:
    """Shows progress; a context manager."""

    def __init__(self, total_steps: int, console: Console | None = None) -> None:
        self._console = console or Console()
        self._total = total_steps
        self._live = self._console.is_terminal
        self._progress = Progress(
            TextColumn("{task.fields[steps]}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
            TimeRemainingColumn(), console=self._console,
        )  # fmt: skip
        self._task = self._progress.add_task("training", total=total_steps, steps="")
        self._screen = Live(self._progress, console=self._console, refresh_per_second=4)
        self._printed = 0.0

    def __enter__(self) -> "Display":
        if self._live:
            self._screen.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live:
            self._screen.__exit__(kind, error, trace)

    def say(self, text: str) -> None:
        """One line above the live table."""
        self._console.print(text, highlight=False, soft_wrap=True)

    def update(self, steps: int, steps_per_s: float, metrics: dict[str, float]) -> None:
        """Show the state after an iteration."""
        done = f"{min(steps, self._total):,} of {self._total:,} steps, {steps_per_s:,.0f} per s"
        self._progress.update(self._task, completed=min(steps, self._total), steps=done)
        now = time.monotonic()
        last = steps >= self._total
        if self._live:
            self._screen.update(Group(self._progress, _table(metrics)))
        elif now - self._printed > PLAIN_INTERVAL_S or last:
            self._printed = now
            left = max(self._total - steps, 0) / max(steps_per_s, 1.0)
            self.say(f"{done}, {left:.0f} s left, {_summary(metrics)}")


def _summary(metrics: dict[str, float]) -> str:
    return (
        f"reward {metrics['reward/total']:.2f}, episode {metrics['episode/length_s']:.1f} s,"
        f" error {metrics['tracking/linear_error_m_s']:.3f} m/s"
        f" {metrics['tracking/yaw_error_rad_s']:.3f} rad/s"
    )


def _table(metrics: dict[str, float]) -> Table:
    """Metrics in one column per group (reward, tracking, episode, learning)."""
    groups: dict[str, list[str]] = {}
    for name, value in sorted(metrics.items()):
        group, _, short = name.partition("/")
        groups.setdefault(group, []).append(f"{short:<24}{value:>9.3f}")
    table = Table(*groups, box=None, padding=(0, 2))
    for row in range(max(len(lines) for lines in groups.values())):
        table.add_row(*(lines[row] if row < len(lines) else "" for lines in groups.values()))
    return table
