"""How a run ends on request: stop, lie down, damping, motors off."""

from footfall.deploy.modes import DAMPED, Mode
from footfall.deploy.signals import EndSignals

TAKEN_OVER = "the loop did not come back in time: a guard damped the robot and switched its motors off"
CUT_SHORT = (Mode.STOPPING, Mode.LOWERING)  # modes in which asking again ends the run at once


class RunEnd:
    """Whether the end was requested, and whether lying down is skipped."""

    def __init__(self, may_lie: bool, stop_s: float, caught: bool) -> None:
        """The end has not been requested.

        Args:
            may_lie: whether the robot can lie down, and may.
            stop_s: time that a policy has to stop.
            caught: whether somebody takes hold of it while it steps in place.
        """
        self._may_lie, self._stop_s, self._caught = may_lie, stop_s, caught
        self._finish = False
        self._skip_lie_down = False

    @property
    def asked(self) -> bool:
        """Whether the end was requested."""
        return self._finish

    def finish(self, mode: Mode, skip_lie_down: bool) -> None:
        """Ask for the end in this mode of the loop."""
        self._skip_lie_down |= skip_lie_down or mode in CUT_SHORT
        self._finish = True

    def heed(self, lie_down: bool, mode: Mode) -> None:
        """Ask for the end, once, if the command source wants the robot to lie down."""
        if lie_down and not self._finish:
            self.finish(mode, skip_lie_down=False)

    def signals(self, mode: Mode, since_s: float) -> EndSignals:
        """The supervisor's part of it; `since_s` is the time since the mode began."""
        return EndSignals(
            self._finish and mode not in DAMPED,
            self._may_lie,
            self._caught,
            mode is Mode.STOPPING and since_s >= self._stop_s,
            self._skip_lie_down,
        )
