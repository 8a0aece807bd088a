"""`footfall list`: available names as a table and as JSON."""

import json
from pathlib import Path

import yaml
from shell import Shell

ROOT = Path(__file__).parents[2]


def test_everything_that_ships_is_there_with_its_facts(shell: Shell) -> None:
    outcome = shell("list", "--json")
    assert outcome.status == 0
    listed = {kind: {row["name"]: row for row in rows} for kind, rows in json.loads(outcome.out).items()}
    assert list(listed) == ["robots", "controllers", "policies", "scenarios", "presets"]
    assert set(listed["robots"]) == {path.parent.name for path in ROOT.glob("robots/*/robot.yaml")}
    assert set(listed["policies"]) == {path.parent.name for path in ROOT.glob("policies/zoo/*/policy.onnx")}
    assert set(listed["presets"]) == {path.stem for path in ROOT.glob("train/presets/*.yaml")}
    scenarios = yaml.safe_load((ROOT / "evaluate/scenarios.yaml").read_text())["scenarios"]
    assert set(listed["scenarios"]) == set(scenarios)
    hexapod = listed["robots"]["hexapod"]
    assert (hexapod["feet"], hexapod["joints"]) == (6, 18)
    assert hexapod["controllers"] == ["stand", "tripod", "ripple", "wave", "mpc"]
    assert hexapod["policies"] == ["hexapod-flat", "hexapod-getup", "hexapod-rough"]
    assert listed["robots"]["g1"]["policies"] == ["g1-flat", "g1-getup", "g1-rough"]
    assert listed["controllers"]["step"]["robots"] == ["g1"]
    assert [listed["controllers"][name]["walks"] for name in ("stand", "mpc")] == [False, True]
    assert listed["policies"]["g1-flat"]["robot"] == "g1"
    gentle, smoke = listed["scenarios"]["gentle"], listed["presets"]["smoke"]
    assert (gentle["episodes"], gentle["duration_s"], smoke["total_steps"]) == (24, 10.0, 4096)
    assert gentle["about"]
    assert smoke["about"]


def test_a_robot_folder_limits_the_list_to_its_controllers(own_folder: Path, shell: Shell) -> None:
    listed = json.loads(shell("list", "--robot", own_folder, "--json").out)
    (robot,) = listed["robots"]
    assert robot["controllers"]
    assert {row["name"] for row in listed["controllers"]} == set(robot["controllers"])
    assert all(row["robots"] == [robot["name"]] for row in listed["controllers"])
    assert {row["name"] for row in listed["policies"]} == set(robot["policies"])
    assert shell("list", "--robot", own_folder).status == 0
