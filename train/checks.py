"""Checks that settings fit the robot and the devices, made before there is a run folder."""

from footfall.common.collector import collector_paused
from footfall.common.errors import UserError
from footfall.envs.make import make_environment
from footfall.policies.contract import Contract
from footfall.robots.description import Robot
from footfall.train.config import PpoConfig, TrainConfig


@collector_paused()
def check_robot(config: TrainConfig, robot: Robot, preset: str) -> Contract:
    """The contract of the policy that these settings train.

    Raises:
        UserError: the environment's settings do not fit the robot, or `symmetry` is set and the robot is not
            symmetric. A message about an entry of a list of terms begins with the preset.
    """
    try:
        environment = make_environment(robot, config.env)
    except UserError as error:
        about_entry = str(error).startswith("env.")
        raise UserError(f"{preset}: {error}" if about_entry else str(error)) from None
    if config.ppo.symmetry:
        environment.mirror()
    return environment.contract


def check_devices(config: PpoConfig, count: int) -> None:
    """Check that devices and mini-batches get equal numbers of environments.

    Raises:
        UserError: they do not.
    """
    parts = config.num_mini_batches * count
    if config.num_envs % parts:
        raise UserError(
            f"ppo.num_envs {config.num_envs} cannot be divided among {count} devices"
            f" and {config.num_mini_batches} mini-batches: give a multiple of {parts}"
        )
