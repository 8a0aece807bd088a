"""The base estimator, against the true motion of a simulated robot, and on readings made by hand."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up import SOLES
from moments import UP, under_load

from footfall import Robot, load_policy, load_robot
from footfall.common.rotations import heading, multiply
from footfall.deploy.estimation.config import EstimatorConfig, GyroConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.estimation.odometry import YAW, Odometry
from footfall.policies.controllers.walk import Walk as Generator
from footfall.policies.policy import Sensed
from footfall.robots.model import imu_position
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
CERTAIN_GYRO = GyroConfig(bias_half_s=1e6)  # the readings give the yaw rate, never the yaw


def yawed(angle: float) -> np.ndarray:
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


class Unplanned(Generator):
    """A trot without a contact plan, like learned policies."""

    def stance(self) -> None:  # type: ignore[override]
        return None


class Follower:
    """An estimator that records its odometry and the truth at each update."""

    def __init__(self, plant: DirectPlant) -> None:
        self.plant, self._estimator = plant, BaseEstimator(plant.robot)
        self.poses: list[Odometry] = []
        self.truth: list[np.ndarray] = []  # position and velocity

    def reset(self, sensed: Sensed) -> None:
        self._estimator.reset(sensed)

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        result = self._estimator.update(sensed, stance, dt_s)
        self.poses.append(self._estimator.odometry())
        self.truth.append(np.concatenate([self.plant.data.qpos[:3], self.plant.velocity()]))
        return result

    def errors(self) -> np.ndarray:
        """Errors of position and velocity, (ticks, 6); the robot starts at heading zero."""
        truth = np.array(self.truth)
        truth[:, :3] -= truth[0, :3]
        return np.array([np.concatenate([o.position, o.velocity]) for o in self.poses]) - truth


@pytest.fixture(scope="module")
def walks() -> dict[str, Follower]:
    """Three seconds of a curve, with and without the controller's contact plan."""

    def follow(make: Callable[..., Generator]) -> Follower:
        plant = DirectPlant(ROBOT, seed=1)
        follower = Follower(plant)
        walk(make(ROBOT, "trot"), plant, lambda _: np.array([0.4, 0.1, 0.4]), 3.0, follower)
        return follower

    return {"planned": follow(Generator), "unplanned": follow(Unplanned)}


def test_in_flight_no_foot_stands_and_the_imu_carries_on() -> None:
    """Two seconds of a pronk. The height is less certain the longer nothing touches the ground."""
    plant = DirectPlant(ROBOT, seed=1)
    follower, touching = Follower(plant), []
    update = follower.update
    follower.update = lambda sensed, _, dt_s: update(sensed, None, dt_s)  # type: ignore[method-assign]

    def record(time_s: float, plant: DirectPlant) -> None:
        touching.append(plant.data.ncon > 0)

    walk(
        load_policy("pronk", ROBOT), plant, lambda _: np.array([0.4, 0.1, 0.4]), 2.0, follower, on_tick=record
    )
    touches = np.array(touching)
    in_flight = np.flatnonzero(~touches[: len(follower.poses)])
    assert len(in_flight) > 200
    assert max(follower.poses[tick].contact.max() for tick in in_flight) < 0.1
    error = follower.errors()
    assert np.abs(error[:, :3]).max() < 0.03
    assert np.sqrt((error[400:, 3:] ** 2).mean(axis=0)).max() < 0.05
    deviation = np.array([each.covariance[2, 2] for each in follower.poses]) ** 0.5
    off = np.flatnonzero(touches[600:-40] & ~touches[601:-39])[0] + 600
    assert (np.diff(deviation[off + 10 : off + 40]) > 0.0).all()
    assert deviation[off + 40] > 1.01 * deviation[off - 20]


@pytest.mark.parametrize("kind", ["planned", "unplanned"])
def test_the_estimate_follows_the_motion(walks: dict[str, Follower], kind: str) -> None:
    """The position drifts by less than a fiftieth of the distance; velocity and yaw are accurate."""
    follower = walks[kind]
    steps = np.diff(np.array(follower.truth)[:, :2], axis=0)
    distance = np.linalg.norm(steps, axis=1).sum()
    assert distance > 0.9
    error = follower.errors()
    assert np.linalg.norm(error[-1, :2]) < 0.02 * distance
    assert np.abs(error[:, 2]).max() < 0.01
    error = error[500:, 3:]
    assert np.sqrt((error[:, :2] ** 2).mean(axis=0)).max() < 0.015
    assert np.abs(error.mean(axis=0))[:2].max() < 0.005
    assert np.sqrt((error[:, 2] ** 2).mean()) < 0.03
    yaw = float(heading(follower.plant.data.qpos[3:7]))
    assert yaw > 0.8
    assert follower.poses[-1].yaw == pytest.approx(yaw, abs=0.03)


# -- readings made by hand ---------------------------------------------------------------------------


def held(robot: Robot = ROBOT, share: float = 1.0) -> Sensed:
    """Level and at rest, with this share of an even load on each foot."""
    count = robot.legs.count
    return under_load(robot, np.tile(share * 9.81 * nominal_body(robot).mass / count * UP, (count, 1)))


def glide(
    estimator: BaseEstimator, sensed: Sensed, velocity: np.ndarray, yaws: np.ndarray, dt_s: float = 0.004
) -> None:
    """Walk at a body velocity (3,), m/s, through these headings; swings of the feet are not simulated."""
    legs, pose, arm = ROBOT.legs, ROBOT.legs.pose(sensed.joint_position), imu_position(ROBOT)
    contact = pose.jacobian + legs.rolling_offset(pose.axes, UP)
    for before, yaw in pairwise(yaws):
        rate = (yaw - before) / dt_s
        passing = velocity + rate * np.cross(UP, pose.foot)
        rates = legs.joint_rates(contact, -passing[:, :, None])[:, :, 0]
        centripetal = rate * np.cross(UP, velocity + rate * np.cross(UP, arm))
        moving = sensed._replace(gyro=rate * UP, acceleration=9.81 * UP + centripetal, quaternion=yawed(yaw))
        moving = moving._replace(joint_velocity=legs.scatter(rates, np.zeros(12)))
        estimator.update(moving, np.ones(4), dt_s)


class TestPose:
    @settings(max_examples=10, deadline=None)
    @given(st.floats(-3.1, 3.1), st.integers(0, 1000))
    def test_the_imus_north_has_no_effect(self, north: float, seed: int) -> None:
        """The same readings with another constant yaw give the same motion and the same odometry."""
        rng = np.random.default_rng(seed)
        original, turned = BaseEstimator(ROBOT), BaseEstimator(ROBOT)
        rest = DirectPlant(ROBOT).sensed()
        for tick in range(25):
            sensed = Sensed(*(part + 0.05 * rng.standard_normal(part.shape) for part in rest))
            sensed = sensed._replace(quaternion=sensed.quaternion / np.linalg.norm(sensed.quaternion))
            other = sensed._replace(quaternion=multiply(yawed(north), sensed.quaternion))
            if tick == 0:
                original.reset(sensed)
                turned.reset(other)
            original.update(sensed, None, 0.004)
            turned.update(other, None, 0.004)
        for one, same in zip(original.odometry(), turned.odometry(), strict=True):
            np.testing.assert_allclose(one, same, atol=1e-9)

    def test_the_covariance_is_in_axes_of_the_heading(self) -> None:
        """After a straight walk, yaw drift acts across the path and scale error along it, for any north."""
        velocity = np.array([0.5, 0.0, 0.0])
        config = EstimatorConfig()
        config = replace(config, odometry=replace(config.odometry, yaw_drift=0.05, scale_error=0.1, slip=0.0))
        estimator, sensed = BaseEstimator(ROBOT, config), held()
        estimator.reset(sensed._replace(quaternion=yawed(1.2)))
        glide(estimator, sensed, velocity, np.full(250, 1.2))
        estimator.start()
        glide(estimator, sensed, velocity, np.full(501, 1.2), 0.008)
        found = estimator.odometry().covariance
        assert found[0, 0] == pytest.approx((0.1 * 2.0) ** 2, rel=0.02)
        assert found[1, 1] == pytest.approx(0.25 * 0.0025 * 4**3 / 3, rel=0.02)
        assert found[1, YAW] == pytest.approx(0.5 * 0.0025 * 4**2 / 2, rel=0.02)
        assert found[YAW, YAW] == pytest.approx(0.0025 * 4 + config.odometry.orientation_noise**2)
        assert abs(found[0, 1]) < 1e-3
        np.testing.assert_allclose(found, found.T, atol=1e-12)


class TestHeight:
    def test_the_height_is_that_over_the_centre_of_standing_feet(self) -> None:
        """All feet stand at first; then the two left feet are raised by bent knees and carry no load."""
        robot, standing = ROBOT, held()
        estimator = BaseEstimator(robot)
        estimator.reset(standing)
        _, height = estimator.update(standing, None, 0.002)
        assert height == pytest.approx(-robot.legs.default_foot[:, 2].mean(), abs=1e-6)
        pose, torque = standing.joint_position.copy(), standing.joint_torque.copy()
        pose[[robot.joint_index(f"{leg}_calf_joint") for leg in ("FL", "RL")]] -= 0.5
        left = robot.legs.joints[[1, 3]].ravel()
        torque[left] = held(share=0.0).joint_torque[left]
        sensed = standing._replace(joint_position=pose, joint_torque=torque)
        estimator = BaseEstimator(robot)
        estimator.reset(sensed)
        for _ in range(200):
            _, height = estimator.update(sensed, None, 0.002)
        feet = robot.legs.pose(pose).foot[:, 2]
        assert feet[1] - feet[0] > 0.03
        assert height == pytest.approx(-feet[[0, 2]].mean(), abs=1e-3)

    @pytest.mark.parametrize("level", [True, False])
    def test_z_is_the_height_on_level_ground_and_integrated_elsewhere(self, level: bool) -> None:
        """Each foot stands higher than the last one, as on stairs climbed at 0.2 m/s.

        With level ground assumed, z stays the height.
        """
        config = EstimatorConfig()
        config = replace(config, odometry=replace(config.odometry, level_ground=level))
        climbing = np.array([0.3, 0.0, 0.2])
        estimator, sensed = BaseEstimator(ROBOT, config), held()
        estimator.reset(sensed)
        glide(estimator, sensed, climbing, np.zeros(250))
        estimator.start()
        glide(estimator, sensed, climbing, np.zeros(251), 0.008)
        assert estimator.odometry().position[2] == pytest.approx(0.0 if level else 0.4, abs=5e-3)
        assert (estimator.odometry().covariance[2, 2] < 1e-4) == level


def test_a_sole_that_tips_over_its_toes_carries_the_base_forward(bodies: dict[str, Robot]) -> None:
    """Base and foot rotate together about the toes: joints rest, and the base moves at w x r."""
    robot = bodies[SOLES]
    pitch, rate = 0.15, 0.6
    turn = np.array([np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0])
    up = np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
    sensed = held(robot)._replace(gyro=np.array([0.0, rate, 0.0]), quaternion=turn)
    sensed = sensed._replace(acceleration=9.81 * up)
    estimator = BaseEstimator(robot, EstimatorConfig(gyro=CERTAIN_GYRO))
    estimator.reset(sensed)
    for _ in range(500):
        found, _ = estimator.update(sensed, None, 0.002)
    feet = robot.legs.default_foot
    toes = np.array([feet[0] + [0.07, 0.0, 0.0] - 0.012 * up, feet[1] + [0.09, 0.0, -0.01]])
    expected = np.cross([0.0, rate, 0.0], -toes.mean(axis=0))
    np.testing.assert_allclose(found, expected, atol=0.01)
