"""End of a run on request: stop, lie down, damping, disabled motors."""

from footfall.deploy.modes import DAMPED, Mode
from footfall.deploy.signals import EndSignals

TAKEN_OVER = "the loop did not return in time: a guard damped the robot and disabled its motors"
CUT_SHORT = (Mode.STOPPING, Mode.LOWERING)  # modes in which a second request ends the run at once


class RunEnd:
    """Requested end of a run, and whether lying down is skipped."""

    def __init__(self, may_lie: bool, stop_s: float, caught: bool) -> None:
        """Start without a request.

        Args:
            may_lie: whether the robot can and may lie down.
            stop_s: time for the policy to stop.
            caught: whether a person takes hold of the robot while it steps in place.
        """
        self._may_lie, self._stop_s, self._caught = may_lie, stop_s, caught
        self._finish = False
        self._skip_lie_down = False

    @property
    def requested(self) -> bool:
        """Whether the end was requested."""
        return self._finish

    def finish(self, mode: Mode, skip_lie_down: bool) -> None:
        """Request the end in this mode of the loop."""
        self._skip_lie_down |= skip_lie_down or mode in CUT_SHORT
        self._finish = True

    def finish_if_requested(self, lie_down: bool, mode: Mode) -> None:
        """Request the end, once, if the command source requests that the robot lies down."""
        if lie_down and not self._finish:
            self.finish(mode, skip_lie_down=False)

    def signals(self, mode: Mode, since_s: float) -> EndSignals:
        """Signals on the end, for the supervisor; `since_s` is the time since the start of the mode."""
        return EndSignals(
            self._finish and mode not in DAMPED,
            self._may_lie,
            self._caught,
            mode is Mode.STOPPING and since_s >= self._stop_s,
            self._skip_lie_down,
        )
