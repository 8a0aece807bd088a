"""Trains an actuator net for identified legs, and compares it with the physical law on held-out motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from footfall.identify.driven import driven_motion
from footfall.identify.fit import FitConfig, LegFit, held_out_error
from footfall.identify.leg import FixedLeg, fixed_legs
from footfall.identify.parameters import Parameter
from footfall.identify.proposal import propose
from footfall.identify.recording import Recording
from footfall.robots.actuator_net import ActuatorNet, save_net
from footfall.robots.description import Robot, load_robot
from footfall.robots.driven_motion import DrivenMotion, joined_motion

if TYPE_CHECKING:
    from footfall.train.actuator_net import NetConfig, Trained

FILE = "actuator_net.npz"
VALIDATION, TEST = 1, 3  # indices of the validation and the test window in every four windows of a fit


@dataclass(frozen=True)
class Comparison:
    """Rms position errors of a leg over held-out windows, rad, (n,) each."""

    leg: FixedLeg
    nominal_rad: np.ndarray
    law_rad: np.ndarray  # fitted physical law
    net_rad: np.ndarray  # law of the proposed folder, with its net

    def rows(self) -> list[list[str]]:
        """Joint, and its errors in mrad."""
        errors = 1e3 * np.stack([self.nominal_rad, self.law_rad, self.net_rad], axis=1)
        names = self.leg.joint_names
        return [[name, *map("{:.2f}".format, row)] for name, row in zip(names, errors.tolist(), strict=True)]

    def figures(self) -> dict[str, Any]:
        """The errors, for a JSON file."""
        errors = {"nominal": self.nominal_rad, "law": self.law_rad, "net": self.net_rad}
        return {"leg": self.leg.name, "held_out_rad": {name: each.tolist() for name, each in errors.items()}}

    @property
    def better(self) -> bool:
        """Whether the net predicts the leg better than the fitted law."""
        return float((self.net_rad**2).mean()) < float((self.law_rad**2).mean())


def learn(
    robot: Robot,
    fits: Sequence[LegFit],
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    folder: Path,
    config: "NetConfig",
) -> list[Comparison]:
    """Write a proposed robot folder whose motors have a net, and evaluate it.

    The folder has the identified bodies and losses. The net learns the rest of the motor's torque, including
    strength, gains and lag. Delay and encoder bias come from the fit.

    Args:
        robot: nominal robot.
        fits: fits of its legs, to the same recordings.
        recordings: recordings of the robot. The last one decides which net is kept; a single one is split in
            time.
        held_out: recordings for the comparison; without any, every fourth second of each recording, as in the
            fit.
        folder: folder to write; must not exist.
        config: settings of the training.
    """
    propose(robot, fits, [each.source for each in recordings], folder, with_net=True)
    proposed = {leg.name: leg for leg in fixed_legs(load_robot(folder))}
    trained = [
        (proposed[fit.leg.name], _trained(proposed[fit.leg.name], fit, recordings, bool(held_out), config))
        for fit in fits
    ]
    save_net(folder / FILE, _of_robot(robot, trained), robot.joint_names)
    with (folder / "robot.yaml").open("a", encoding="utf-8") as file:
        file.write("\n# Learned by `footfall identify net`; randomisation.yaml names the recordings.\n")
        file.write(f"actuator_net: {FILE}\n")
    learned = {leg.name: leg for leg in fixed_legs(load_robot(folder))}
    return [_compared(fit, learned[fit.leg.name], recordings, held_out) for fit in fits]


def _compared(
    fit: LegFit, learned: FixedLeg, recordings: Sequence[Recording], held_out: Sequence[Recording]
) -> Comparison:
    fitted = {each.parameter: each.value for each in fit.estimates}

    def error(leg: FixedLeg, values: dict[Parameter, float]) -> np.ndarray:
        return held_out_error(leg, recordings, held_out, values, FitConfig())

    return Comparison(
        fit.leg, error(fit.leg, {}), error(fit.leg, fitted), error(learned, _delay_and_bias(fit))
    )


def _delay_and_bias(fit: LegFit) -> dict[Parameter, float]:
    """Fitted values of delay and encoder bias, which are not part of a net."""
    kinds = "delay_s", "encoder_bias"
    return {each.parameter: each.value for each in fit.estimates if each.parameter.quantity in kinds}


def _trained(
    leg: FixedLeg, fit: LegFit, recordings: Sequence[Recording], separate_test: bool, config: "NetConfig"
) -> "Trained":
    from footfall.train.actuator_net import train_net

    fitted = _delay_and_bias(fit)

    def of_joints(quantity: str) -> np.ndarray:
        parameters = [Parameter(quantity, joint) for joint in leg.joint_names]
        return np.array([fitted.get(each, each.declaration.nominal) for each in parameters])

    bias, delay_s = of_joints("encoder_bias"), of_joints("delay_s")
    fit_config = FitConfig()
    motions = [
        driven_motion(leg, each, bias, delay_s, config.window_s, fit_config.window_s) for each in recordings
    ]
    used = [block for block in range(fit_config.hold_out_every) if separate_test or block != TEST]
    if len(motions) > 1:
        *motions, validation = (_of_blocks(each, used) for each in motions)
        return train_net(joined_motion(motions), validation, leg.motor, config)
    learning = [block for block in used if block != VALIDATION]
    return train_net(
        _of_blocks(motions[0], learning), _of_blocks(motions[0], [VALIDATION]), leg.motor, config
    )


def _of_blocks(motion: DrivenMotion, blocks: Sequence[int]) -> DrivenMotion:
    """The motion, restricted to these blocks of every four."""
    period = FitConfig().hold_out_every
    if len(blocks) == period:
        return motion
    return motion.only((motion.block >= 0) & np.isin(motion.block % period, blocks))


def _of_robot(robot: Robot, trained: Sequence[tuple[FixedLeg, "Trained"]]) -> ActuatorNet:
    """Nets of all joints; joints without training have a net without torque."""
    example = trained[0][1].net

    def empty(array: np.ndarray) -> np.ndarray:
        return np.zeros((len(robot.joint_names), *array.shape[1:]))

    net = example._replace(
        layers=tuple(empty(layer) for layer in example.layers),
        linear=empty(example.linear),
        scale=1.0 + empty(example.scale),
        limit=empty(example.limit),
    )
    for leg, trained_leg in trained:
        for all_joints, one_leg in zip(
            (*net.layers, *net[1:]), (*trained_leg.net.layers, *trained_leg.net[1:]), strict=True
        ):
            if all_joints is not net.memory_s:
                all_joints[leg.joints] = one_leg
    return net
