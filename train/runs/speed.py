"""The speed of a training."""

from collections import deque

WINDOW_S = 5.0


class Speed:
    """Environment steps per second over the last seconds, because a device reports its steps in bursts."""

    def __init__(self, now_s: float, steps: int) -> None:
        self._reports = deque([(now_s, steps)])  # time and steps, oldest first

    def after(self, now_s: float, steps: int) -> float:
        """The speed at time `now_s`, with `steps` environment steps done in all."""
        self._reports.append((now_s, steps))
        while now_s - self._reports[1][0] >= WINDOW_S:
            self._reports.popleft()
        start_s, start_steps = self._reports[0]
        return (steps - start_steps) / max(now_s - start_s, 1e-9)
