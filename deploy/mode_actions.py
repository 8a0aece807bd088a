"""Actions of the control loop in each mode: at its start, and the frames to send."""

from footfall.deploy.base_estimate import BaseEstimate
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.modes import COMMANDED, DAMPED, HELD, Mode
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.postures import MotionBefore, Postures
from footfall.deploy.safety import State
from footfall.deploy.signal_source import SignalSource
from footfall.deploy.wiring_check.check import WiringCheck
from footfall.policies.policy import Sensed


class ModeActions:
    """Runs the parts of a loop according to its mode."""

    def __init__(
        self,
        driver: Driver,
        joints: JointLayer,
        signals: SignalSource,
        estimate: BaseEstimate,
        postures: Postures,
        runner: PolicyRunner,
        wiring_check: WiringCheck | None,
        damping_kd: float,
    ) -> None:
        """Parts of one loop. `damping_kd`: N m s/rad, for a damped robot."""
        self._driver, self._damping_kd = driver, damping_kd
        self._joints, self._signals, self._estimate = joints, signals, estimate
        self._postures, self._runner, self._wiring_check = postures, runner, wiring_check
        self._unfolding = False  # after a fall, until the get-up policy starts

    def begin(self, before: State, state: State, now_us: int, sensed: Sensed) -> None:
        """Start the mode of `state` at this time, with these readings; the previous mode was a different
        one."""
        mode, was_recovering = state.mode, before.mode is Mode.RECOVERING
        if before.mode is Mode.IDLE and mode in HELD:
            self._joints.begin_at(sensed.joint_position)
            self._signals.begin_checks(now_us)
            self._estimate.reset(now_us, sensed)
        if mode is Mode.STANDING:
            from_measured = was_recovering or before.mode is Mode.IDLE
            start = sensed.joint_position if from_measured else self._joints.target
            self._postures.stand_up(start, sensed.quaternion)
            if was_recovering:
                self._estimate.stood_up(now_us, sensed)
        elif mode is Mode.CHECKING and self._wiring_check is not None:
            self._wiring_check.begin(self._joints.target, sensed)
        elif mode is Mode.LOWERING:
            self._postures.lie_down(self._joints.target, MotionBefore.of(before.mode, bool(state.faults)))
        elif mode is Mode.RECOVERING:
            self._joints.begin_at(sensed.joint_position)
            self._signals.begin_checks(now_us, again=True)
            self._estimate.invalidate()
            self._postures.unfold(sensed.joint_position)
            self._runner.decision, self._unfolding = None, True
        elif mode is Mode.WALKING and before.tries:
            self._runner.walk_on(now_us)
        elif mode is Mode.WALKING:
            self._runner.start(now_us)
            self._estimate.start()

    def let_decide(self, state: State, now_us: int) -> bool:
        """Switch to the get-up policy if it is due; returns whether a policy may decide.

        After a fall the get-up policy starts once the robot has unfolded.
        """
        if state.mode is not Mode.RECOVERING or not self._unfolding:
            return state.mode in COMMANDED
        if not self._postures.unfolded(now_us * 1e-6 - state.since_s):
            return False
        self._unfolding = False
        self._runner.get_up(now_us)
        return True

    def frames(self, state: State, now_us: int) -> Frames:
        """Frames for this tick: commands of the state's mode, or the end of the run."""
        if state.over:
            return self._driver.disable()
        mode, time_s = state.mode, now_us * 1e-6 - state.since_s
        decision = self._runner.decision
        if mode in COMMANDED and decision is not None:
            return self._joints.command(decision)
        if mode is Mode.CHECKING and self._wiring_check is not None:
            return self._joints.command(self._wiring_check.command(time_s))
        if mode in HELD:
            return self._joints.command(self._postures.command(time_s, self._joints.sensed()))
        if mode in DAMPED:
            return self._joints.damping(self._damping_kd)
        return self._driver.query_settings() if self._driver.not_ready() else self._driver.enable()
