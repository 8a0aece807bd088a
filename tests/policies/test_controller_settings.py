"""Settings of controllers on the command line: overrides, files, refusals."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from refused import refusal_of

from footfall.common.config import merged, structure, unstructure
from footfall.common.errors import UserError
from footfall.policies.controllers.stand import StandConfig
from footfall.policies.registry import controllers_of, lasting_spec, load_policy, load_settings
from footfall.policies.spec import add_settings
from footfall.robots.description import Robot, available_robots, load_robot


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.yaml"
    file.write_text("gait: {period_s: 0.5}\nweights: {force: 1e-4}\n")
    return file


class TestOverrides:
    def test_a_file_replaces_only_its_own_keys(self, go1: Robot, mine: Path) -> None:
        own, changed = load_settings("mpc", go1), load_settings(f"mpc@{mine}", go1)
        assert (changed.gait.period_s, changed.weights.force) == (0.5, 1e-4)
        assert (changed.gait.name, changed.weights.attitude) == (own.gait.name, own.weights.attitude)
        # Later settings override earlier ones.
        changed = load_settings(f"mpc@{mine}@gait.period_s=0.41@friction=0.55", go1)
        assert (changed.gait.period_s, changed.contact.friction) == (0.41, 0.55)
        assert changed.weights.force == 1e-4

    @pytest.mark.parametrize("text", ["kp: 62.0", "trot: {kp: 3.0}\nstand: {kp: 62.0}"])
    def test_a_file_may_have_the_form_of_the_robots_own_and_lie_anywhere(
        self, go1: Robot, tmp_path: Path, text: str
    ) -> None:
        """The name of the folder may have an @."""
        folder = tmp_path / "me@home"
        folder.mkdir()
        (folder / "s.yaml").write_text(text)
        settings = load_settings(f"stand@{folder / 's.yaml'}@kd=2.5", go1)
        assert isinstance(settings, StandConfig)
        assert settings == replace(load_settings("stand", go1), kp=62.0, kd=2.5)  # type: ignore[type-var]


def test_a_wrong_setting_is_refused_with_its_reason(go1: Robot, tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    for spec, named in (
        ("stand@kq=1", "rate_hz, kp, kd, tilt_gain,"),
        ("stand@kp.x=1", "stand@kp.x=1: "),
        ("stand@kp=soft", "stand@kp=soft: kp: 'soft'"),
        ("stand@kp=", "stand@kp=: kp: "),
        (f"stand@kp={'9' * 5000}", "YAML"),
        (f"stand@kp={'[' * 5000}", "YAML"),
        ("stand@kp=[1", "stand@kp=[1: '[1'"),
        ("stand@kd=1@kp=-3", "stand@kd=1@kp=-3: kp"),
        ("stand@rate_hz=.nan", "rate_hz"),
        ("stand@rate_hz=1e-12", "rate_hz"),
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
        ("mpc@swing.height_m=0.6", "swing.height_m"),
        ("mpc@swing.depth_m=1e30", "swing.depth_m"),
        ("mpc@horizon.step_s=1e30", "step_s"),
        ("jump@landing.height_m=1e30", "landing.height_m"),
        ("jump@take_off_m=1e30", "leap.take_off_m"),
        ("mpc@kd=1", "stance.kd"),
        ("mpc@swing=fast", "mpc@swing=fast: swing"),
        ("mpc@gait.name=tripod", "mpc: gait.name: "),
        ("stand@", "stand@: "),
        ("stand@none.yaml", "none.yaml"),
        ("tripod@kp=1", "'tripod'"),
        ("go1-flat@kp=1", "'go1-flat@kp=1'"),
        (f"stand@{bad}", "bad.yaml"),
    ):
        bad.write_text("[1, 2]")
        assert named in refusal_of(load_policy, spec, go1)
    bad.write_text("a: b: c")
    assert "bad.yaml" in refusal_of(load_policy, f"stand@{bad}", go1)


class TestSetOption:
    """--set CONTROLLER.KEY=VALUE"""

    def test_settings_reach_every_contender_with_that_controller(self) -> None:
        given = add_settings(["mpc", "stand", "mpc@a.yaml"], ["mpc.swing.kp=50", "stand.kp=9", "mpc.force=1"])
        assert given == ("mpc@swing.kp=50@force=1", "stand@kp=9", "mpc@a.yaml@swing.kp=50@force=1")

    def test_a_setting_for_a_controller_that_does_not_run_is_refused(self) -> None:
        for setting in ("mpc", "mpc.kp", "mpc.=1", "kp=1.5", "trot.kp=1"):
            with pytest.raises(UserError, match=f"--set {setting}: "):
                add_settings(["mpc", "stand"], [setting])


class TestLastingSpec:
    def test_a_lasting_spec_needs_no_file(self, go1: Robot, mine: Path) -> None:
        spec = f"mpc@{mine}@attitude=[3, 2, 1]"
        lasting = lasting_spec(spec)
        before = load_settings(spec, go1)
        mine.unlink()
        assert lasting == "mpc@gait.period_s=0.5@weights.force=1e-4@attitude=[3, 2, 1]"
        assert load_settings(lasting, go1) == before

    def test_other_policies_keep_their_names(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "mine.onnx").touch()
        (tmp_path / "run").mkdir()
        assert lasting_spec("mine.onnx") == str(tmp_path / "mine.onnx")
        assert lasting_spec("run") == str(tmp_path / "run")
        assert (lasting_spec("trot"), lasting_spec("go1-flat")) == ("trot", "go1-flat")


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


def one_of_each_kind() -> list[Any]:
    """Settings of a controller of each kind, of a robot that has it."""
    robots = map(load_robot, available_robots())
    found = [load_settings(name, robot) for robot in robots for name in controllers_of(robot)]
    return list({type(settings): settings for settings in found}.values())


def numbers(settings: dict[str, Any], prefix: str = "") -> Iterator[str]:
    """Keys of the settings that are one number."""
    for name, value in settings.items():
        if isinstance(value, dict):
            yield from numbers(value, f"{prefix}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield prefix + name


def with_number(settings: Any, key: str, value: int) -> Any:
    *sections, name = key.split(".")
    changes: dict[str, Any] = {name: value}
    for section in reversed(sections):
        changes = {section: changes}
    return structure(merged(unstructure(settings), changes), type(settings), "here")


class TestImpossibleNumbers:
    def test_only_offsets_may_be_negative_and_divisors_must_be_above_zero(self) -> None:
        checked = set()
        for settings in one_of_each_kind():
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

    def test_impossible_ranges_shares_and_weights_are_refused(self) -> None:
        for robot, spec, name in (
            *(
                ("go1", f"mpc@weights.{task}=[1, 0, -1]", task)
                for task in ("attitude", "position", "angular_rate", "velocity")
            ),
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
            assert f"{name} must be" in refusal_of(load_policy, spec, load_robot(robot))
        spec = "step@step_s=0.6@double_support_s=0.59"
        assert load_settings(spec, load_robot("g1")).gait.double_support_s == 0.59
