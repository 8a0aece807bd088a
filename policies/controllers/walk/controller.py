"""The gait generator as a controller: any named gait, on any robot with suitable feet."""

from collections.abc import Mapping

import numpy as np

from footfall.common.rotations import vertical_in_body, yaw_of
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.slope import Slope, downhill
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.controllers.walk.ground import TouchDown, weight_torque
from footfall.policies.controllers.walk.joint_targets import JointTargets
from footfall.policies.controllers.walk.levelling import Levelling
from footfall.policies.controllers.walk.live import ATTITUDE, WalkSettings, applied, changed_step
from footfall.policies.controllers.walk.stepping import Stepping
from footfall.policies.live_settings import Applied, Span
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.rigid_body import nominal_body


class Walk:
    """Position control of all joints: stance feet move the body at the commanded velocity.

    `change` sets another gait or other steps while walking. `notes` has one line per gait whose command was
    reduced by limits.
    """

    needs_estimate = False
    contract = None

    def __init__(self, robot: Robot, name: str, config: WalkConfig | None = None) -> None:
        """`name` is the controller's name; its settings are the default."""
        self.name = name
        self._config = config = config or controller_settings(robot, name, WalkConfig)
        self.rate_hz, self._legs = config.rate_hz, robot.legs
        body, touch_down = nominal_body(robot), config.touch_down
        self._settings = WalkSettings(robot, config)
        self.gaits = self._settings.names
        self.stepping = Stepping(robot, config, self._settings, body.centre)
        self.notes = self.stepping.notes
        self._touch_down = None if touch_down is None else TouchDown(robot, body, touch_down)
        self._levelling, self._slope = Levelling(config.levelling), Slope(config.slope)
        self._joints = JointTargets(robot, config)

    def reset(self, inputs: PolicyInput) -> None:
        for part in (self.stepping, self._levelling, self._slope):
            part.reset()
        self._joints.begin(inputs.sensed.joint_position.copy())
        if self._touch_down is not None:
            self._touch_down.reset(inputs.sensed)

    def change(self, gait: GaitConfig | None = None, step: StrideConfig | None = None) -> None:
        """Set another gait or other steps, without a jump in a joint's target.

        A gait starts when all feet are in stance: feet in the air land first. A step's height applies from
        the next lift-off; its length and the body's height change gradually.

        Raises:
            UserError: the robot has no such gait.
        """
        if gait is not None:
            self._settings.request(gait)
        if step is not None:
            self.stepping.change_step(step)

    @property
    def live_settings(self) -> dict[str, Span]:
        """See `Steerable`."""
        return self._settings.spans

    @property
    def applied(self) -> Applied:
        """See `Steerable`."""
        period_s, attitude = self.stepping.cycle.timing.period_s, tuple(self._levelling.attitude.tolist())
        settings = self._settings
        return applied(settings.gait.name, period_s, settings.step, self.stepping.height_m, attitude)

    def set_live(self, values: Mapping[str, float]) -> None:
        """See `Steerable` and `change`. Period and attitude change gradually."""
        self.change(step=changed_step(self._settings.step, values))
        if "step_period_s" in values:
            self._settings.request_period(values["step_period_s"])
        named = zip(ATTITUDE, self._levelling.desired.tolist(), strict=True)
        self._levelling.desired = np.array([values.get(name, now) for name, now in named])

    def take_up(self, gait: str) -> None:
        """See `Steerable`. The gait starts with its own period."""
        self.change(self._settings.find(gait))

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, dt_s, stepping = self._config, 1.0 / self.rate_hz, self.stepping
        pose = self._legs.pose(inputs.sensed.joint_position)
        settled = inputs.time_s >= config.settle_s
        inputs = self._slope.follow(inputs, pose.foot, stepping.stance(), dt_s)
        sensed, yaw = inputs.sensed, yaw_of(inputs.sensed.quaternion.tolist())
        if settled:
            stepping.advance(inputs.command, yaw, dt_s)
        if self._touch_down is not None:
            force_shares = self._touch_down.sense(sensed, pose.jacobian, dt_s)
            if settled:
                normal = vertical_in_body(sensed.quaternion)
                self._touch_down.apply(stepping.cycle, force_shares, pose.foot, normal, dt_s)
        stepping.approach_height(dt_s)
        up = self._slope.up(yaw)
        feet = stepping.tips(downhill(up, stepping.height_m))
        tips = self._levelling.apply(feet, inputs, dt_s)
        weight = weight_torque(self._legs, pose.jacobian, ~stepping.cycle.swings, config.weight_n * up)
        return self._joints.command(tips, min(1.0, inputs.time_s / config.settle_s), weight)

    def stance(self) -> np.ndarray | None:
        return self.stepping.stance()

    def footholds(self) -> np.ndarray:
        return self.stepping.footholds()
