"""Foothold of a biped's swing foot that catches the falling body."""

import cmath
import math

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.config import CatchConfig
from footfall.policies.controllers.step.footsteps import nominal_step
from footfall.policies.controllers.whole_body.feedback import pendulum_rate


def catching_foothold(
    base: Base,
    centre: np.ndarray,
    stance_foot: np.ndarray,
    pressure: complex,
    side: float,
    desired: complex,
    yaw_rate: float,
    remaining_s: float,
    gait: GaitTiming,
    config: CatchConfig,
) -> complex:
    """Touch-down position of a foot on the ground, world frame, m.

    Until touch-down, the capture point moves away from the centre of pressure of the stance foot. At
    touch-down it should have the same distance from the new foot as in a steady gait (`nominal_step`),
    because this distance decides all later steps.

    Args:
        base: state of the base.
        centre: (3,) m, centre of mass, base frame.
        stance_foot: (3,) m, middle of the stance foot, base frame.
        pressure: m, centre of pressure relative to the middle of the stance foot, world, x + i y.
        side: +1.0 if the left foot swings, -1.0 if the right foot swings.
        desired: desired velocity, m/s, world, x + i y.
        yaw_rate: commanded yaw rate, rad/s.
        remaining_s: time until touch-down.
        gait: timing of the gait.
        config: parameters of the steady gait, and limits of a step.
    """
    heading = cmath.rect(1.0, base.yaw)
    arm = base.rotation @ centre
    velocity = base.velocity + cross(base.rotation @ base.gyro, arm)
    rate = pendulum_rate(max(base.height + float(arm[2]), 0.1))
    capture = (arm + velocity / rate)[:2]
    foot = (base.rotation @ stance_foot)[:2]
    pressure_point = pressure / heading
    capture_arm = complex(*(capture - foot).tolist()) / heading - pressure_point
    step_s, double_support_s = gait.period_s / 2, gait.period_s * (gait.duty - 0.5)
    speed = desired / heading
    nominal = nominal_step(
        np.array([speed.real, speed.imag]), side, config.apart_m, step_s, max(double_support_s, 1e-3), rate
    )
    foothold, offset = complex(*nominal.foothold.tolist()), complex(*nominal.offset.tolist())
    capture_at_end = pressure_point + capture_arm * math.exp(rate * remaining_s)
    step = (capture_at_end - offset - nominal.lag * foothold) / (1.0 - nominal.lag)
    ahead = min(max(step.real, config.ahead_m[0]), config.ahead_m[1])
    sideways = side * min(max(side * step.imag, config.sideways_m[0]), config.sideways_m[1])
    turned = cmath.rect(1.0, base.yaw + 0.5 * yaw_rate * remaining_s)
    return base.xy + complex(*foot.tolist()) + complex(ahead, sideways) * turned
