"""Freshness of commands: refuses those that a stalled network delivers late."""

import random
import time
from collections import deque
from collections.abc import Callable
from typing import Any

MAX_ANSWER_S = 0.5  # between a challenge and the command that answers it


class Freshness:
    """Challenges to one page, and the commands that answer them.

    A command must repeat a challenge that the page received within the last half second, and have a higher
    number than the previous command. So late, repeated and overtaken commands are refused.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """`clock` returns local time, s."""
        self._clock = clock
        self._challenges: deque[tuple[int, float]] = deque(maxlen=64)  # challenges and their times
        self._last = -1
        self.round_trip_s = 0.0  # of the latest answered challenge

    def challenge(self) -> int:
        """A new challenge."""
        number = random.getrandbits(48)  # not secret: only this connection sees it
        self._challenges.append((number, self._clock()))
        return number

    def refusal(self, number: Any, answer: Any) -> str:
        """Why a command is refused; empty if it is not.

        Args:
            number: number of the command.
            answer: the challenge that it repeats.
        """
        if type(number) is not int or type(answer) is not int:
            return "a command has a number and an answer"
        if number <= self._last:
            return "an old command is refused"
        sent_s = next((at_s for challenge, at_s in self._challenges if challenge == answer), None)
        if sent_s is None:
            return "a command with a wrong answer is refused"
        age_s = self._clock() - sent_s
        if age_s > MAX_ANSWER_S:
            return f"a command that is {age_s:.1f} s old is refused"
        self._last, self.round_trip_s = number, age_s
        return ""
