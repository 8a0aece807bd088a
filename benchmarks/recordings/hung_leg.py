"""Windows of a hanging leg for a fit; identify/ simulates the leg."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import Parameter, values_of
from footfall.identify.recording import Recording
from footfall.identify.shooting import FitParameter, Shooting
from footfall.identify.simulate import simulate
from footfall.identify.windows import cut

START_SIGMA = (0.003, 0.3)  # rad, rad/s
SIGMA_RAD = 0.002


class Nominal(NamedTuple):
    """Scales of the parameters, for hip, thigh and calf."""

    armature: tuple[float, float, float]  # kg m^2
    friction: tuple[float, float, float]  # N m
    friction_speed: float  # rad/s


class Free(NamedTuple):
    """A quantity fitted for each joint."""

    quantity: str  # name in identify/parameters.py
    unit: str
    low: float
    high: float
    scale: float


FREE = (
    Free("armature", "kg m^2", 0.0005, 0.1, 0.005),
    Free("joint_friction", "N m", 0.0, 2.0, 0.1),
    Free("joint_damping", "N m s/rad", -0.5, 1.5, 0.1),
    Free("kp", "", 0.7, 1.3, 0.05),
    Free("encoder_bias", "rad", -0.03, 0.03, 0.01),
)
DELAY = "delay"


def leg_windows(
    leg: FixedLeg,
    recording: Recording,
    nominal: Nominal,
    quantities: tuple[str, ...],
    window_s: float,
    read_hz: float,
) -> Shooting:
    """All windows of one leg, each treated as a recording of its own.

    Args:
        leg: leg whose links are used; armature and losses are the nominal ones.
        recording: recording of the whole robot.
        nominal: initial guesses of armature and friction.
        quantities: quantities fitted for each joint, in addition to the leg's delay.
        window_s: length of a window.
        read_hz: rate of the readings that are used.
    """
    zero = np.zeros(leg.count)
    nominal_leg = replace(
        leg,
        armature=np.array(nominal.armature),
        motor=leg.motor._replace(
            friction=np.array(nominal.friction),
            friction_speed=np.full(leg.count, nominal.friction_speed),
            damping=zero,
        ),
    )
    windows = cut(recording, leg.joints, window_s, float(leg.model.opt.timestep), read_hz)
    # Parameters of the leg are relative to these, parameters of the fit are absolute.
    nominal_values = {"armature": nominal_leg.armature, "joint_friction": nominal_leg.motor.friction}
    guess = {"kp": 1.0, **nominal_values}
    fit_parameters, factors, leg_parameters = [], [], []
    for free in FREE:
        if free.quantity in quantities:
            for index, joint in enumerate(leg.joint_names):
                initial = float(np.broadcast_to(guess.get(free.quantity, 0.0), leg.count)[index])
                fit_parameters.append(FitParameter(f"{free.quantity} {joint}", free.unit, initial, *free[2:]))
                relative = free.quantity in nominal_values
                factors.append(float(nominal_values[free.quantity][index]) if relative else 1.0)
                leg_parameters.append(Parameter(free.quantity, joint))
    fit_parameters.append(FitParameter(DELAY, "s", 0.003, 0.0, 0.02, 0.003))
    leg_parameters += [Parameter("delay_s", joint) for joint in leg.joint_names]

    def predict(candidates: np.ndarray, start: np.ndarray) -> np.ndarray:
        scaled = candidates[:-1] / np.array(factors)[:, None]
        with_delays = np.concatenate([scaled, np.repeat(candidates[-1:], leg.count, axis=0)])
        values = values_of(nominal_leg, leg_parameters, with_delays)
        return simulate(nominal_leg, windows, values, start.reshape(*start.shape[:2], 2, leg.count)).position

    return Shooting(
        predict,
        tuple(fit_parameters),
        windows.position,
        np.full(leg.count, SIGMA_RAD),
        windows.start.reshape(windows.width, -1),
        np.repeat(START_SIGMA, leg.count),
        np.arange(windows.width),
    )
