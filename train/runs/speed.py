"""How fast a training is."""

from collections import deque

WINDOW_S = 5.0


class Speed:
    """Environment steps per second over the last seconds: what a device has finished is told in bursts."""

    def __init__(self, now_s: float, steps: int) -> None:
        self._seen = deque([(now_s, steps)])

    def after(self, now_s: float, steps: int) -> float:
        """The speed, when so many steps have been done in all by this time."""
        self._seen.append((now_s, steps))
        while now_s - self._seen[1][0] >= WINDOW_S:
            self._seen.popleft()
        then_s, before = self._seen[0]
        return (steps - before) / max(now_s - then_s, 1e-9)
