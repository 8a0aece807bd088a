"""Policies by name, the controllers and zoo policies of a robot, and settings of controllers in a spec."""

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any

import pytest
from edited import content_of
from quick_relaxed import write_quick
from refused import refusal_of
from shell import Shell
from tiny_policy import write_policy

from footfall import Policy, Robot, UserError, load_policy, load_robot
from footfall.common.config import merged, structure, unstructure
from footfall.policies import registry
from footfall.policies.controllers.stand import StandConfig
from footfall.policies.registry import (
    CONTROLLERS,
    controllers_of,
    first_of_each_kind,
    lasting_spec,
    load_settings,
    walking_controllers,
)
from footfall.policies.spec import add_settings
from footfall.robots.description import available_robots

ROBOTS = {name: load_robot(name) for name in available_robots()}
NEED_ESTIMATE = ("mpc", "mpc-wbc", "jump", "gallop", "pronk", "balance", "step")


@pytest.mark.parametrize("name", CONTROLLERS)
def test_each_name_leads_to_its_controller(name: str) -> None:
    """Policies that read the base velocity need an estimate."""
    policy = load_policy(name, next(robot for robot in ROBOTS.values() if name in controllers_of(robot)))
    assert isinstance(policy, Policy)
    assert (policy.name, policy.contract, list(policy.notes)) == (name, None, [])
    assert policy.needs_estimate is (name in NEED_ESTIMATE)


def test_listing_names_imports_no_policy() -> None:
    code = "import sys, footfall.policies.registry; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    policies = ("daqp", "piqp", "onnxruntime", "footfall.policies.controllers.mpc")
    assert "footfall.policies.registry" in done.stdout
    assert not [name for name in done.stdout.split() if name.startswith(policies)]


def test_a_robot_has_the_controllers_with_settings(own_folder: Path) -> None:
    settings = own_folder / "controllers.yaml"
    with content_of(settings) as sections:
        for name in sections.keys() - {"stand", "trot"}:
            del sections[name]
    robot = load_robot(own_folder)
    assert (controllers_of(robot), walking_controllers(robot)) == (["stand", "trot"], ["trot"])
    assert "'mpc'" in refusal_of(load_policy, "mpc", robot)
    assert "stand, trot, go1-flat" in refusal_of(load_policy, "dance", robot)
    for text, named in (("tort: {kp: 1.0}", "tort"), ("[stand, trot]", "controllers.yaml")):
        settings.write_text(text)
        assert named in refusal_of(controllers_of, load_robot(own_folder))


def test_comparisons_use_one_gait_of_each_robot() -> None:
    assert first_of_each_kind(walking_controllers(ROBOTS["go1"])) == ["trot", "mpc", "mpc-wbc"]
    assert first_of_each_kind(walking_controllers(ROBOTS["hexapod"])) == ["tripod", "mpc"]


PAGE = Path(__file__).parents[2] / "docs" / "evaluation.md"
UNFINISHED = "class Unfinished:\n    name = 'mine'\n    def __init__(self, robot): pass\nclass Odd: pass\n"


class TestOwn:
    """MODULE:CLASS, with the class that the page on evaluation shows."""

    @pytest.fixture(autouse=True)
    def _folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "path", list(sys.path))
        example = PAGE.read_text().partition("```python\n")[2].partition("```")[0]
        files = {"mine": f"{example}\n\n{UNFINISHED}", "typo": "class Sway(:", "needy": "import not_there"}
        for name, text in files.items():
            (tmp_path / f"{name}.py").write_text(text)
        yield
        for name in files:
            sys.modules.pop(name, None)

    def test_a_users_class_is_deployed(
        self, go1: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "this.py").write_text("")  # a library that nothing has imported yet
        policy = load_policy("mine:Sway", go1)
        assert isinstance(policy, Policy)
        assert policy.name == "sway"
        more = "--command", "0,0,0", "--duration", "0.3", "--config", write_quick(tmp_path)
        ended = Shell(capsys)("deploy", "mine:Sway", *more)
        assert ended.status == 0, ended.err
        # No file beside the class replaces a library.
        found = PathFinder.find_spec("this")
        assert found is not None
        assert found.origin != str(tmp_path / "this.py")

    def test_a_class_without_a_policys_methods_is_refused(self, go1: Robot, tmp_path: Path) -> None:
        for spec, found in (
            ("yours:Sway", f"'yours': it is neither in {tmp_path} nor installed"),
            ("mine.deep:Sway", "'mine.deep'"),
            ("mine:Swing", f"{tmp_path}/mine.py has no 'Swing'"),
            ("mine:Unfinished", "rate_hz, needs_estimate, contract, notes, reset, act, stance"),
            ("mine:Odd", "TypeError: Odd() takes no arguments"),
            ("needy:Sway", "ModuleNotFoundError: No module named 'not_there' (needy.py:1)"),
            ("typo:Sway", "SyntaxError: invalid syntax (typo.py, line 1)"),
        ):
            assert found in refusal_of(load_policy, spec, go1)


def test_a_runs_policy_has_the_folders_name_and_a_files_policy_its_stem(
    tmp_path: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "tuesday"
    run.mkdir()
    policy = write_policy(pytest.importorskip("onnx"), run / "policy.onnx", go1.folder)
    monkeypatch.chdir(run)
    assert {load_policy(spec, go1).name for spec in (str(run), f"{run}/", ".")} == {"tuesday"}
    assert load_policy(str(policy.rename(run / "gentle.bin")), go1).name == "gentle"


def test_a_folder_without_a_policy_is_refused_with_its_remedy(go1: Robot, tmp_path: Path) -> None:
    assert "hexapod" in refusal_of(load_policy, "hexapod-flat", go1)  # a zoo policy of another robot
    assert "stand, trot, " in refusal_of(load_policy, "", go1)
    assert f"no policy in {tmp_path}" in refusal_of(load_policy, str(tmp_path), go1)
    (tmp_path / "run.yaml").touch()
    (tmp_path / "checkpoints").mkdir()
    assert f"'footfall train --resume {tmp_path}'" in refusal_of(load_policy, str(tmp_path), go1)
    (tmp_path / "checkpoints" / "00000010.ckpt").touch()
    assert f"'footfall export {tmp_path}'" in refusal_of(load_policy, str(tmp_path), go1)


def test_a_zoo_policy_needs_the_robots_complete_name(
    go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = ["go1-a", "go1-b", "go1-flat", "go1-rough", "go1-stairs", "go1-z"]
    for name in ("go1x", *reversed(own), "go10-flat"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "policy.onnx").touch()
    (tmp_path / "go1-unfinished").mkdir()
    monkeypatch.setattr(registry, "ZOO", tmp_path)
    assert registry.zoo_names(go1) == own
    assert registry.zoo_names() == sorted([*own, "go10-flat", "go1x"])


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.yaml"
    file.write_text("gait: {period_s: 0.5}\nweights: {force: 1e-4}\n")
    return file


def test_a_file_replaces_only_its_own_keys(go1: Robot, mine: Path) -> None:
    own, changed = load_settings("mpc", go1), load_settings(f"mpc@{mine}", go1)
    assert (changed.gait.period_s, changed.weights.force) == (0.5, 1e-4)
    assert (changed.gait.name, changed.weights.attitude) == (own.gait.name, own.weights.attitude)
    # Later settings override earlier ones.
    changed = load_settings(f"mpc@{mine}@gait.period_s=0.41@friction=0.55", go1)
    assert (changed.gait.period_s, changed.contact.friction, changed.weights.force) == (0.41, 0.55, 1e-4)


@pytest.mark.parametrize("text", ["kp: 62.0", "trot: {kp: 3.0}\nstand: {kp: 62.0}"])
def test_a_file_may_have_the_form_of_the_robots_own(go1: Robot, tmp_path: Path, text: str) -> None:
    """The name of the folder may have an @."""
    file = tmp_path / "me@home" / "s.yaml"
    file.parent.mkdir()
    file.write_text(text)
    settings = load_settings(f"stand@{file}@kd=2.5", go1)
    assert isinstance(settings, StandConfig)
    assert settings == replace(load_settings("stand", go1), kp=62.0, kd=2.5)  # type: ignore[type-var]


def test_a_wrong_setting_is_refused_with_its_reason(go1: Robot, tmp_path: Path) -> None:
    for spec, named in (
        ("stand@kq=1", "rate_hz, kp, kd, tilt_gain,"),
        *(("stand@kp.x=1", "stand@kp.x=1: "), ("stand@kp=soft", "stand@kp=soft: kp: 'soft'")),
        ("stand@kp=", "stand@kp=: kp: "),
        *((f"stand@kp={number * 5000}", "YAML") for number in "9["),
        ("stand@kp=[1", "stand@kp=[1: '[1'"),
        ("stand@kd=1@kp=-3", "stand@kd=1@kp=-3: kp"),
        *(("stand@rate_hz=.nan", "rate_hz"), ("stand@rate_hz=1e-12", "rate_hz")),
        ("mpc@rate_hz=1e30", "rate_hz"),  # an array of that many steps would be made
        ("mpc@horizon.steps=1000000", "steps"),
        ("mpc@gaits=[trot, hop]", "mpc: gaits: no gait 'hop'"),
        ("trot@gaits=[trot, hop]", "trot: gaits: no gait 'hop'"),
        ("trot@gait.name=hop", "trot: gait.name: no gait 'hop'"),
        ("trot@shift_m=1e30", "stance.shift_m"),
        ("trot@step.body_height_m=1e30", "step.body_height_m"),
        ("trot@step.height_m=0.6", "step.height_m"),  # legs are shorter
        ("mpc@stance.height_m=0.6", "stance.height_m"),
        ("mpc@stance.outward_m=-1e30", "stance.outward_m"),
        *(("mpc@swing.height_m=0.6", "swing.height_m"), ("mpc@swing.depth_m=1e30", "swing.depth_m")),
        ("mpc@horizon.step_s=1e30", "step_s"),
        *(("jump@landing.height_m=1e30", "landing.height_m"), ("jump@take_off_m=1e30", "leap.take_off_m")),
        ("mpc@kd=1", "stance.kd"),
        ("mpc@swing=fast", "mpc@swing=fast: swing"),
        ("mpc@gait.name=tripod", "mpc: gait.name: "),
        *(("stand@", "stand@: "), ("stand@none.yaml", "none.yaml")),
        *(("tripod@kp=1", "'tripod'"), ("go1-flat@kp=1", "'go1-flat@kp=1'")),
    ):
        assert named in refusal_of(load_policy, spec, go1)
    bad = tmp_path / "bad.yaml"
    for text in ("[1, 2]", "a: b: c"):
        bad.write_text(text)
        assert "bad.yaml" in refusal_of(load_policy, f"stand@{bad}", go1)


def test_set_options_reach_every_contender_with_that_controller() -> None:
    given = add_settings(["mpc", "stand", "mpc@a.yaml"], ["mpc.swing.kp=50", "stand.kp=9", "mpc.force=1"])
    assert given == ("mpc@swing.kp=50@force=1", "stand@kp=9", "mpc@a.yaml@swing.kp=50@force=1")
    for setting in ("mpc", "mpc.kp", "mpc.=1", "kp=1.5", "trot.kp=1"):  # the last one does not run
        with pytest.raises(UserError, match=f"--set {setting}: "):
            add_settings(["mpc", "stand"], [setting])


def test_a_lasting_spec_needs_no_file(go1: Robot, mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = f"mpc@{mine}@attitude=[3, 2, 1]"
    lasting, before = lasting_spec(spec), load_settings(spec, go1)
    mine.unlink()
    assert lasting == "mpc@gait.period_s=0.5@weights.force=1e-4@attitude=[3, 2, 1]"
    assert load_settings(lasting, go1) == before
    monkeypatch.chdir(mine.parent)
    Path("mine.onnx").touch()
    Path("run").mkdir()
    found = [lasting_spec(spec) for spec in ("mine.onnx", "run", "trot", "go1-flat")]
    assert found == [str(mine.with_suffix(".onnx")), str(mine.with_name("run")), "trot", "go1-flat"]


MAY_BE_NEGATIVE = {"outward_m", "shift_m", "feet_ahead_m"}
ABOVE_ZERO = {
    *("rate_hz", "settle_s", "period_s", "duty", "step_s", "steps", "solve_hz", "double_support_s"),
    *("filter_s", "acceleration_m_s2", "yaw_acceleration_rad_s2", "speed_m_s", "body_rate_m_s"),
    *("probe_m_s", "rate_share", "length_m", "body_height_m", "apart_m", "lift_m", "half_length_m"),
    *("half_width_m", "max_lead_m", "friction", "slipping_friction", "slip_m_s", "max_force"),
    *("max_force_n", "force", "moment", "posture", "capture_m", "near_m", "max_s", "urgent_m"),
    *("min_swing_s", "place", "time", "offset", "max_gradient", "memory_s", "fade_s", "crouch_m", "crouch_s"),
    *("rise_m", "take_off_m", "lasts_s", "attitude_rate_rad_s"),
}
MIXED = {"height_m", "kp", "kd"}  # above zero in some sections


def numbers(settings: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Keys of the settings that are one number."""
    for name, value in settings.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{prefix}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield prefix + name


def with_number(settings: Any, key: str, value: int) -> Any:
    changes: Any = value
    for section in reversed(key.split(".")):
        changes = {section: changes}
    return structure(merged(unstructure(settings), changes), type(settings), "here")


def test_only_offsets_may_be_negative_and_divisors_must_be_above_zero() -> None:
    """Settings of a controller of each kind, of a robot that has it."""
    found = [load_settings(name, robot) for robot in ROBOTS.values() for name in controllers_of(robot)]
    checked = set()
    for settings in {type(settings): settings for settings in found}.values():
        for key in numbers(unstructure(settings)):
            name = key.rpartition(".")[2]
            if name not in MAY_BE_NEGATIVE:
                with pytest.raises(UserError, match=name):
                    with_number(settings, key, -1)
            if name in ABOVE_ZERO:
                with pytest.raises(UserError, match=name):
                    with_number(settings, key, 0)
            elif name not in MIXED:
                with_number(settings, key, 0)
            checked.add(name)
    assert checked >= ABOVE_ZERO | MAY_BE_NEGATIVE | MIXED


def test_impossible_ranges_shares_and_weights_are_refused() -> None:
    tasks = ("attitude", "position", "angular_rate", "velocity")
    for robot, spec, name in (
        *(("go1", f"mpc@weights.{task}=[1, 0, -1]", task) for task in tasks),
        ("g1", "step@ahead_m=[0.5, 0.4]", "ahead_m"),
        ("g1", "step@gait.limits.apart_m=[0.5, 0.4]", "apart_m"),
        ("g1", "step@time_s=[0.5, 0.4]", "time_s"),
        ("g1", "step@friction_compensation=1.1", "friction_compensation"),
        ("g1", "step@step_s=0.6@double_support_s=0.6", "double_support_s"),
        ("go1", "trot@duty=1", "duty"),
        ("go1", "trot@force_share=[1, 0.5]", "force_share"),
        ("go1", "trot@from_progress=1.1", "from_progress"),
        ("go1", "trot@rate_share=1.1", "rate_share"),
    ):
        assert f"{name} must be" in refusal_of(load_policy, spec, ROBOTS[robot])
    assert load_settings("step@step_s=0.6@double_support_s=0.59", ROBOTS["g1"]).gait.double_support_s == 0.59
