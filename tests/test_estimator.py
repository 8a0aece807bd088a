"""The base estimator, against the true motion of a simulated robot."""

import numpy as np
import pytest
from direct_plant import DirectPlant, walk

from footfall.deploy.estimator import BaseEstimator, EstimatorConfig
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


class TestFilter:
    """One step against Kalman's textbook equations, written out for (v, r_1 .. r_4) of one world axis."""

    DT_S, TRUST = 0.002, np.array([1.0, 0.6, 0.0, 0.3])

    def begun(self) -> BaseEstimator:
        """A filter with a covariance that couples everything."""
        estimator = BaseEstimator(ROBOT)
        estimator.reset(at_rest())
        rng = np.random.default_rng(3)
        root = 0.02 * rng.standard_normal((5, 5))
        estimator._covariance = root @ root.T + 1e-5 * np.eye(5)
        estimator._state = rng.standard_normal((5, 3))
        return estimator

    def noise(self) -> np.ndarray:
        return EstimatorConfig().swing_noise ** (2 * (1 - self.TRUST))

    def test_prediction(self) -> None:
        estimator, config, dt_s = self.begun(), EstimatorConfig(), self.DT_S
        state, covariance = estimator._state.copy(), estimator._covariance.copy()
        acceleration, rolling = np.array([1.0, -2.0, 3.0]), np.arange(12.0).reshape(4, 3)
        # d/dt (v, r_i) = (a, u_i - v): exact for constant a and u.
        transition = np.eye(5)
        transition[1:, 0] = -dt_s
        expected = transition @ state
        expected[0] += acceleration * dt_s
        expected[1:] += rolling * dt_s - acceleration * dt_s**2 / 2
        process = np.diag(
            [(config.acceleration_noise * dt_s) ** 2]
            + [(config.foot_drift_noise * dt_s) ** 2 * noise for noise in self.noise()]
        )
        estimator._predict(acceleration, rolling, self.noise(), dt_s)
        np.testing.assert_allclose(estimator._state, expected, rtol=1e-12)
        np.testing.assert_allclose(
            estimator._covariance, transition @ covariance @ transition.T + process, rtol=1e-12
        )

    def test_correction(self) -> None:
        estimator, config = self.begun(), EstimatorConfig()
        state, covariance = estimator._state.copy(), estimator._covariance.copy()
        rng = np.random.default_rng(4)
        velocity, place = rng.standard_normal((2, 4, 3))
        measures = np.zeros((8, 5))  # each leg measures v, then each its own r
        measures[:4, 0] = 1.0
        measures[4:, 1:] = np.eye(4)
        variance = np.diag(
            [*(config.foot_velocity_noise**2 * self.noise()), *[config.foot_place_noise**2] * 4]
        )
        gain = covariance @ measures.T @ np.linalg.inv(measures @ covariance @ measures.T + variance)
        expected = state + gain @ (np.vstack([velocity, place]) - measures @ state)
        estimator._correct(velocity, place, self.noise())
        np.testing.assert_allclose(estimator._state, expected, rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(
            estimator._covariance, (np.eye(5) - gain @ measures) @ covariance, rtol=1e-7, atol=1e-12
        )


class TestReadings:
    """What single readings say, with a filter that is told that nothing stands or everything does."""

    def test_feet_that_stand_under_moving_legs_say_that_the_base_moves(self) -> None:
        """Points of contact go at (-0.3, 0.1, 0) m/s under the base: it goes the opposite way itself."""
        estimator, rest, legs, dt_s = BaseEstimator(ROBOT), at_rest(), ROBOT.legs, 0.002
        up = np.array([0.0, 0.0, 1.0])
        joint = ROBOT.default_pose.copy()
        for tick in range(100):
            pose = legs.pose(joint)
            contact = pose.jacobian + legs.rolling_offset(pose.axes, up)
            rates = np.linalg.solve(contact, np.tile([-0.3, 0.1, 0.0], (4, 1))[:, :, None])[:, :, 0]
            load = contact.transpose(0, 2, 1) @ (estimator._even_force * up)
            sensed = rest._replace(
                quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
                gyro=np.zeros(3),
                acceleration=9.81 * up,
                joint_position=joint,
                joint_velocity=legs.scatter(rates, np.zeros(12)),
                joint_torque=legs.scatter(-load, np.zeros(12)),
            )
            if tick == 0:
                estimator.reset(sensed)
            velocity, height = estimator.update(sensed, np.ones(4), dt_s)
            joint = joint + dt_s * sensed.joint_velocity
        np.testing.assert_allclose(velocity, [0.3, -0.1, 0.0], atol=0.003)
        assert height == pytest.approx(-pose.foot[:, 2].mean(), abs=0.003)

    @pytest.mark.parametrize("force", [0.0, 0.7, 1.0])
    def test_trust_in_a_contact_follows_the_force_on_the_foot(self, force: float) -> None:
        """None below 0.4 of an even share of the weight, full at all of it, half in the middle."""
        estimator, rest = BaseEstimator(ROBOT), at_rest()
        contact = ROBOT.legs.pose(rest.joint_position).jacobian
        share = np.array([0.0, 0.0, force * estimator._even_force])
        load = contact.transpose(0, 2, 1) @ share
        pressed = rest._replace(
            joint_velocity=np.zeros(12), joint_torque=ROBOT.legs.scatter(-load, np.zeros(12))
        )
        estimator.reset(pressed)
        trust = estimator._contact(pressed, contact, np.array([0.0, 0.0, 1.0]), 0.002)
        np.testing.assert_allclose(trust, max(0.0, (force - 0.4) / 0.6), atol=0.01)

    def test_turning_about_the_base_is_no_motion_of_the_base(self) -> None:
        """The accelerometer sits off the base's origin: what it sees of a turn is taken off again."""
        estimator, rest = BaseEstimator(ROBOT), at_rest()
        estimator._imu = np.array([0.1, 0.0, 0.0])
        turning = rest._replace(quaternion=np.array([1.0, 0.0, 0.0, 0.0]), gyro=np.array([0.0, 0.0, 2.0]))
        estimator.reset(turning)
        estimator._state[0] = [0.0, 0.2, 0.0]  # w x arm
        estimator._covariance[0, 0] = 1e-12
        velocity, _ = estimator.update(
            turning._replace(acceleration=np.array([0.0, 0.0, 9.81])), np.zeros(4), 1e-6
        )
        np.testing.assert_allclose(velocity, 0.0, atol=1e-3)


UP = np.array([0.0, 0.0, 1.0])


def held(share: tuple[float, float, float, float], joint: np.ndarray = ROBOT.default_pose) -> Sensed:
    """Level and at rest, with these shares of an even load on the feet."""
    contact = ROBOT.legs.pose(joint).jacobian.transpose(0, 2, 1)
    load = contact @ (BaseEstimator(ROBOT)._even_force * UP) * np.array(share)[:, None]
    quaternion, zero = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(12)
    return Sensed(np.zeros(3), 9.81 * UP, quaternion, joint, zero, ROBOT.legs.scatter(-load, zero))


class TestPlanAndHeight:
    def test_a_foot_is_trusted_only_where_the_plan_lets_it_stand(self) -> None:
        """Feet that press and slide: with a plan to swing, they say nothing about the base."""
        sliding = held((1, 1, 1, 1))._replace(joint_velocity=np.full(12, 0.5))
        estimator = BaseEstimator(ROBOT)
        moved = {}
        for planned in (0.0, 1.0):
            estimator.reset(sliding)
            moved[planned] = np.linalg.norm(estimator.update(sliding, np.full(4, planned), 0.002)[0])
        assert moved[0.0] < 1e-4
        assert moved[1.0] > 0.01

    def test_held_in_the_air_it_does_not_move(self) -> None:
        estimator, hanging = BaseEstimator(ROBOT), held((0, 0, 0, 0))
        estimator.reset(hanging)
        for _ in range(100):
            velocity, _ = estimator.update(hanging, None, 0.002)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-6)

    def test_in_a_fall_the_height_goes_down_with_the_velocity(self) -> None:
        """A quarter of a tenth of a second: g t^2 / 2 is 3 mm."""
        estimator, hanging = BaseEstimator(ROBOT), held((0, 0, 0, 0))
        falling = hanging._replace(acceleration=np.zeros(3))
        estimator.reset(falling)
        heights = [estimator.update(falling, None, 0.001)[1] for _ in range(25)]
        assert heights[0] - heights[-1] == pytest.approx(9.81 * 0.025**2 / 2, rel=0.15)

    def test_height_is_above_the_feet_that_stand(self) -> None:
        """One diagonal is lifted by 5 cm and carries nothing."""
        legs = ROBOT.legs
        feet = legs.default_foot + np.array([0.0, 0.05, 0.05, 0.0])[:, None] * UP
        joint = legs.scatter(legs.solve(feet), ROBOT.default_pose)
        estimator, lifted = BaseEstimator(ROBOT), held((1, 0, 0, 1), joint)
        estimator.reset(lifted)
        for _ in range(50):
            _, height = estimator.update(lifted, None, 0.002)
        assert height == pytest.approx(-legs.default_foot[:, 2].mean(), abs=0.001)

    def test_a_second_episode_is_the_first_to_the_bit(self) -> None:
        estimator = BaseEstimator(ROBOT)

        def episode(*shares: tuple[float, float, float, float]) -> list[float]:
            moving = [held(share)._replace(joint_velocity=np.linspace(-1.0, 1.0, 12)) for share in shares]
            estimator.reset(moving[0])
            seen = [estimator.update(each, None, 0.002) for each in moving]
            return [number for velocity, height in seen for number in (*velocity, height)]

        first = episode((0, 0, 0, 0), (1, 1, 0, 1), (1, 0, 0.5, 1))
        episode((1, 1, 1, 1), (2, 0, 0, 2))
        assert episode((0, 0, 0, 0), (1, 1, 0, 1), (1, 0, 0.5, 1)) == first
