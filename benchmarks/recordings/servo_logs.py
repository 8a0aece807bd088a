"""Recordings of position servos that move a pendulum, and their windows."""

import functools
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.identify.shooting import FitParameter, Shooting
from recordings.rollout import Acceleration, Inputs, rollouts
from recordings.servo_pendulum import (
    LAW,
    PARAMETERS,
    PLAIN,
    STEP_S,
    acceleration,
    acceleration_both_sides,
    acceleration_published,
)

MARGIN_S, READ_HZ = 0.04, 100.0
SIGMA_RAD, START_SIGMA = 0.005, (0.002, 0.2)  # rad; rad, rad/s
FIT_POINTS = 4  # readings on either side that are used for the initial state


class Servo(NamedTuple):
    """Known properties of a servo and of its recordings."""

    duty_per_rad: float  # at gain 1
    by_gain: bool  # whether gains are held out; otherwise recordings
    guess: dict[str, float]
    makers: dict[str, dict[str, float]]  # published parameter sets


M1 = dict.fromkeys(("stribeck", "load_friction", "load_stribeck"), 0.0)
M1 |= {"stribeck_speed": 1.0, "alpha": 1.0}
STS3250 = {"kt": 1.2, "resistance": 3.0, "armature": 0.02, "coulomb": 0.1, "delay": 0.015}
SERVOS = {
    "xl330": Servo(
        4096 / (2 * math.pi) / 256 / 885,
        True,
        {},
        {
            "M1 of af22604": M1
            | {"kt": 0.387, "resistance": 4.02, "armature": 1.81e-3, "coulomb": 0.0128}
            | {"viscous": 3.66e-3, "offset": 0.031},
            "M4 of 11bb7ec": {
                "kt": 0.291545,
                "resistance": 2.0,
                "armature": 2.57825e-3,
                "coulomb": 2.15218e-3,
                "viscous": 0.0178197,
                "offset": 0.015495,
                "stribeck": 4.14278e-4,
                "load_friction": 0.251587,
                "load_stribeck": 0.0520285,
                "stribeck_speed": 0.117806,
                "alpha": 1.0,
            },
        },
    ),
    "sts3250": Servo(0.166, False, STS3250, {}),
}
MODELS: dict[str, tuple[tuple[str, ...], Acceleration]] = {
    "Coulomb and viscous": (PLAIN, acceleration),
    "joint law": (LAW, acceleration),
    "joint law, load of both sides": (LAW, acceleration_both_sides),
}


class Log(NamedTuple):
    """One recording."""

    name: str
    gain: float
    time_s: np.ndarray  # (T,)
    position: np.ndarray  # (T,) rad
    inputs: np.ndarray  # (T, 6) inputs of `acceleration`


@functools.cache
def logs(folder: str, servo: str) -> tuple[Log, ...]:
    """The recordings in a folder.

    Raises:
        UserError: there are fewer than two, or an entry is missing.
    """
    found = tuple(read(path, SERVOS[servo]) for path in sorted(Path(folder).glob("*.json")))
    if len(found) < 2:
        raise UserError(f"{folder} has {len(found)} JSON files: at least two are needed, see --help")
    return found


def read(path: Path, servo: Servo) -> Log:
    """One recording."""
    try:
        content = json.loads(path.read_text())
        keys = ("timestamp", "position", "goal_position", "torque_enable")
        time_s, position, goal, enabled = (
            np.array([entry[key] for entry in content["entries"]], dtype=float) for key in keys
        )
        gain = float(content["kp"])
        constants = servo.duty_per_rad * gain, content["mass"], content["length"], content["vin"]
        name = f"{content['trajectory']}, kp {gain:g}"
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise UserError(f"{path} is not a recording of a servo: {error!r}") from None
    inputs = np.column_stack(
        [goal, enabled, *np.broadcast_to(np.array(constants)[:, None], (4, len(time_s)))]
    )
    return Log(name, gain, time_s, position, inputs)


@functools.cache
def problem(folder: str, servo: str, model: str, window_s: float = 1.0) -> Shooting:
    """All windows of all recordings; a goal applies until the next one."""
    names, law = MODELS[model]
    guess = SERVOS[servo].guess
    parameters = tuple(
        each._replace(guess=guess.get(each.name, each.guess)) for each in PARAMETERS if each.name in names
    )
    return _windows(logs(folder, servo), parameters, law, window_s)


@functools.cache
def makers_problem(folder: str, servo: str, window_s: float = 1.0) -> Shooting:
    """The same windows with the published law, starting at its published set M1."""
    parameters = tuple(FitParameter(name, "", value, -1e3, 1e3, 1.0) for name, value in M1.items())
    other_names = ("kt", "resistance", "armature", "coulomb", "viscous", "offset")
    parameters += tuple(FitParameter(name, "", 0.0, -1e3, 1e3, 1.0) for name in other_names)
    return _windows(logs(folder, servo), parameters, acceleration_published, window_s)


def _windows(
    found: Sequence[Log], parameters: tuple[FitParameter, ...], law: Acceleration, window_s: float
) -> Shooting:
    margin, steps = round(MARGIN_S / STEP_S), round(window_s / STEP_S)
    input_values, read_at, measured, starts, recording = [], [], [], [], []
    for index, log in enumerate(found):
        begin = log.time_s[0] + MARGIN_S / 2
        for window in range(int((log.time_s[-1] - begin) / window_s)):
            start_s = begin + window * window_s
            grid = start_s + STEP_S * np.arange(-margin, steps)
            input_values.append(log.inputs[(np.searchsorted(log.time_s, grid, side="right") - 1).clip(0)])
            rows = np.searchsorted(log.time_s, start_s + np.arange(int(window_s * READ_HZ)) / READ_HZ)
            rows = rows.clip(0, len(log.time_s) - 1)
            read_at.append(((log.time_s[rows] - start_s) / STEP_S).clip(0.0, steps))
            measured.append(log.position[rows, None])
            first = int(np.searchsorted(log.time_s, start_s))
            neighbours = slice(max(first - FIT_POINTS, 0), first + FIT_POINTS + 1)
            curve = np.polynomial.polynomial.polyfit(
                log.time_s[neighbours] - start_s, log.position[neighbours], 2
            )
            starts.append(curve[:2])
            recording.append(index)
    inputs = Inputs(np.stack(input_values), margin, STEP_S, np.array(read_at))
    return Shooting(
        rollouts(law, inputs, parameters, ("delay", "delay")),
        parameters,
        np.array(measured),
        np.array([SIGMA_RAD]),
        np.array(starts),
        np.array(START_SIGMA),
        np.array(recording),
    )


def folds(folder: str, servo: str) -> list[tuple[str, list[int]]]:
    """Names and recording indices of the parts that are held out together."""
    found = logs(folder, servo)
    if not SERVOS[servo].by_gain:
        return [(log.name, [index]) for index, log in enumerate(found)]
    gains = sorted({log.gain for log in found})
    return [
        (f"kp {gain:g}", [index for index, log in enumerate(found) if log.gain == gain]) for gain in gains
    ]
