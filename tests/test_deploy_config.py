"""Settings that cannot work are refused in one line, before anything moves."""

from dataclasses import replace
from pathlib import Path

import pytest
from deploy_policies import Hold, short_episode

from footfall.common.errors import UserError
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.plant.episode import run_episode
from footfall.robots.description import Robot

REFUSED = [
    "joint_rate_hz: 0",
    "joint_rate_hz: 1e9",
    "joint_rate_hz: .nan",
    "estimator_rate_hz: -1",
    "stand_s: 0",
    "stand_kp_scale: -1",
    "stand_kd_scale: .inf",
    "realtime_priority: 200",
    "host_queue: 0",
    "motor_timeout_s: -0.1",
    "safety: {start_timeout_s: 0}",
    "safety: {silence_timeout_s: .nan}",
    "safety: {silence_timeout_s: 0.001}",  # half a tick
    "safety: {silence_timeout_s: 0.0039}",  # two ticks are 4 ms
    "joint_rate_hz: 10001",
    "joint_rate_hz: 0.9",
    "estimator_rate_hz: 10001",
    "estimator: {contact: {force_share: [0.8, 0.2]}}",
    "estimator: {contact: {force_share: [0.5, 0.5]}}",
    "estimator: {contact: {rise_s: 0}}",
    "estimator: {filter: {leg_velocity_noise: 0}}",
    "estimator: {filter: {acceleration_noise: -0.5}}",
    "estimator: {filter: {acceleration_bias: -0.1}}",
    "estimator: {odometry: {height_filter_s: 0}}",
    "estimator: {odometry: {scale_error: -0.01}}",
    "estimator: {odometry: {level_ground: 1}}",
    "stand_kd_scale: -0.1",
    "realtime_priority: 0",
    "realtime_priority: 100",
    "motor_timeout_s: 0",
    "safety: {tilt_limit_rad: -1}",
    "safety: {tilt_limit_rad: 1.6}",  # on its side it has fallen
    "safety: {pause_limit_s: 0.003}",  # one tick and a half
    "safety: {pause_limit_s: 0.09}",  # 1.1 times that and a tick: 0.101 s, when motors have given up
    "safety: {late_limit_s: 0.09}",
    "safety: {guard_share: 1.5}",  # times 0.07 s and a tick: 0.107 s
    "safety: {guard_share: 0.9}",
    "motor_timeout_s: 0.11",  # go1's motors wait for 0.1 s, whatever a file says
    "safety: {start_timeout_s: 0.019, still_s: 0}",  # nine ticks and a half
    "safety: {start_timeout_s: 0.069}",  # likewise, after keeping still for 0.05 s
    "safety: {silence_timeout_s: 0.11}",
    "safety: {damping_s: 0}",
    "stand_kp_scale: 0",
    "safety: {still_s: 0.99}",  # of the second in which it has to start
    "safety: {still_s: -0.1}",
    "safety: {late_steps: 0}",
    "safety: {late_limit_s: -1}",
    "safety: {damping_kd: .nan}",
    "safety: {damping_kd: -3}",
    "safety: {damping_kd: 0}",
    "safety: {damping_s: -1}",
    "safety: {damping_s: 1e9}",
    "safety: {damping_kd: 1e9}",
    "safety: {tilt_limit_rad: 0}",
    "safety: {silence_timeout_s: 1e9}",
    "safety: {late_steps: 1000000}",
    "safety: {pause_limit_s: .inf}",
    "safety: {skipped_share: 2}",
    "safety: {first_pose_rad: .nan}",
    "safety: {sensors: {drift_rad: .nan}}",
    "safety: {sensors: {period_s: 0}}",
    "safety: {sensors: {speed_share: 0.9}}",
    "stand_s: 1e9",
    "stand_kp_scale: .nan",
    "host_queue: 1000000000",
]


@pytest.mark.parametrize("text", REFUSED)
def test_what_cannot_work_is_refused_with_its_name(go1: Robot, text: str, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        deploy_config(go1, path)
    name = text.replace("safety: {", "").replace("sensors: {", "").partition(":")[0]
    assert name in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("rate_hz", "tick_us"), [(500.0, 2000), (300.0, 3333), (600.0, 1667)])
def test_a_tick_is_the_nearest_whole_number_of_microseconds(rate_hz: float, tick_us: int) -> None:
    assert DeployConfig(joint_rate_hz=rate_hz).tick_us == tick_us


def test_the_defaults_and_the_page_on_safety_agree(go1: Robot, tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs" / "safety.md").read_text()
    path = tmp_path / "loop.yaml"
    path.write_text(page.partition("```yaml")[2].partition("```")[0])
    assert replace(deploy_config(go1, path), realtime_priority=None) == DeployConfig()


def test_a_rate_that_a_bus_cannot_carry_is_refused_with_the_one_it_can(go1: Robot) -> None:
    """Three motors: six frames of 111 bits at least in a tick, on a bus of 1 Mbit/s."""
    with pytest.raises(UserError, match="3 motors on can0 can be asked 1502 times a second at most"):
        run_episode(go1, Hold(go1), short_episode(config=DeployConfig(joint_rate_hz=2000.0)))


@pytest.mark.parametrize("seconds", [0.0, -1.0, float("nan"), 1e12])
def test_a_duration_that_never_begins_or_never_ends_is_refused(go1: Robot, seconds: float) -> None:
    with pytest.raises(UserError, match="duration"):
        run_episode(go1, Hold(go1), short_episode(duration_s=seconds))


@pytest.mark.parametrize(
    "text",
    [
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
    ],
)
def test_what_just_works_is_taken(go1: Robot, text: str, tmp_path: Path) -> None:
    path = tmp_path / "loop.yaml"
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


def test_settings_that_the_page_on_safety_does_not_name() -> None:
    """Whoever changes these changes what a robot does that nobody configured."""
    plain = DeployConfig()
    assert (plain.joint_rate_hz, plain.estimator_rate_hz) == (500.0, 250.0)
    assert (plain.stand_s, plain.stand_kp_scale, plain.stand_kd_scale) == (1.0, 4.0, 2.0)
    assert (plain.motor_timeout_s, plain.host_queue) == (0.1, 10)
    assert plain.realtime_priority is None
