"""The supervisor's rules as one table, in code and in the documentation."""

from dataclasses import fields
from pathlib import Path

from footfall.deploy.modes import Mode
from footfall.deploy.rules import rules, table
from footfall.deploy.safety_checks import CHECKS, SIGNAL_CHECKS
from footfall.deploy.safety_config import SafetyConfig
from footfall.deploy.sensor_checks.table import BODY_CHECKS, JOINT_CHECKS

RULES = rules()
PAGE = (Path(__file__).parents[2] / "docs/safety.md").read_text(encoding="utf-8")


def test_the_table_in_the_documentation_equals_the_table_in_code() -> None:
    shown = PAGE.partition("<!-- rules -->\n")[2].partition("<!-- /rules -->")[0].strip()
    assert shown == table(), "python -m footfall.deploy.rules prints it anew"


def test_every_rule_has_its_own_text_and_consequence() -> None:
    assert len({rule.quantity for rule in RULES}) == len(RULES)
    assert len(RULES) > len(SIGNAL_CHECKS) + len(JOINT_CHECKS) + len(BODY_CHECKS)
    stops = {Mode.ESTOP, Mode.FALLING, Mode.LOWERING}
    assert {check.leads_to for check in (*CHECKS, *JOINT_CHECKS, *BODY_CHECKS)} == stops
    assert all(rule.limit and rule.consequence for rule in RULES)
    velocity = next(rule for rule in RULES if rule.quantity == "a joint's velocity")
    assert velocity[1:] == (
        "`speed_share` 1.5 × `no_load_speed_rad_s`", "`safety.sensors`, `motors` in robot.yaml", "ESTOP",
    )  # fmt: skip


def test_every_limit_is_a_field_of_the_settings() -> None:
    settings = {name.partition(".")[0] for check in CHECKS for name in check.limits}
    assert settings <= {field.name for field in fields(SafetyConfig)}
