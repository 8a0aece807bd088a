"""Settings that cannot work are refused in one line, before anything moves."""

import math
from dataclasses import fields, replace
from pathlib import Path

import pytest
from changed_robots import described
from refused import refusal_of

from footfall import Robot, UserError
from footfall.common.config import load
from footfall.deploy.bring_up.config import BringUpConfig, BringUpLimits
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.estimation.config import ContactConfig, FilterConfig, GyroConfig, OdometryConfig
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.deploy.wiring_check.config import WiringCheckConfig

# Files with these settings are refused: a figure is out of its range, or figures contradict each other.
REFUSED = (
    "joint_rate_hz: .nan", "realtime_priority: 200", "estimator: {contact: {force_share: [0.8, 0.2]}}",
    "estimator: {contact: {force_share: [0.5, 0.5]}}", "estimator: {contact: {rise_s: 0}}",
    "estimator: {filter: {leg_velocity_noise: 0}}", "estimator: {odometry: {scale_error: -0.01}}",
    "estimator: {odometry: {level_ground: 1}}",
    "motor_timeout_s: 0.11",  # go1's motors wait for 0.1 s, independently of the file
    "safety: {silence_timeout_s: .nan}",
    "safety: {silence_timeout_s: 0.0039}",  # two ticks are 4 ms
    "safety: {silence_timeout_s: 0.11}",
    "safety: {tilt_limit_rad: 1.6}",  # a robot on its side has fallen
    "safety: {pause_limit_s: 0.003}",  # one tick and a half
    "safety: {pause_limit_s: 0.09}",  # 1.1 times that and a tick: 0.101 s, longer than motors wait
    "safety: {late_limit_s: 0.09}",
    "safety: {guard_share: 1.5}",  # 1.5 times 0.07 s and a tick: 0.107 s
    "safety: {start_timeout_s: 0.019, still_s: 0}",  # nine ticks and a half
    "safety: {start_timeout_s: 0.069}",  # the same, after resting for 0.05 s
    "safety: {still_s: 0.99}",  # of the second in which it has to start
    "safety: {pause_limit_s: .inf}",
    "safety: {sensors: {drift_rad: .nan}}",
    "safety: {sensors: {speed_share: 0.9}}",
    "safety: {sensors: {torque_hidden: 0.06, torque_much: 0.06}}",
)  # fmt: skip
ACCEPTED = (
    "safety: {silence_timeout_s: 0.004}",
    "{stand_kp_scale: 0.1, stand_kd_scale: 0}",
    "realtime_priority: 1",
    "realtime_priority: 99",
    "safety: {damping_s: 0.01, tilt_limit_rad: 1.57, late_steps: 1}",
    "safety: {pause_limit_s: 0.089, late_limit_s: 0.089}",  # 1.1 times that and a tick: 0.0999 s
    "joint_rate_hz: 50",  # a tick of 20 ms, after 77 ms
    "motor_timeout_s: 0.08",
    "safety: {pause_limit_s: 0.004, start_timeout_s: 0.02, still_s: 0}",
    "estimator_rate_hz: 1",
    "safety: {sensors: {torque_hidden: 0.059, torque_much: 0.06}}",
)


def test_bad_settings_are_refused_with_file_and_name(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    for text in REFUSED:
        path.write_text(text)
        message = refusal_of(deploy_config, go1, path)
        assert text.replace("safety: {", "").replace("sensors: {", "").partition(":")[0] in message, text
        assert str(path) in message
    for text in ACCEPTED:
        path.write_text(text)
        deploy_config(go1, path)
    path.write_text("motor_timeout_s: 0.5")
    assert "0.1 s" in refusal_of(deploy_config, go1, path)
    assert deploy_config(go1, path, simulated=True).motor_timeout_s == 0.5


def figures(settings: type) -> list[str]:
    """Settings whose default is a float; those with None or a table have their own rows."""
    return [each.name for each in fields(settings) if isinstance(each.default, float)]


def refused(settings: type, name: str, value: float) -> bool:
    """Whether a setting is refused for any values of the other settings."""
    try:
        settings(**{name: value})
    except (ValueError, UserError) as error:
        return str(error).startswith(f"{name} must be")
    return False


def test_no_setting_may_be_nan_or_infinite() -> None:
    classes = (DeployConfig, SafetyConfig, SensorLimits, BringUpConfig, BringUpLimits, WiringCheckConfig)
    for settings in classes:
        assert figures(settings)
        for name in figures(settings):
            assert all(refused(settings, name, value) for value in (math.nan, math.inf, -math.inf)), name


def test_settings_of_the_estimator_are_not_negative_and_divisors_above_zero() -> None:
    may_be_zero = "sensor_trial_s acceleration_change acceleration_bias acceleration_bias_drift fall_m"
    may_be_zero += " latency_s orientation_noise yaw_drift scale_error climb_error slip creep_m_s sink_m_s"
    for settings in (ContactConfig, GyroConfig, FilterConfig, OdometryConfig):
        for name in figures(settings):
            assert refused(settings, name, 0.0) is (name not in may_be_zero.split()), name
            values = (-1e-9, math.inf, 1e300, 1e-9)  # the square of 1e300 is infinite
            assert [refused(settings, name, value) for value in values] == [True, True, True, False], name


def test_a_tick_is_the_nearest_whole_number_of_microseconds() -> None:
    assert [DeployConfig(joint_rate_hz=hz).tick_us for hz in (500.0, 300.0, 600.0)] == [2000, 3333, 1667]


def test_the_defaults_and_the_pages_agree(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "page.yaml"
    for page, block, read, defaults in (
        ("safety", "loop", lambda: replace(deploy_config(go1, path), realtime_priority=None), DeployConfig()),
        ("bring_up", "bring-up", lambda: load(path, BringUpConfig), BringUpConfig()),
    ):
        text = (Path(__file__).parents[2] / f"docs/{page}.md").read_text(encoding="utf-8")
        path.write_text(text.partition(f"<!-- read as: {block} -->\n```yaml")[2].partition("```")[0])
        assert read() == defaults


def test_a_file_changes_single_limits_of_a_robot(go1: Robot, tmp_path: Path) -> None:
    """A robot's limits are `safety` in robot.yaml."""
    path = tmp_path / "loop.yaml"
    robot = described(go1, safety={"tilt_limit_rad": 0.7, "sensors": {"sunk": 0.5}})
    path.write_text("{stand_s: 0.5, safety: {tilt_limit_rad: 0.9}}")
    for file, tilt_rad, stand_s in ((None, 0.7, DeployConfig().stand_s), (path, 0.9, 0.5)):
        config = deploy_config(robot, file)
        assert (config.safety.tilt_limit_rad, config.safety.sensors.sunk) == (tilt_rad, 0.5)
        assert config.safety.silence_timeout_s == DeployConfig().safety.silence_timeout_s
        assert config.stand_s == stand_s
    with pytest.raises(UserError, match=r"go1/robot.yaml: safety: .*\btilt\b"):
        deploy_config(described(go1, safety={"tilt": 0.7}))


def test_a_robots_limits_must_fit_the_motors_timeout(go1: Robot) -> None:
    """go1 allows a policy to be 0.07 s late: motors with a timeout of 0.06 s are disabled by then."""
    knee = replace(go1.description.motors["knee"], timeout_s=0.06)
    robot = described(go1, motors={**go1.description.motors, "knee": knee})
    assert "0.06 s" in refusal_of(deploy_config, robot)
    sooner = described(robot, safety={"pause_limit_s": 0.05, "late_limit_s": 0.05})  # 57 ms with a tick
    assert deploy_config(sooner).motor_timeout_s == 0.06
