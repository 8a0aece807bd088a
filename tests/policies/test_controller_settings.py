"""A controller with other settings than the robot's: what a user may type for it, and what comes of it."""

from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.stand import StandConfig
from footfall.policies.registry import (
    CONTROLLERS,
    changed_settings,
    controllers_of,
    lasting_spec,
    load_policy,
    load_settings,
)
from footfall.policies.spec import add_settings, short_name
from footfall.robots.description import Robot, available_robots, load_robot


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    file = tmp_path / "mine.yaml"
    file.write_text("gait: {period_s: 0.5}\nweights: {force: 1e-4}\n")
    return file


def refusal(spec: str, robot: Robot) -> str:
    with pytest.raises(UserError) as caught:
        load_policy(spec, robot)
    assert "\n" not in str(caught.value)
    return str(caught.value)


class TestWhatIsTyped:
    @pytest.mark.parametrize("key", ["stance.kd", "gait.period_s", "period_s", "attitude"])
    def test_one_setting_differs_and_no_other(self, go1: Robot, key: str) -> None:
        """The last two leave out sections that no other setting of that name has."""
        value = [3.0, 2.0, 1.0] if key == "attitude" else 0.46
        own, changed = load_settings("mpc", go1), load_settings(f"mpc@{key}={value}", go1)
        assert isinstance(changed, MpcConfig)
        found = {
            "stance.kd": (own.stance.kd, changed.stance.kd),
            "gait.period_s": (own.gait.period_s, changed.gait.period_s),
            "attitude": (own.weights.attitude, changed.weights.attitude),
        }
        for name, (before, after) in found.items():
            meant = name.endswith(key)
            assert (after != before) == meant
            assert not meant or after == (tuple(value) if isinstance(value, list) else value)
        assert changed.swing == own.swing

    def test_a_file_replaces_what_it_names(self, go1: Robot, mine: Path) -> None:
        own, changed = load_settings("mpc", go1), load_settings(f"mpc@{mine}", go1)
        assert (changed.gait.period_s, changed.weights.force) == (0.5, 1e-4)
        assert (changed.gait.name, changed.weights.attitude) == (own.gait.name, own.weights.attitude)

    def test_a_file_may_be_of_the_form_of_the_robots_own(self, go1: Robot, tmp_path: Path) -> None:
        file = tmp_path / "two.yaml"
        file.write_text("trot: {kp: 3.0}\nstand: {kp: 61.0}\n")
        assert load_settings(f"stand@{file}", go1).kp == 61.0

    def test_settings_that_follow_a_file_win(self, go1: Robot, mine: Path) -> None:
        changed = load_settings(f"mpc@{mine}@gait.period_s=0.41@friction=0.55", go1)
        assert (changed.gait.period_s, changed.contact.friction) == (0.41, 0.55)
        assert changed.weights.force == 1e-4

    def test_a_group_of_settings_is_merged(self, go1: Robot) -> None:
        changed = load_settings("mpc@gait={period_s: 0.44}", go1)
        assert (changed.gait.period_s, changed.gait.duty) == (0.44, 0.5)

    def test_a_folder_may_have_an_at_in_its_name(self, go1: Robot, tmp_path: Path) -> None:
        folder = tmp_path / "me@home"
        folder.mkdir()
        (folder / "s.yaml").write_text("kp: 62.0")
        assert load_settings(f"stand@{folder / 's.yaml'}@kd=2.5", go1) == StandConfig(
            rate_hz=500.0,
            kp=62.0,
            kd=2.5,
            tilt_gain=0.3,
            tilt_rate_gain_s=0.02,
            most_tilt_rad=0.2,
            settle_s=0.5,
        )

    def test_the_controller_runs_with_them_and_is_called_by_them(self, go1: Robot, mine: Path) -> None:
        assert load_policy("stand@rate_hz=250", go1).rate_hz == 250.0
        assert load_policy("stand", go1).name == "stand"
        assert load_policy(f"mpc@{mine}@kp=41", go1).name == "mpc@mine.yaml@kp=41"

    def test_its_name_leaves_out_the_folders_of_files_alone(self) -> None:
        assert short_name("mpc", ["some/folder/mine.yaml", "gait.name=a/b"]) == "mpc@mine.yaml@gait.name=a/b"

    def test_a_file_of_nothing_but_comments_changes_nothing(self, go1: Robot, tmp_path: Path) -> None:
        (tmp_path / "later.yaml").write_text("# later\n")
        assert load_settings(f"stand@{tmp_path / 'later.yaml'}", go1) == load_settings("stand", go1)

    @pytest.mark.parametrize("name", CONTROLLERS)
    def test_every_controllers_settings_can_be_changed(self, name: str) -> None:
        robot = next(r for r in map(load_robot, available_robots()) if name in controllers_of(r))
        assert load_policy(f"{name}@settle_s=0.37", robot)._config.settle_s == 0.37  # type: ignore[attr-defined]


class TestRefusals:
    @pytest.mark.parametrize(
        ("spec", "complaint"),
        [
            ("stand@kq=1", "stand@kq=1: no setting kq (there are rate_hz, kp, kd, tilt_gain,"),
            ("stand@kp.x=1", "stand@kp.x=1: no setting kp.x (did you mean kp?)"),
            ("stand@kp=soft", "stand@kp=soft: kp: 'soft' is not a number"),
            ("stand@kp=", "stand@kp=: kp: None is not a number"),
            (f"stand@kp={'9' * 5000}", "is not valid YAML"),
            (f"stand@kp={'[' * 5000}", "is not valid YAML"),
            ("stand@kp=[1", "stand@kp=[1: '[1' is not valid YAML"),
            ("stand@kd=1@kp=-3", "stand@kd=1@kp=-3: kp must be above 0, not -3.0"),
            ("stand@rate_hz=.nan", "rate_hz: not a finite number"),
            ("mpc@kd=1", "mpc@kd=1: there are stance.kd and swing.kd: say which"),
            ("mpc@swing=fast", "mpc@swing=fast: swing: expected a mapping of settings"),
            ("mpc@gait.name=tripod", "no gait 'tripod' for the 4 feet of 'go1': trot, walk, pace"),
            ("stand@", "stand@: expected a YAML file or KEY=VALUE after the @"),
            ("stand@none.yaml", "none.yaml: No such file or directory"),
            ("tripod@kp=1", "robot 'go1' has no settings for 'tripod': it has stand,"),
            ("go1-flat@kp=1", "no policy 'go1-flat@kp=1': give one of stand,"),
        ],
    )
    def test_each_says_what_is_wrong(self, go1: Robot, spec: str, complaint: str) -> None:
        assert complaint in refusal(spec, go1)

    def test_a_file_that_is_none(self, go1: Robot, tmp_path: Path) -> None:
        (tmp_path / "list.yaml").write_text("[1, 2]")
        assert "list.yaml: expected a mapping of settings" in refusal(f"stand@{tmp_path / 'list.yaml'}", go1)
        (tmp_path / "bad.yaml").write_text("a: b: c")
        assert "bad.yaml is not valid YAML" in refusal(f"stand@{tmp_path / 'bad.yaml'}", go1)


class TestSettingsGivenApart:
    """--set CONTROLLER.KEY=VALUE"""

    def test_they_reach_every_contender_of_that_controller(self) -> None:
        given = add_settings(["mpc", "stand", "mpc@a.yaml"], ["mpc.swing.kp=50", "stand.kp=9", "mpc.force=1"])
        assert given == ("mpc@swing.kp=50@force=1", "stand@kp=9", "mpc@a.yaml@swing.kp=50@force=1")

    @pytest.mark.parametrize(
        ("setting", "complaint"),
        [
            ("mpc", "expected CONTROLLER.KEY=VALUE"),
            ("mpc.kp", "expected CONTROLLER.KEY=VALUE"),
            ("mpc.=1", "expected CONTROLLER.KEY=VALUE"),
            ("kp=1.5", "expected CONTROLLER.KEY=VALUE"),
            ("trot.kp=1", "'trot' is not among the policies mpc, stand"),
        ],
    )
    def test_what_cannot_be_meant_is_refused(self, setting: str, complaint: str) -> None:
        with pytest.raises(UserError, match=f"--set {setting}: .*{complaint}"):
            add_settings(["mpc", "stand"], [setting])


class TestWhatIsKept:
    def test_a_spec_that_lasts_needs_no_file(self, go1: Robot, mine: Path) -> None:
        spec = f"mpc@{mine}@attitude=[3, 2, 1]"
        lasting = lasting_spec(spec)
        before = load_settings(spec, go1)
        mine.unlink()
        assert lasting == "mpc@gait.period_s=0.5@weights.force=1e-4@attitude=[3, 2, 1]"
        assert load_settings(lasting, go1) == before

    def test_names_and_files_of_other_policies_last_as_they_did(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "mine.onnx").touch()
        (tmp_path / "run").mkdir()
        assert lasting_spec("mine.onnx") == str(tmp_path / "mine.onnx")
        assert lasting_spec("run") == str(tmp_path / "run")
        assert (lasting_spec("trot"), lasting_spec("go1-flat")) == ("trot", "go1-flat")

    def test_changes_are_told_one_by_one(self, mine: Path) -> None:
        assert changed_settings(f"mpc@{mine}@kp=3") == ["gait.period_s=0.5", "weights.force=1e-4", "kp=3"]
        assert changed_settings("mpc") == changed_settings("run@home") == []

    def test_a_policy_that_is_no_controller_has_none(self, go1: Robot) -> None:
        assert load_settings("go1-flat", go1) is None


COMMAND = ("command.acceleration_m_s2", "command.yaw_acceleration_rad_s2")
WHOLE_BODY = tuple(
    f"whole_body.{name}"
    for name in (
        *("weights.posture", "weights.force", "contact.friction", "joints.memory_s"),
        *("no_solution.fade_s", "no_solution.kd", "no_solution.most_s"),
    )
)
WHOLE_BODY_NOT_BELOW = tuple(
    f"whole_body.{name}"
    for name in (
        *(f"weights.{task}" for task in ("contact", "centre", "momentum", "attitude", "swing")),
        *("weights.swing_attitude", "contact.damping_s", "joints.kp", "joints.kd"),
    )
)
ABOVE_ZERO = {
    "mpc": (
        *("rate_hz", "settle_s", "gait.period_s", *COMMAND, "contact.friction", "contact.most_force_n"),
        *("horizon.steps", "horizon.step_s", "horizon.solve_hz", "weights.force", "stance.height_m"),
    ),
    "mpc-wbc": WHOLE_BODY,
    "balance": ("rate_hz", "most_lead_m", "most_force", "settle_s", *WHOLE_BODY),
    "step": (
        *("rate_hz", "most_force", "settle_s", *COMMAND),
        *("gait.step_s", "gait.double_support_s", "gait.apart_m"),
        *("gait.limits.least_swing_s", "gait.limits.speed_m_s"),
        *("gait.weights.place", "gait.weights.time", "gait.weights.offset", "swing.lift_m"),
        *("pressure.half_length_m", "pressure.half_width_m", "pressure.most_lead_m"),
        *("start.capture_m", "start.near_m", "start.most_s", "start.urgent_m"),
    ),
}
NOT_BELOW_ZERO = {
    "mpc": (
        *("command.standing_command", "weights.force_change", "stance.kd", "stance.most_position_lead_m"),
        *("stance.most_yaw_lead_rad", "swing.height_m", "swing.depth_m", "swing.kp", "swing.kd"),
        *("foothold.capture_gain_s", "foothold.most_step_m", "restart.start_speed_m_s", "restart.calm_s"),
        *("restart.stop_speed_m_s", "restart.start_tilt_rad", "friction_compensation"),
    ),
    "mpc-wbc": ("posture.stiffness", "posture.damping", *WHOLE_BODY_NOT_BELOW),
    "step": ("lower_m", "momentum_damping", "pressure.gain", "swing.depth_m"),
}
OWNERS = {"mpc": "go1", "mpc-wbc": "go1", "balance": "g1", "step": "g1"}


class TestNumbersThatCannotWork:
    @pytest.mark.parametrize(
        ("controller", "key"), [(name, key) for name, keys in ABOVE_ZERO.items() for key in keys]
    )
    def test_what_must_be_above_zero(self, controller: str, key: str) -> None:
        with pytest.raises(UserError, match=f"{key.rpartition('.')[2]} must be above 0"):
            load_settings(f"{controller}@{key}=0", load_robot(OWNERS[controller]))

    @pytest.mark.parametrize(
        ("controller", "key"), [(name, key) for name, keys in NOT_BELOW_ZERO.items() for key in keys]
    )
    def test_what_must_not_be_below_it(self, controller: str, key: str) -> None:
        robot = load_robot(OWNERS[controller])
        load_settings(f"{controller}@{key}=0", robot)
        with pytest.raises(UserError, match=f"{key.rpartition('.')[2]} must be 0 or above"):
            load_settings(f"{controller}@{key}=-0.1", robot)

    @pytest.mark.parametrize("task", ["attitude", "position", "angular_rate", "velocity"])
    def test_no_weight_of_three_is_below_zero(self, go1: Robot, task: str) -> None:
        with pytest.raises(UserError, match=f"{task} must be 0 or above"):
            load_settings(f"mpc@weights.{task}=[1, 0, -1]", go1)

    @pytest.mark.parametrize("key", ["ahead_m", "gait.limits.apart_m", "time_s"])
    def test_limits_of_a_step_go_from_low_to_high(self, key: str) -> None:
        with pytest.raises(UserError, match="must be a range from low to high"):
            load_settings(f"step@{key}=[0.5, 0.4]", load_robot("g1"))

    @pytest.mark.parametrize("share", [-0.1, 1.1])
    def test_a_share_of_the_gearboxes_friction(self, share: float) -> None:
        with pytest.raises(UserError, match="friction_compensation must be from 0 to 1"):
            load_settings(f"step@friction_compensation={share}", load_robot("g1"))

    @pytest.mark.parametrize(("double_s", "fits"), [(0.59, True), (0.6, False), (0.7, False)])
    def test_both_feet_bear_for_less_than_a_step(self, double_s: float, fits: bool) -> None:
        spec = f"step@step_s=0.6@double_support_s={double_s}"
        if fits:
            assert load_settings(spec, load_robot("g1")).gait.double_support_s == double_s
            return
        with pytest.raises(UserError, match="double_support_s must be below step_s"):
            load_settings(spec, load_robot("g1"))
