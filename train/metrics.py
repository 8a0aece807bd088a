"""Metrics of a run: TensorBoard events, and the same numbers as lines of JSON."""

import json
from pathlib import Path

from tensorboardX import SummaryWriter


class MetricsLog:
    """Writes scalars; a resumed run drops what it will compute again."""

    def __init__(self, folder: Path, first_step: int) -> None:
        self._lines = folder / "metrics.jsonl"
        self._keep_before(first_step)
        self._file = self._lines.open("a", encoding="utf-8")
        self._events = SummaryWriter(str(folder / "events"), purge_step=first_step or None)

    def write(self, step: int, metrics: dict[str, float]) -> None:
        """Record the scalars of one iteration, which ended at environment step `step`."""
        self._file.write(json.dumps({"step": step, **metrics}) + "\n")
        self._file.flush()
        for name, value in metrics.items():
            self._events.add_scalar(name, value, step)

    def close(self) -> None:
        self._file.close()
        self._events.close()

    def _keep_before(self, first_step: int) -> None:
        if not self._lines.exists():
            return
        kept = []
        for line in self._lines.read_text(encoding="utf-8").splitlines():
            try:
                if json.loads(line)["step"] <= first_step:
                    kept.append(line)
            except (json.JSONDecodeError, KeyError):
                continue  # the line that a killed process was writing
        self._lines.write_text("".join(line + "\n" for line in kept), encoding="utf-8")
