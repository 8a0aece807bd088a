"""Settings that cannot work are refused in one line, before anything moves."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from deploy_policies import Hold, short_episode

from footfall.common.errors import UserError
from footfall.deploy.bring_up.config import BringUpConfig, BringUpLimits
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.estimation.config import ContactConfig, FilterConfig, GyroConfig, OdometryConfig
from footfall.deploy.safety import SafetyConfig
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.deploy.wiring_check.config import WiringCheckConfig
from footfall.plant.episode import run_episode
from footfall.robots.description import Robot

# What a file may not say: a figure out of its range, and figures that do not fit each other.
REFUSED = (
    "joint_rate_hz: .nan",
    "realtime_priority: 200",
    "estimator: {contact: {force_share: [0.8, 0.2]}}",
    "estimator: {contact: {force_share: [0.5, 0.5]}}",
    "estimator: {contact: {rise_s: 0}}",
    "estimator: {filter: {leg_velocity_noise: 0}}",
    "estimator: {odometry: {scale_error: -0.01}}",
    "estimator: {odometry: {level_ground: 1}}",
    "motor_timeout_s: 0.11",  # go1's motors wait for 0.1 s, whatever a file says
    "safety: {silence_timeout_s: .nan}",
    "safety: {silence_timeout_s: 0.0039}",  # two ticks are 4 ms
    "safety: {silence_timeout_s: 0.11}",
    "safety: {tilt_limit_rad: 1.6}",  # a robot on its side has fallen
    "safety: {pause_limit_s: 0.003}",  # one tick and a half
    "safety: {pause_limit_s: 0.09}",  # 1.1 times that and a tick: 0.101 s, when motors have given up
    "safety: {late_limit_s: 0.09}",
    "safety: {guard_share: 1.5}",  # times 0.07 s and a tick: 0.107 s
    "safety: {start_timeout_s: 0.019, still_s: 0}",  # nine ticks and a half
    "safety: {start_timeout_s: 0.069}",  # likewise, after keeping still for 0.05 s
    "safety: {still_s: 0.99}",  # of the second in which it has to start
    "safety: {pause_limit_s: .inf}",
    "safety: {sensors: {drift_rad: .nan}}",
    "safety: {sensors: {speed_share: 0.9}}",
)


def test_what_cannot_work_is_refused_with_its_file_and_name(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    for text in REFUSED:
        path.write_text(text)
        with pytest.raises(UserError) as caught:
            deploy_config(go1, path)
        name = text.replace("safety: {", "").replace("sensors: {", "").partition(":")[0]
        assert name in str(caught.value), text
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


RANGES: list[tuple[type, float, float, str]] = [
    (DeployConfig, 1.0, 10_000.0, "joint_rate_hz estimator_rate_hz"),
    (DeployConfig, 0.001, 60.0, "stand_s motor_timeout_s"),
    (DeployConfig, 0.0, 60.0, "stop_s"),
    (DeployConfig, 1, 10_000, "host_queue"),
    (DeployConfig, 0.1, 100.0, "stand_kp_scale"),
    (DeployConfig, 0.0, 100.0, "stand_kd_scale"),
    (DeployConfig, 0.01, 100.0, "pose_rate_rad_s stop_rate_rad_s sink_rate_rad_s"),
    (DeployConfig, 0.0, 1.0, "sink_share"),
    (DeployConfig, 0.01, 1.0, "scale"),
    (DeployConfig, 1, 99, "realtime_priority"),
    (SafetyConfig, 0.001, 60.0, "start_timeout_s silence_timeout_s late_limit_s pause_limit_s"),
    (SafetyConfig, 1.0, 10.0, "guard_share"),
    (SafetyConfig, 0.0, 60.0, "still_s"),
    (SafetyConfig, 1, 1000, "late_steps"),
    (SafetyConfig, 0.01, 100.0, "damping_kd"),
    (SafetyConfig, 1e-9, math.pi, "first_pose_rad"),
    (SafetyConfig, 1e-9, math.pi / 2, "tilt_limit_rad"),
    (SafetyConfig, 0.01, 60.0, "damping_s"),
    (SafetyConfig, 0.0, 1.0, "skipped_share"),
    (SensorLimits, 0.001, 0.2, "period_s"),
    (SensorLimits, 0.01, 10.0, "memory_s drift_memory_s creep_memory_s imu_repeated_s resting_s limp_s"),
    (SensorLimits, 0.01, 10.0, "lean_memory_s long_lean_memory_s"),
    (SensorLimits, 0.01, 60.0, "lost_memory_s replayed_s unexplained_memory_s explained_s ignored_s"),
    (SensorLimits, 0.01, 1.0, "lost_share frozen_share older_share"),
    (SensorLimits, 1.0, 1000.0, "foreign_replies"),
    (SensorLimits, 0.001, 10.0, "unexplained"),
    (SensorLimits, 0.0, 10.0, "creep_rad_s"),
    (SensorLimits, 0.0, 1.0, "strength_share ignored"),
    (SensorLimits, 1.0, 300.0, "colder_c coldest_c"),
    (SensorLimits, 0.001, math.tau, "position_rad drift_rad wander_rad creep_rad stuck_rad repeated_rad"),
    (SensorLimits, 0.001, math.tau, "rotation_rad turned_rad"),
    (SensorLimits, 0.0, 1.0, "drift_share creep_share opposing"),
    (SensorLimits, 0.1, 1.0, "sunk torque_full"),
    (SensorLimits, 0.01, 1.5, "slope_rad leg_turn_rad"),
    (SensorLimits, 0.01, 1.0, "loaded_share"),
    (SensorLimits, 0.01, 2.0, "rest_error lean_error long_lean_error lift_error"),
    (SensorLimits, 0.0, 0.1, "lag_s filter_s reading_rad"),
    (SensorLimits, 0.001, 2.0, "torque_stuck"),
    (SensorLimits, 0.001, 1.0, "torque_hidden torque_much torque_some torque_little"),
    (SensorLimits, 0.01, 100.0, "moving_rad_s resting_rad_s"),
    (SensorLimits, 1.0, 10.0, "speed_share torque_share"),
    (SensorLimits, 0.0, 100.0, "voltage_v"),
    (BringUpConfig, 0.5, 60.0, "hold_s move_s walk_s"),
    (BringUpConfig, 0.0, 60.0, "slew_s"),
    (WiringCheckConfig, 0.1, 10.0, "settle_s move_s unlike"),
    (WiringCheckConfig, 0.01, 0.5, "standing_rad lying_rad least_rad lean_rad lost_rad askew_rad"),
    (WiringCheckConfig, 0.01, 1.0, "alike imu_alike explained doubtful explained_in_doubt"),
    (WiringCheckConfig, 0.0, 0.1, "motor_lag_s imu_lag_s"),
    (BringUpConfig, 0.01, 1.0, "move_rad sway_rad"),
    (BringUpLimits, 0.001, 3.2, "lost_rad still_rad tilt_rad"),
    (BringUpLimits, 0.01, 10.0, "shaking_rad_s shaking_s"),
    (BringUpLimits, 0.001, 1.0, "torque_share least_leg_share"),
    (BringUpLimits, 30.0, 150.0, "temperature_c"),
]


def refused(settings: type, name: str, value: float) -> bool:
    """Whether a setting is refused for its own sake, whatever the others are."""
    try:
        settings(**{name: value})
    except (ValueError, UserError) as error:
        return str(error).startswith(f"{name} must be")
    return False


def test_a_setting_has_a_lowest_and_a_highest_value() -> None:
    for settings, low, high, names in RANGES:
        step = 1 if isinstance(low, int) else 1e-6
        beyond = low - step if isinstance(low, int) else low * (1 - step) - 1e-12
        for name in names.split():
            taken, out = (low, high), (beyond, high + step, math.nan)
            assert [refused(settings, name, value) for value in (*taken, *out)] == [False] * 2 + [True] * 3, (
                name
            )


ESTIMATOR: list[tuple[type, str, bool]] = [  # whether a figure may be 0
    (ContactConfig, "force_filter_s rise_s level_m", False),
    (GyroConfig, "bias_filter_s bias_half_s", False),
    (FilterConfig, "acceleration_noise leg_velocity_noise swing_noise", False),
    (FilterConfig, "outlier_freedom push_m_s push_filter_s", False),
    (FilterConfig, "acceleration_change acceleration_bias acceleration_bias_drift", True),
    (OdometryConfig, "height_noise height_filter_s latency_filter_s", False),
    (OdometryConfig, "orientation_noise yaw_drift scale_error climb_error slip", True),
    (OdometryConfig, "creep_m_s sink_m_s latency_s", True),
]


def test_no_figure_of_the_estimator_is_negative_and_what_it_divides_by_is_above_0() -> None:
    for settings, names, zero in ESTIMATOR:
        for name in names.split():
            assert refused(settings, name, 0.0) is not zero, name
            values = (-1e-9, math.inf, 1e-9)
            assert [refused(settings, name, value) for value in values] == [True, True, False], name


def test_what_hides_a_torque_is_less_than_what_counts_as_much() -> None:
    with pytest.raises(UserError, match="torque_hidden"):
        SensorLimits(torque_hidden=0.06, torque_much=0.06)
    SensorLimits(torque_hidden=0.059, torque_much=0.06)


@pytest.mark.parametrize(("rate_hz", "tick_us"), [(500.0, 2000), (300.0, 3333), (600.0, 1667)])
def test_a_tick_is_the_nearest_whole_number_of_microseconds(rate_hz: float, tick_us: int) -> None:
    assert DeployConfig(joint_rate_hz=rate_hz).tick_us == tick_us


def test_the_defaults_and_the_page_on_safety_agree(go1: Robot, tmp_path: Path) -> None:
    page = (Path(__file__).parents[2] / "docs" / "safety.md").read_text()
    path = tmp_path / "loop.yaml"
    path.write_text(page.partition("<!-- read as: loop -->\n```yaml")[2].partition("```")[0])
    assert replace(deploy_config(go1, path), realtime_priority=None) == DeployConfig()


def test_a_rate_that_a_bus_cannot_carry_is_refused_with_the_one_it_can(go1: Robot) -> None:
    """Three motors: six frames of 111 bits at least in a tick, on a bus of 1 Mbit/s."""
    with pytest.raises(UserError, match="3 motors on can0 can be asked 1502 times a second at most"):
        run_episode(go1, Hold(go1), short_episode(config=DeployConfig(joint_rate_hz=2000.0)))


TAKEN = (
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
)


def test_what_just_works_is_taken(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    for text in TAKEN:
        path.write_text(text)
        deploy_config(go1, path)


def test_simulated_motors_alone_can_be_told_to_wait_for_longer(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    path.write_text("motor_timeout_s: 0.5")
    assert deploy_config(go1, path, simulated=True).motor_timeout_s == 0.5
    with pytest.raises(UserError, match=r"0\.5 s: go1's motors switch themselves off after 0\.1 s"):
        deploy_config(go1, path)


class TestLimitsOfARobot:
    """`safety` in robot.yaml."""

    def with_limits(self, robot: Robot, **limits: object) -> Robot:
        return replace(robot, description=replace(robot.description, safety=limits))

    def test_take_the_place_of_the_defaults(self, go1: Robot) -> None:
        config = deploy_config(self.with_limits(go1, tilt_limit_rad=0.7, sensors={"sunk": 0.5}))
        assert (config.safety.tilt_limit_rad, config.safety.sensors.sunk) == (0.7, 0.5)
        assert config.safety.silence_timeout_s == DeployConfig().safety.silence_timeout_s

    def test_a_file_changes_them_one_by_one(self, go1: Robot, tmp_path: Path) -> None:
        path = tmp_path / "loop.yaml"
        path.write_text("{stand_s: 0.5, safety: {tilt_limit_rad: 0.9}}")
        config = deploy_config(self.with_limits(go1, tilt_limit_rad=0.7, sensors={"sunk": 0.5}), path)
        assert config.stand_s == 0.5
        assert (config.safety.tilt_limit_rad, config.safety.sensors.sunk) == (0.9, 0.5)

    def test_that_cannot_work_are_refused_with_the_robots_file(self, go1: Robot) -> None:
        with pytest.raises(UserError, match=r"go1/robot.yaml: safety: no setting tilt \("):
            deploy_config(self.with_limits(go1, tilt=0.7))

    def test_reach_as_far_as_its_motors_wait(self, go1: Robot) -> None:
        """A policy that is late by 0.07 s, as go1 allows it, would find motors off that wait for 0.06 s."""
        knee = replace(go1.description.motors["knee"], timeout_s=0.06)
        motors = {**go1.description.motors, "knee": knee}
        robot = replace(go1, description=replace(go1.description, motors=motors))
        with pytest.raises(UserError, match=r"motors that hear nothing for 0\.06 s"):
            deploy_config(robot)
        sooner = self.with_limits(robot, pause_limit_s=0.05, late_limit_s=0.05)  # 57 ms with a tick
        assert deploy_config(sooner).motor_timeout_s == 0.06

    def test_hold_in_the_simulation(self, go1: Robot) -> None:
        """1e-9 rad: less than any robot tilts."""
        trace = run_episode(self.with_limits(go1, tilt_limit_rad=1e-9), Hold(go1), short_episode(config=None))
        assert trace.final_state == "FALLING"
