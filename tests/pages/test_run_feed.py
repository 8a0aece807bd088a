"""State that pages read from a run's feed, against the simulated robot."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from walking_run import eventually

from footfall import Episode, Robot, load_policy, run_episode
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.pages.cockpit.joints import JointNames, joint_figures
from footfall.pages.live import PosedModel
from footfall.pages.run_feed import RunFeed, newest_moment, sensed
from footfall.plant.robot import SimulatedRobot
from footfall.robots.readings import Sensed

PATIENCE_S = 30.0


def same(read: Sensed | None, true: Sensed) -> bool:
    return read is not None and np.array_equal(read.joint_position, true.joint_position)


@pytest.fixture(scope="module")
def seen(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> SimpleNamespace:
    """The state of a walk at one time, by its feed and by the simulation."""
    path = tmp_path_factory.mktemp("run") / "feed"
    feed, policy = RunFeed(path), load_policy("trot", go1)
    found = SimpleNamespace(feed=feed)
    joints = JointNames(go1.joint_names, go1.motor.peak_torque.tolist())

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and loop.walking_s >= 0.59 and not hasattr(found, "truth"):
            found.truth, found.footholds = body.truth(), policy.footholds()
            assert eventually(lambda: same(sensed(feed), loop.sensed), PATIENCE_S)
            assert eventually(lambda: feed.newest("/footholds", feed.time_ns - 25_000_000), PATIENCE_S)
            found.moment, found.joints = newest_moment(feed, 4), joint_figures(feed, joints)
            found.policy = feed.fact("policy")

    command = np.array([0.4, 0.0, 0.2])
    config = replace(deploy_config(go1), odometry=True)
    run_episode(go1, policy, Episode(lambda _: command, 0.7, feed=path, config=config), watch)
    assert eventually(lambda: feed.ended, PATIENCE_S)
    return found


def test_a_moment_has_the_robots_pose_and_motion(seen: SimpleNamespace) -> None:
    now, truth = seen.moment, seen.truth
    assert seen.policy == "trot"
    np.testing.assert_allclose(now.command, [0.4, 0.0, 0.2])
    np.testing.assert_allclose(now.position[:2], truth.base_position[:2], atol=0.03)
    np.testing.assert_allclose(now.quaternion, truth.base_quaternion, atol=0.03)
    np.testing.assert_allclose(now.velocity, truth.base_velocity, atol=0.2)
    np.testing.assert_allclose(now.sensed.joint_position, truth.joint_position, atol=0.05)
    assert (now.contact[truth.foot_force > 20.0] > 0.5).all()
    np.testing.assert_allclose(now.footholds, seen.footholds, atol=0.03)
    assert np.isfinite(now.footholds).any()


def test_the_view_puts_its_feet_on_the_ground(seen: SimpleNamespace, go1: Robot) -> None:
    pose = PosedModel(go1)
    placed = pose.set_moment(seen.moment)
    assert placed.position[2] == pytest.approx(seen.truth.base_position[2], abs=0.02)
    np.testing.assert_allclose(pose.data.body(go1.description.base).xpos, placed.position)


def test_joints_have_load_temperature_and_error(seen: SimpleNamespace, go1: Robot) -> None:
    joints = seen.joints["joints"]
    assert joints["names"] == list(go1.joint_names)
    load = 100.0 * np.abs(seen.truth.motor_torque) / go1.motor.peak_torque
    np.testing.assert_allclose(joints["load"], load, atol=25.0)
    assert np.isfinite([*joints["temperature_c"], *joints["error_rad"], seen.joints["yaw_rate"]]).all()


def test_a_message_older_than_the_requested_time_is_left_out(seen: SimpleNamespace) -> None:
    assert seen.feed.newest("/footholds") is not None
    assert seen.feed.newest("/footholds", seen.feed.time_ns + 1) is None
