"""Swing feet: from lift-off to their footholds, relative to the moving base."""

import math

import numpy as np

from footfall.common.rotations import cross, heading_matrix, roll_pitch_yaw
from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.catch import catching_foothold
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.footholds import foothold
from footfall.policies.controllers.mpc.swing import swing_motion
from footfall.policies.controllers.mpc.wrenches import Wrenches
from footfall.robots.kinematics import LegPose

_NO_SWING = np.empty((0, 3, 3))


class SwingFeet:
    """Start and end of each foot's swing.

    Args:
        config: settings of the controller.
        positions: (feet, 3) m, nominal positions of the feet, base frame.
        foot_radius: (feet,) m.
        centre: (3,) m, centre of mass in the base's frame.
    """

    def __init__(
        self, config: MpcConfig, positions: np.ndarray, foot_radius: np.ndarray, centre: np.ndarray
    ) -> None:
        self._swing, self._foothold, self._catch = config.swing, config.foothold, config.foothold.catch
        self.positions, self._centre = positions, centre
        self._positions_xy = (positions[:, 0] + 1j * positions[:, 1]).tolist()
        self._touch_down = np.zeros((len(positions), 3))  # centre of each foot above the ground at touch-down
        self._touch_down[:, 2] = foot_radius - config.swing.depth_m
        self.height_m = config.swing.height_m
        self.shift = 0j  # m, shift of all nominal positions, heading frame, x + i y
        self.reset()

    def reset(self) -> None:
        """Start a new episode."""
        count = len(self.positions)
        self.lift_off = np.zeros((count, 3))  # m, world
        self.target = np.zeros((count, 3))  # m, world, on the ground
        self._last_motion: tuple[list[int], Base | None] = [], None  # feet in swing, and the base

    @property
    def shifted_positions(self) -> np.ndarray:
        """Positions of the feet in a steady stance, (feet, 3) m, heading frame."""
        return self.positions + np.array([self.shift.real, self.shift.imag, 0.0])

    def aim(
        self,
        leg: int,
        progress: float,
        base: Base,
        pose: LegPose,
        wrenches: Wrenches,
        desired: complex,
        yaw_rate: float,
        gait: GaitTiming,
    ) -> None:
        """Set the foothold of a leg.

        Args:
            leg: index of the leg.
            progress: elapsed share of the swing, in [0, 1].
            base: state of the base.
            pose: kinematics of the legs.
            wrenches: planned wrenches of the feet, world.
            desired: velocity of the reference, m/s, world, x + i y.
            yaw_rate: commanded yaw rate, rad/s.
            gait: timing of the gait.
        """
        remaining_s = (1.0 - progress) * gait.swing_s
        if self._catch is None:
            target = foothold(
                self._positions_xy[leg] + self.shift,
                base.xy,
                base.height,
                base.speed,
                desired,
                base.yaw,
                yaw_rate,
                remaining_s,
                gait.stance_s,
                self._foothold,
            )
        else:
            target = catching_foothold(
                base,
                self._centre,
                pose.foot[1 - leg],
                wrenches.pressure(1 - leg),
                math.copysign(1.0, self.positions[leg, 1]),
                desired,
                yaw_rate,
                remaining_s,
                gait,
                self._catch,
            )
        self.target[leg, 0], self.target[leg, 1] = target.real, target.imag

    def footholds(self, axes: np.ndarray) -> np.ndarray:
        """Footholds of swing feet relative to the base, heading frame, (feet, 3) m; NaN for stance feet.

        Args:
            axes: (3, 3) rotation from the ground's axes to the world (`Slope.axes`).
        """
        positions = np.full_like(self.target, np.nan)
        swinging, base = self._last_motion
        if base is not None:
            yaw = roll_pitch_yaw(axes @ base.rotation)[2]
            positions[swinging] = (self.target[swinging] - base.position) @ axes.T @ heading_matrix(yaw)
        return positions

    def motion(self, swinging: list[int], progress: list[float], base: Base, swing_s: float) -> np.ndarray:
        """Motion of swing feet relative to the moving base, (k, 3, 3): see `LegControl.command`."""
        self._last_motion = swinging, base
        if not swinging:
            return _NO_SWING
        lift_off, landing = self.lift_off.tolist(), (self.target + self._touch_down).tolist()
        motion = np.array(
            [
                swing_motion(progress[leg], lift_off[leg], landing[leg], swing_s, self.height_m)
                for leg in swinging
            ]
        )
        position = [base.xy.real, base.xy.imag, base.height]
        motion -= np.array([position, base.velocity.tolist(), [0.0, 0.0, 0.0]])
        motion = motion.reshape(-1, 3).dot(base.rotation).reshape(-1, 3, 3)
        motion[:, 1] -= cross(base.gyro, motion[:, 0])
        return motion
