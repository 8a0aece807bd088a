"""The speed of a training."""

from collections import deque

WINDOW_S = 5.0


class Speed:
    """Environment steps per second over the last seconds, because a device reports its steps in bursts."""

    def __init__(self, now_s: float, steps: int) -> None:
        self._seen = deque([(now_s, steps)])

    def after(self, now_s: float, steps: int) -> float:
        """The speed at time `now_s`, with `steps` environment steps done in all."""
        self._seen.append((now_s, steps))
        while now_s - self._seen[1][0] >= WINDOW_S:
            self._seen.popleft()
        then_s, before = self._seen[0]
        return (steps - before) / max(now_s - then_s, 1e-9)
