"""Table of all limits of a robot's behaviour: checked quantity, limit and consequence.

The rows are those of the supervisor (`safety_checks.SIGNAL_CHECKS`), of the sensors
(`sensor_checks/table.py`), and the limits of the joint layer for every command. `docs/safety.md` shows the
table, which `python -m footfall.deploy.rules` prints.
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

from footfall.deploy.safety_checks import SIGNAL_CHECKS, Check
from footfall.deploy.safety_config import SafetyConfig
from footfall.deploy.sensor_checks.check import SensorCheck
from footfall.deploy.sensor_checks.table import BODY_CHECKS, JOINT_CHECKS, LINK_CHECKS, SensorLimits

SETTING = "`safety`"  # in robot.yaml, or in a file for --config
SENSOR_SETTING = "`safety.sensors`"  # in robot.yaml, or in a file for --config
MOTOR = "`motors` in robot.yaml"


class Rule(NamedTuple):
    """One row of the table."""

    quantity: str
    limit: str  # with its default, if any
    source: str
    consequence: str  # resulting state, or effect on a command


COMMANDS = (
    Rule("a position target", "`soft_limit_factor` of the joint's range", "robot.yaml", "clipped"),
    Rule("a position target's speed", "`target_rate_rad_s`", "robot.yaml", "slowed down"),
    Rule(
        "a command's torque at the measured position and speed",
        "`peak_torque_nm`, `stall_torque_nm`, `no_load_speed_rad_s`",
        MOTOR,
        "gains and torque lowered",
    ),
    Rule("a velocity command", "the policy's ranges", "its contract", "clipped"),
    Rule(
        "a velocity command and all torques, while the battery is low",
        "`battery.low_charge`, `battery.low_cell_v`",
        SETTING,
        "limited, down to `battery.min_share` when the run ends",
    ),
)


def _signal_rule(check: Check) -> Rule:
    defaults = SafetyConfig()
    limit = ", ".join(f"`{name}` {attrgetter(name)(defaults):g}" for name in check.limits)
    return Rule(check.quantity, limit or "none", SETTING if limit else "", check.leads_to)


def _sensor_rule(check: type[SensorCheck]) -> Rule:
    setting, motor = check.limit
    share = f"`{setting}` {getattr(SensorLimits(), setting):g}" if setting else ""
    figure = f"`{motor}`" if motor else ""
    sources = [source for source, given in ((SENSOR_SETTING, setting), (MOTOR, motor)) if given]
    return Rule(check.quantity, " × ".join(filter(None, (share, figure))), ", ".join(sources), check.leads_to)


SENSOR_CHECKS: tuple[type[SensorCheck], ...] = (*LINK_CHECKS, *JOINT_CHECKS, *BODY_CHECKS)


def rules(sensor_checks: Sequence[type[SensorCheck]] = SENSOR_CHECKS) -> tuple[Rule, ...]:
    """All rules."""
    return (*map(_signal_rule, SIGNAL_CHECKS), *map(_sensor_rule, sensor_checks), *COMMANDS)


def table(sensor_checks: Sequence[type[SensorCheck]] = SENSOR_CHECKS) -> str:
    """All rules as a Markdown table."""
    lines = ["| quantity | limit | source | consequence |", "| --- | --- | --- | --- |"]
    return "\n".join([*lines, *(f"| {' | '.join(rule)} |" for rule in rules(sensor_checks))])


if __name__ == "__main__":
    print(table())
