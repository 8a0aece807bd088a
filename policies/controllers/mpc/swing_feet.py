"""Feet that swing: from where they lifted off to their footholds, as seen from the moving base."""

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
        config: of the controller.
        places: (feet, 3) m, below the hips, in the base's frame.
        foot_radius: (feet,) m.
        centre: (3,) m, centre of mass in the base's frame.
    """

    def __init__(
        self, config: MpcConfig, places: np.ndarray, foot_radius: np.ndarray, centre: np.ndarray
    ) -> None:
        self._swing, self._foothold, self._catch = config.swing, config.foothold, config.foothold.catch
        self.places, self._centre = places, centre
        self._ahead = (places[:, 0] + 1j * places[:, 1]).tolist()
        self._touch_down = np.zeros((len(places), 3))  # of the feet's centres, from the ground
        self._touch_down[:, 2] = foot_radius - config.swing.depth_m
        self.height_m = config.swing.height_m
        self.shift = 0j  # m, of all places, heading frame, x + i y
        self.reset()

    def reset(self) -> None:
        """Forget the swings of an earlier episode."""
        count = len(self.places)
        self.lift_off = np.zeros((count, 3))  # m, world
        self.target = np.zeros((count, 3))  # m, world, on the ground
        self._seen_from: tuple[list[int], Base | None] = [], None  # feet that swing, and the base

    @property
    def shifted_places(self) -> np.ndarray:
        """Where feet of a steady stance are, (feet, 3) m, heading frame."""
        return self.places + np.array([self.shift.real, self.shift.imag, 0.0])

    def aim(
        self,
        leg: int,
        progress: float,
        base: Base,
        pose: LegPose,
        wrenches: Wrenches,
        wanted: complex,
        yaw_rate: float,
        gait: GaitTiming,
    ) -> None:
        """Set the foothold of a leg.

        Args:
            leg: its index.
            progress: share of the swing that is over, in [0, 1].
            base: its state.
            pose: of the legs.
            wrenches: planned for the feet, world.
            wanted: velocity of the reference, m/s, world, x + i y.
            yaw_rate: commanded, rad/s.
            gait: its timing.
        """
        left_s = (1.0 - progress) * gait.swing_s
        if self._catch is None:
            target = foothold(
                self._ahead[leg] + self.shift,
                base.place,
                base.height,
                base.speed,
                wanted,
                base.yaw,
                yaw_rate,
                left_s,
                gait.stance_s,
                self._foothold,
            )
        else:
            target = catching_foothold(
                base,
                self._centre,
                pose.foot[1 - leg],
                wrenches.pressure(1 - leg),
                math.copysign(1.0, self.places[leg, 1]),
                wanted,
                yaw_rate,
                left_s,
                gait,
                self._catch,
            )
        self.target[leg, 0], self.target[leg, 1] = target.real, target.imag

    def footholds(self, axes: np.ndarray) -> np.ndarray:
        """Footholds of swinging feet from the base, heading frame, (feet, 3) m; NaN for the others.

        Args:
            axes: (3, 3) of the frame in which the feet are followed, to the world.
        """
        places = np.full_like(self.target, np.nan)
        swinging, base = self._seen_from
        if base is not None:
            yaw = roll_pitch_yaw(axes @ base.rotation)[2]
            places[swinging] = (self.target[swinging] - base.position) @ axes.T @ heading_matrix(yaw)
        return places

    def motion(self, swinging: list[int], progress: list[float], base: Base, swing_s: float) -> np.ndarray:
        """Motion of swinging feet as seen from the moving base, (k, 3, 3): see `LegControl.command`."""
        self._seen_from = swinging, base
        if not swinging:
            return _NO_SWING
        lift_off, landing = self.lift_off.tolist(), (self.target + self._touch_down).tolist()
        motion = np.array(
            [
                swing_motion(progress[leg], lift_off[leg], landing[leg], swing_s, self.height_m)
                for leg in swinging
            ]
        )
        position = [base.place.real, base.place.imag, base.height]
        motion -= np.array([position, base.velocity.tolist(), [0.0, 0.0, 0.0]])
        motion = motion.reshape(-1, 3).dot(base.rotation).reshape(-1, 3, 3)
        motion[:, 1] -= cross(base.gyro, motion[:, 0])
        return motion
