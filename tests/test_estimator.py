"""The base estimator, against the true motion of a simulated robot."""

import timeit

import numpy as np
import pytest
from direct_plant import DirectPlant, walk

from footfall.deploy.estimator import BaseEstimator
from footfall.policies.controllers.trot import Trot
from footfall.policies.policy import Sensed
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")


def at_rest() -> Sensed:
    return DirectPlant(ROBOT).sensed()


class TestStanding:
    def test_a_robot_at_rest_is_at_rest(self) -> None:
        plant, estimator = DirectPlant(ROBOT), BaseEstimator(ROBOT)
        result = walk(Trot(ROBOT), plant, lambda _: np.zeros(3), 2.0, estimator)
        late = np.array(result.estimate)[500:]
        assert np.abs(late).max() < 0.05
        assert np.abs(late.mean(axis=0)).max() < 0.005

    def test_height_is_that_of_the_base_above_the_feet(self) -> None:
        plant, estimator = DirectPlant(ROBOT), BaseEstimator(ROBOT)
        walk(Trot(ROBOT), plant, lambda _: np.zeros(3), 1.0, estimator)
        _, height = estimator.update(plant.sensed(), None, 0.002)
        assert height == pytest.approx(plant.height(), abs=0.005)


class TestWalking:
    @pytest.mark.parametrize("command", [(0.5, 0.0, 0.0), (0.0, 0.3, 0.0), (0.4, 0.1, 0.5)])
    def test_velocity_follows_the_truth(self, command: tuple[float, float, float]) -> None:
        plant, estimator = DirectPlant(ROBOT), BaseEstimator(ROBOT)
        result = walk(Trot(ROBOT), plant, lambda _: np.array(command), 4.0, estimator)
        # An estimate is of the state before the tick, the record of the state after it.
        error = (np.array(result.estimate)[1:] - np.array(result.velocity)[:-1])[500:]
        assert np.sqrt((error**2).mean(axis=0)).max() < 0.05
        assert np.abs(error.mean(axis=0)).max() < 0.03

    def test_a_push_shows_at_once(self) -> None:
        plant, estimator = DirectPlant(ROBOT), BaseEstimator(ROBOT)
        push = (1.0, np.array([0.0, 0.4, 0.0]))
        result = walk(Trot(ROBOT), plant, lambda _: np.zeros(3), 1.1, estimator, push)
        soon = 530  # 60 ms after
        truth, estimate = result.velocity[soon - 1][1], result.estimate[soon][1]
        assert estimate == pytest.approx(truth, abs=0.1)


class TestContacts:
    def test_without_a_plan_contacts_come_from_the_torques(self) -> None:
        class Unplanned(Trot):
            def stance(self) -> None:  # type: ignore[override]
                return None

        plant, estimator = DirectPlant(ROBOT), BaseEstimator(ROBOT)
        result = walk(Unplanned(ROBOT), plant, lambda _: np.array([0.5, 0.0, 0.0]), 4.0, estimator)
        error = (np.array(result.estimate)[1:] - np.array(result.velocity)[:-1])[500:]
        assert np.sqrt((error**2).mean(axis=0))[:2].max() < 0.1

    def test_in_free_fall_the_accelerometer_alone_carries_the_velocity(self) -> None:
        estimator, rest = BaseEstimator(ROBOT), at_rest()
        estimator.reset(rest)
        flying = rest._replace(
            acceleration=np.zeros(3),
            gyro=np.zeros(3),
            joint_velocity=np.zeros_like(rest.joint_velocity),
            joint_torque=np.zeros_like(rest.joint_torque),
        )
        velocity = np.zeros(3)
        for _ in range(100):
            velocity, _ = estimator.update(flying, np.zeros(4), 0.002)
        assert velocity[2] == pytest.approx(-9.81 * 0.2, rel=0.1)

    def test_stays_finite_whatever_comes(self) -> None:
        estimator, rest = BaseEstimator(ROBOT), at_rest()
        estimator.reset(rest)
        rng = np.random.default_rng(0)
        for _ in range(500):
            wild = Sensed(*(part + 10 * rng.standard_normal(part.shape) for part in rest))
            velocity, height = estimator.update(wild, rng.uniform(size=4), 0.002)
            assert np.all(np.isfinite(velocity))
            assert np.isfinite(height)


def test_fast_enough_for_the_joint_rate() -> None:
    estimator, rest, stance = BaseEstimator(ROBOT), at_rest(), np.ones(4)
    estimator.reset(rest)
    best = min(timeit.repeat(lambda: estimator.update(rest, stance, 0.002), number=100, repeat=5))
    assert best / 100 < 500e-6
