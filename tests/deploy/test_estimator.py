"""The base estimator, against the true motion of a simulated robot, and on readings made by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up import SOLES
from moments import UP, under_load

from footfall import Policy, Robot, load_policy, load_robot
from footfall.common.rotations import heading, multiply
from footfall.deploy.estimation.config import EstimatorConfig, GyroConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.estimation.odometry import YAW, Odometry
from footfall.policies.policy import Sensed
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")


def yawed(angle: float) -> np.ndarray:
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def follow(policy: Policy, duration_s: float) -> tuple[list[Odometry], np.ndarray, np.ndarray, np.ndarray]:
    """Walk a curve; returns odometry, its errors (position, velocity), the truth (and yaw), foot contact."""
    estimator, plant = BaseEstimator(ROBOT), DirectPlant(ROBOT, seed=1)
    poses, truth, touches = [], [], []

    def note(_: float, plant: DirectPlant) -> None:
        poses.append(estimator.odometry())
        truth.append([*plant.data.qpos[:3], *plant.velocity(), heading(plant.data.qpos[3:7])])
        touches.append(plant.data.ncon > 0)

    walk(policy, plant, lambda _: np.array([0.4, 0.1, 0.4]), duration_s, estimator, on_tick=note)
    poses, true = poses[1:], np.array(truth[:-1])  # an estimate is one step of the plant older than the truth
    true[:, :3] -= true[0, :3]
    error = np.array([[*o.position, *o.velocity] for o in poses]) - true[:, :6]
    return poses, error, true, np.array(touches[:-1])


def test_in_flight_no_foot_stands_and_the_imu_carries_on() -> None:
    """Two seconds of a pronk without a plan. The height is less certain the longer the flight."""
    policy = load_policy("pronk", ROBOT)
    policy.stance = lambda: None  # type: ignore[method-assign]
    poses, error, _, touches = follow(policy, 2.0)
    in_flight = np.array([pose.contact for pose in poses])[~touches]
    assert len(in_flight) > 200
    assert in_flight.max() < 0.1
    assert np.abs(error[:, :3]).max() < 0.03
    assert np.sqrt((error[400:, 3:] ** 2).mean(axis=0)).max() < 0.05
    deviation = np.array([pose.covariance[2, 2] for pose in poses]) ** 0.5
    off = np.flatnonzero(touches[600:-40] & ~touches[601:-39])[0] + 600
    assert (np.diff(deviation[off + 10 : off + 40]) > 0.0).all()
    assert deviation[off + 40] > 1.01 * deviation[off - 20]


@pytest.mark.parametrize("planned", [True, False])
def test_the_estimate_follows_the_motion(planned: bool) -> None:
    """The position drifts by less than a fiftieth of the distance; velocity and yaw are accurate."""
    policy = load_policy("trot", ROBOT)
    if not planned:  # as learned policies
        policy.stance = lambda: None  # type: ignore[method-assign]
    poses, error, true, _ = follow(policy, 3.0)
    distance = np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1).sum()
    assert distance > 0.9
    assert np.linalg.norm(error[-1, :2]) < 0.02 * distance
    assert np.abs(error[:, 2]).max() < 0.01
    assert (np.sqrt((error[500:, 3:] ** 2).mean(axis=0)) < [0.015, 0.015, 0.03]).all()
    assert np.abs(error[500:, 3:5].mean(axis=0)).max() < 0.005
    assert true[-1, 6] > 0.8
    assert poses[-1].yaw == pytest.approx(true[-1, 6], abs=0.03)


# -- readings made by hand ---------------------------------------------------------------------------


def held(robot: Robot = ROBOT, share: float = 1.0) -> Sensed:
    """Level and at rest, with this share of an even load on each foot."""
    count = robot.legs.count
    return under_load(robot, np.tile(share * 9.81 * nominal_body(robot).mass / count * UP, (count, 1)))


def glide(velocity: list[float], yaw: float = 0.0, **odometry: Any) -> Odometry:
    """Odometry of 4 s at a velocity (3,), m/s, in body axes, after 1 s of the same; no foot swings."""
    config = EstimatorConfig()
    config = replace(config, odometry=replace(config.odometry, **odometry))
    legs, sensed = ROBOT.legs, held()._replace(quaternion=yawed(yaw))
    pose = legs.pose(sensed.joint_position)
    contact = pose.jacobian + legs.rolling_offset(pose.axes, UP)
    rates = legs.joint_rates(contact, -np.tile(velocity, (4, 1))[:, :, None])[:, :, 0]
    moving = sensed._replace(joint_velocity=legs.scatter(rates, np.zeros(12)))
    estimator = BaseEstimator(ROBOT, config)
    estimator.reset(sensed)
    for ticks, dt_s in ((250, 0.004), (500, 0.008)):
        estimator.start()
        for _ in range(ticks):
            estimator.update(moving, np.ones(4), dt_s)
    return estimator.odometry()


@settings(max_examples=10, deadline=None)
@given(st.floats(-3.1, 3.1), st.integers(0, 1000))
def test_the_imus_north_has_no_effect(north: float, seed: int) -> None:
    """The same readings with another constant yaw give the same motion and the same odometry."""
    rng = np.random.default_rng(seed)
    original, turned = BaseEstimator(ROBOT), BaseEstimator(ROBOT)
    rest = DirectPlant(ROBOT).sensed()
    for tick in range(25):
        sensed = Sensed(*(part + 0.05 * rng.standard_normal(part.shape) for part in rest))
        sensed = sensed._replace(quaternion=sensed.quaternion / np.linalg.norm(sensed.quaternion))
        other = sensed._replace(quaternion=multiply(yawed(north), sensed.quaternion))
        for estimator, readings in ((original, sensed), (turned, other)):
            if tick == 0:
                estimator.reset(readings)
            estimator.update(readings, None, 0.004)
    for one, same in zip(original.odometry(), turned.odometry(), strict=True):
        np.testing.assert_allclose(one, same, atol=1e-9)


def test_the_covariance_is_in_axes_of_the_heading() -> None:
    """After a straight walk, yaw drift acts across the path and scale error along it, for any north."""
    found = glide([0.5, 0.0, 0.0], 1.2, yaw_drift=0.05, scale_error=0.1, slip=0.0).covariance
    assert found[0, 0] == pytest.approx((0.1 * 2.0) ** 2, rel=0.02)
    assert found[1, 1] == pytest.approx(0.25 * 0.0025 * 4**3 / 3, rel=0.02)
    assert found[1, YAW] == pytest.approx(0.5 * 0.0025 * 4**2 / 2, rel=0.02)
    assert found[YAW, YAW] == pytest.approx(0.0025 * 4 + EstimatorConfig().odometry.orientation_noise ** 2)
    assert abs(found[0, 1]) < 1e-3
    np.testing.assert_allclose(found, found.T, atol=1e-12)


@pytest.mark.parametrize("level", [True, False])
def test_z_is_the_height_on_level_ground_and_integrated_elsewhere(level: bool) -> None:
    """On stairs climbed at 0.2 m/s. With level ground assumed, z stays the height."""
    found = glide([0.3, 0.0, 0.2], level_ground=level)
    assert found.position[2] == pytest.approx(0.0 if level else 0.8, abs=5e-3)
    assert (found.covariance[2, 2] < 1e-4) == level


def test_the_height_is_that_over_the_centre_of_standing_feet() -> None:
    """All feet stand at first; then the two left feet are raised by bent knees and carry no load."""
    standing = held()
    pose, torque = standing.joint_position.copy(), standing.joint_torque.copy()
    pose[[ROBOT.joint_index(f"{leg}_calf_joint") for leg in ("FL", "RL")]] -= 0.5
    left = ROBOT.legs.joints[[1, 3]].ravel()
    torque[left] = held(share=0.0).joint_torque[left]
    raised = standing._replace(joint_position=pose, joint_torque=torque)
    feet = ROBOT.legs.pose(pose).foot[:, 2]
    assert feet[1] - feet[0] > 0.03
    for sensed, ticks, expected, atol in (
        (standing, 1, -ROBOT.legs.default_foot[:, 2].mean(), 1e-6),
        (raised, 200, -feet[[0, 2]].mean(), 1e-3),
    ):
        estimator = BaseEstimator(ROBOT)
        estimator.reset(sensed)
        for _ in range(ticks):
            _, height = estimator.update(sensed, None, 0.002)
        assert height == pytest.approx(expected, abs=atol)


def test_a_sole_that_tips_over_its_toes_carries_the_base_forward(bodies: dict[str, Robot]) -> None:
    """Base and foot rotate together about the toes: joints rest, and the base moves at w x r."""
    robot, pitch, rate = bodies[SOLES], 0.15, np.array([0.0, 0.6, 0.0])
    turn = np.array([np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0])
    up = np.array([-np.sin(pitch), 0.0, np.cos(pitch)])
    sensed = held(robot)._replace(gyro=rate, quaternion=turn, acceleration=9.81 * up)
    certain = GyroConfig(bias_half_s=1e6)  # the readings give the yaw rate, never the yaw
    estimator = BaseEstimator(robot, EstimatorConfig(gyro=certain))
    estimator.reset(sensed)
    for _ in range(500):
        found, _ = estimator.update(sensed, None, 0.002)
    feet = robot.legs.default_foot
    toes = np.array([feet[0] + [0.07, 0.0, 0.0] - 0.012 * up, feet[1] + [0.09, 0.0, -0.01]])
    np.testing.assert_allclose(found, np.cross(rate, -toes.mean(axis=0)), atol=0.01)
