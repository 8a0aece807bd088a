"""Path of a foot in swing."""

from footfall.policies.controllers.gait import swing_curve


def swing_motion(
    progress: float, lift_off: list[float], landing: list[float], swing_s: float, height_m: float
) -> list[list[float]]:
    """Motion along a cycloid from lift-off to landing, lifted in between.

    Args:
        progress: elapsed share of the swing, in [0, 1].
        lift_off, landing: (3,) m, centre of the foot, world frame.
        swing_s: duration of a swing.
        height_m: lift above the straight line.

    Returns:
        Position (3,) m, velocity (3,) m/s and acceleration (3,) m/s^2 of the foot's centre.
    """
    along, height = swing_curve(progress)
    x0, y0, z0 = lift_off
    x, y, z = landing[0] - x0, landing[1] - y0, landing[2] - z0
    share, rise = along.value, height_m * height.value
    position = [x0 + share * x, y0 + share * y, z0 + share * z + rise]
    share_1, rise_1 = along.slope / swing_s, height_m * height.slope / swing_s  # first derivatives
    velocity = [share_1 * x, share_1 * y, share_1 * z + rise_1]
    share_2, rise_2 = along.bend / swing_s**2, height_m * height.bend / swing_s**2  # second derivatives
    acceleration = [share_2 * x, share_2 * y, share_2 * z + rise_2]
    return [position, velocity, acceleration]
