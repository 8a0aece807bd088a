"""The wiring check of a run: motions, recording, verdict; in the initial pose, and again when standing."""

import math
import threading
from collections.abc import Callable, Sequence

import numpy as np

from footfall.common.rotations import rotation_matrix
from footfall.deploy.clearance import Clearance
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.levelling import on_two_soles
from footfall.deploy.signals import WiringSignals
from footfall.deploy.wiring import Wiring
from footfall.deploy.wiring_check.config import WiringCheckConfig
from footfall.deploy.wiring_check.motions import Motions
from footfall.deploy.wiring_check.prediction import Prediction
from footfall.deploy.wiring_check.verdict import Recorded, Verdict, judge
from footfall.policies.policy import Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

RECORD_EVERY = 2  # ticks


class WiringCheck:
    """Moves one joint after the other, with the gains for standing, and compares the robot with its model.

    A robot that lies at first is checked again after standing up, since some joints are unloaded while it
    lies.
    """

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        driver: Driver,
        config: DeployConfig,
        on_passed: Callable[[Sequence[Verdict]], None],
        in_background: bool,
        check: WiringCheckConfig | None = None,
    ) -> None:
        """Create a check; `begin` starts it.

        Args:
            robot: the robot.
            wiring: its wiring.
            driver: driver of its motors, which may limit the gains.
            config: settings of the loop.
            on_passed: called with all verdicts if the wiring is right.
            in_background: whether the verdict is computed in a thread while the loop continues.
            check: motions and limits.
        """
        self._robot, self._wiring, self._check = robot, wiring, check or WiringCheckConfig()
        self._highest = driver.highest
        stiffness = self._check.soles_stiffness if on_two_soles(robot.legs) else 1.0
        gains = [  # the same damping ratio for each stiffness
            stiffness * config.stand_kp_scale * robot.kp,
            math.sqrt(stiffness) * config.stand_kd_scale * robot.kd,
        ]
        self._base_gains = np.minimum(gains, self._highest[2:4])
        self._gains = config.scale * self._base_gains  # as sent: the joint layer scales commands
        self._clearance, self._sunk = Clearance(robot), config.safety.sensors.sunk
        self._on_passed, self._in_background = on_passed, in_background
        self._motor_lag_s = self._check.motor_lag_s + self._check.motor_lag_ticks * config.tick_us * 1e-6
        self._zeros = np.zeros(len(robot.joint_names))
        self._thread: threading.Thread | None = None
        self.verdicts: list[Verdict] = []
        self.signals = WiringSignals(due=True)

    def begin(self, centre: np.ndarray, sensed: Sensed) -> None:
        """Start the motions about these joint positions, rad, (n,).

        A robot that has stood up uses its measured positions instead: friction holds its feet away from their
        targets, and legs that press against each other slip.
        """
        check, again = self._check, bool(self.verdicts)
        centre = sensed.joint_position.copy() if again else centre
        lies = not again and self._clearance.sunk_share(centre, sensed.quaternion) >= self._sunk
        lower, upper = self._robot.soft_limits
        margin = np.minimum(centre - lower, upper - centre).clip(check.min_rad, None)
        amplitude = np.minimum(margin, check.lying_rad if lies else check.standing_rad)
        self._centre, self._motions = centre, Motions(amplitude, check)
        self._samples: list[tuple[float, np.ndarray]] = []
        self._first_up, self._ticks = _up(sensed), 0
        self.signals = WiringSignals(due=lies, stood=again)

    def command(self, time_s: float) -> JointCommand:
        """The joint command at a time since the start of the check, s."""
        target = self._centre + self._motions.offsets(time_s)
        kp, kd = self._base_gains
        return JointCommand(target, self._zeros, kp, kd, self._zeros)

    def update(self, time_s: float, sensed: Sensed) -> None:
        """Record the readings of a tick."""
        if self._thread is not None or self.signals.done or self.signals.fault:
            return
        self._ticks += 1
        if self._ticks % RECORD_EVERY == 0:
            self._record(time_s, sensed)
        if time_s < self._motions.duration_s:
            return
        if self._in_background:
            self._thread = threading.Thread(target=self._judge, name="wiring", daemon=True)
            self._thread.start()
        else:
            self._judge()

    def _record(self, time_s: float, sensed: Sensed) -> None:
        up = _up(sensed)
        self._samples.append((time_s, np.concatenate((sensed.joint_position, sensed.joint_torque, up))))
        turn = float(np.linalg.norm(up - self._first_up))
        error = np.abs(self._centre + self._motions.offsets(time_s) - sensed.joint_position)
        moving = self._motions.joint_at(time_s)
        if turn > self._check.lean_rad:
            moved = self._wiring.label(moving)
            self._fail(f"the base turned by {turn:.2f} rad during a small motion of {moved}")
        elif error.max() > self._check.lost_rad:
            joint = int(error.argmax())
            label, moved = self._wiring.label(joint), self._wiring.label(moving)
            self._fail(f"{label} is {error[joint]:.2f} rad off its target while {moved} moved")

    def _fail(self, what: str) -> None:
        remedy = "check the plug, id, direction and gear ratio of each motor named here"
        self.signals = self.signals._replace(fault=f"wiring: {what}: {remedy}")

    def _judge(self) -> None:
        """Compute the verdict; runs in a separate thread if the loop must not wait."""
        try:
            times, values = zip(*self._samples, strict=True)
            n = len(self._centre)
            position, torque, up = np.split(np.array(values), [n, 2 * n], axis=1)
            recorded = Recorded(np.array(times), position, torque, up, self._motor_lag_s)
            kp, kd = self._gains
            prediction = Prediction(self._robot, kp, kd, self._highest)
            verdict = judge(
                recorded,
                self._motions,
                self._centre,
                prediction,
                self._wiring,
                self._robot.foot_joints,
                self._check,
            )
            fault = f"wiring: {verdict.fault}" if verdict.fault else ""
            self.verdicts.append(verdict)
            if not (fault or self.signals.due):
                self._on_passed(self.verdicts)
        except Exception as error:  # an exception in a thread would be lost
            fault = f"wiring: the check failed: {type(error).__name__}: {error}"
        self._thread = None
        self.signals = self.signals._replace(done=not fault, fault=fault)


def _up(sensed: Sensed) -> np.ndarray:
    """World's z axis in the base frame, (3,)."""
    up: np.ndarray = rotation_matrix(sensed.quaternion)[2]
    return up
