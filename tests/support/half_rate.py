"""A loop at half of the default rate, which is faster to simulate."""

from dataclasses import replace

from footfall.deploy.config import DeployConfig, deploy_config
from footfall.robots.description import Robot


def half_rate(robot: Robot) -> DeployConfig:
    return replace(deploy_config(robot), joint_rate_hz=250.0)
