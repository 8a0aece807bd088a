"""Policies by name, and the controllers and zoo policies of a robot."""

import subprocess
import sys
from collections.abc import Iterator
from importlib.machinery import PathFinder
from pathlib import Path

import pytest
from edited import content_of
from refused import refusal_of
from shell import Shell
from tiny_policy import write_policy

from footfall.common.errors import UserError
from footfall.policies import registry
from footfall.policies.policy import Policy
from footfall.policies.registry import (
    CONTROLLERS,
    controllers_of,
    first_of_each_kind,
    load_policy,
    walking_controllers,
)
from footfall.robots.description import Robot, available_robots, load_robot


class TestControllers:
    @pytest.mark.parametrize("name", CONTROLLERS)
    def test_each_name_leads_to_its_controller(self, name: str) -> None:
        robots = [load_robot(robot) for robot in available_robots()]
        robot = next(robot for robot in robots if name in controllers_of(robot))
        policy = load_policy(name, robot)
        assert isinstance(policy, Policy)
        assert policy.name == name
        assert policy.contract is None

    def test_policies_that_read_base_velocity_need_an_estimate(self) -> None:
        for robot, names, needs in (
            ("go1", ("stand", "trot"), False),
            ("hexapod", ("wave",), False),
            ("go1", ("mpc", "mpc-wbc"), True),
            ("g1", ("balance", "step"), True),
        ):
            for name in names:
                policy = load_policy(name, load_robot(robot))
                assert policy.needs_estimate is needs
                assert not policy.notes

    def test_listing_names_imports_no_policy(self) -> None:
        code = (
            "import sys, footfall.policies.registry; print([m for m in sys.modules if m.startswith"
            "(('daqp', 'piqp', 'onnxruntime', 'footfall.policies.controllers.mpc'))])"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"

    def test_a_robot_has_the_controllers_with_settings(self, own_folder: Path) -> None:
        settings = own_folder / "controllers.yaml"
        with content_of(settings) as sections:
            for name in sections.keys() - {"stand", "trot"}:
                del sections[name]
        robot = load_robot(own_folder)
        assert controllers_of(robot) == ["stand", "trot"]
        assert walking_controllers(robot) == ["trot"]
        assert "'mpc'" in refusal_of(load_policy, "mpc", robot)
        assert "stand, trot, go1-flat" in refusal_of(load_policy, "dance", robot)
        for text, named in (("tort: {kp: 1.0}", "tort"), ("[stand, trot]", r"controllers\.yaml")):
            settings.write_text(text)
            with pytest.raises(UserError, match=named):
                controllers_of(load_robot(own_folder))

    def test_comparisons_use_one_gait_of_each_robot(self, go1: Robot) -> None:
        assert first_of_each_kind(walking_controllers(go1)) == ["trot", "mpc", "mpc-wbc"]
        assert first_of_each_kind(walking_controllers(load_robot("hexapod"))) == ["tripod", "mpc"]


PAGE = Path(__file__).parents[2] / "docs" / "evaluation.md"
UNFINISHED = "class Unfinished:\n    name = 'mine'\n    def __init__(self, robot): pass\nclass Odd: pass\n"


class TestOwn:
    """MODULE:CLASS, with the class that the page on evaluation shows."""

    @pytest.fixture(autouse=True)
    def _folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "path", list(sys.path))
        example = PAGE.read_text().partition("```python\n")[2].partition("```")[0]
        (tmp_path / "mine.py").write_text(example + "\n\n" + UNFINISHED)
        (tmp_path / "typo.py").write_text("class Sway(:")
        (tmp_path / "needy.py").write_text("import not_there")
        yield
        for name in ("mine", "typo", "needy"):
            sys.modules.pop(name, None)

    def test_a_users_class_works_wherever_a_policy_does(
        self, go1: Robot, capsys: pytest.CaptureFixture[str]
    ) -> None:
        policy = load_policy("mine:Sway", go1)
        assert isinstance(policy, Policy)
        assert policy.name == "sway"
        ended = Shell(capsys)("deploy", "mine:Sway", "--command", "0,0,0", "--duration", "0.3")
        assert ended.status == 0, ended.err

    def test_no_file_beside_a_users_class_replaces_a_library(self, go1: Robot, tmp_path: Path) -> None:
        (tmp_path / "this.py").write_text("")  # a library that nothing has imported yet
        load_policy("mine:Sway", go1)
        found = PathFinder.find_spec("this")
        assert found is not None
        assert found.origin != str(tmp_path / "this.py")

    def test_a_class_without_a_policys_methods_is_refused_in_one_line(
        self, go1: Robot, tmp_path: Path
    ) -> None:
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


class TestLearned:
    """Run folders, files and the zoo, and the names of their policies."""

    @pytest.fixture
    def run(self, tmp_path: Path, go1: Robot) -> Path:
        onnx = pytest.importorskip("onnx")
        folder = tmp_path / "tuesday"
        folder.mkdir()
        write_policy(onnx, folder / "policy.onnx", go1.folder)
        return folder

    def test_a_runs_policy_has_the_folders_name_and_a_files_policy_its_stem(
        self, run: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert load_policy(str(run), go1).name == "tuesday"
        assert load_policy(f"{run}/", go1).name == "tuesday"
        monkeypatch.chdir(run)
        assert load_policy(".", go1).name == "tuesday"
        renamed = (run / "policy.onnx").rename(run / "gentle.bin")
        assert load_policy(str(renamed), go1).name == "gentle"

    def test_a_zoo_policy_of_another_robot_is_refused(self, go1: Robot) -> None:
        assert "hexapod" in refusal_of(load_policy, "hexapod-flat", go1)


def test_a_folder_without_a_policy_is_refused_with_the_command_that_makes_one(
    go1: Robot, tmp_path: Path
) -> None:
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
    for name in ("go1-rough", "go1-flat", "go10-flat", "go1x", "go1-stairs", "go1-b", "go1-a", "go1-z"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "policy.onnx").write_text("")
    (tmp_path / "go1-unfinished").mkdir()
    monkeypatch.setattr(registry, "ZOO", tmp_path)
    own = ["go1-a", "go1-b", "go1-flat", "go1-rough", "go1-stairs", "go1-z"]
    assert registry.zoo_names(go1) == own
    assert registry.zoo_names() == sorted([*own, "go10-flat", "go1x"])
