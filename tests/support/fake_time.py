"""Clocks that a test sets."""


class FakeTime:
    """Nanoseconds that pass in sleep, and by hand."""

    def __init__(self) -> None:
        self.ns = 5_000_000_000
        self.slept: list[float] = []

    def monotonic_ns(self) -> int:
        return self.ns

    def monotonic(self) -> float:
        return self.ns * 1e-9

    def time(self) -> float:
        return 1.7e9 + self.ns * 1e-9

    def time_ns(self) -> int:
        return 1_700_000_000_000_000_000 + self.ns

    def sleep(self, seconds: float) -> None:
        if seconds < 1e-9:
            return
        self.slept.append(seconds)
        self.ns += round(seconds * 1e9) + 7000  # and ends 7 us late


class Watch:
    """Monotonic seconds that pass by hand."""

    now_s = 50.0

    def __call__(self) -> float:
        return self.now_s
