"""The motion filter, against textbook formulas."""

import numpy as np
import pytest
from moments import UP, about
from scipy.spatial.transform import Rotation

from footfall.deploy.estimation.config import FilterConfig
from footfall.deploy.estimation.filter import MotionFilter

LEVEL = np.eye(3).tolist()
NO_OUTLIERS = FilterConfig(outlier_freedom=1e12, push_m_s=1e6)  # a plain Kalman filter


def matrix(motion: MotionFilter) -> np.ndarray:
    """The covariance of (p, v, b) of one axis."""
    m = motion
    return np.array([[m.pp, m.pv, m.pb], [m.pv, m.vv, m.vb], [m.pb, m.vb, m.bb]])


def coupled(seed: int = 3) -> MotionFilter:
    """A filter with a full covariance: all of its numbers differ."""
    rng = np.random.default_rng(seed)
    motion = MotionFilter(NO_OUTLIERS)
    root = 0.02 * rng.standard_normal((3, 3))
    cov = root @ root.T + 1e-5 * np.eye(3)
    motion.pp, motion.pv, motion.pb, motion.vv, motion.vb, motion.bb = cov[np.triu_indices(3)].tolist()
    motion.position, motion.velocity, motion.bias = rng.standard_normal((3, 3)).tolist()
    return motion


class TestFilter:
    def test_prediction_follows_the_textbook(self) -> None:
        """The covariance is F P F' + Q with p' = p + v dt, v' = v + (a - b) dt; a: mean of two readings."""
        config, dt_s, turn = NO_OUTLIERS, 0.003, about("x", 0.3)
        motion = coupled()
        position, velocity, bias = np.array([motion.position, motion.velocity, motion.bias])
        forces = np.array([[1.0, -2.0, 11.0], [1.5, -2.5, 10.0]])
        motion.predict(forces[0].tolist(), turn.tolist(), 0.0)
        before = matrix(motion)
        motion.predict(forces[1].tolist(), turn.tolist(), dt_s)

        acceleration = turn @ (forces.mean(axis=0) - bias) - 9.81 * UP
        np.testing.assert_allclose(motion.velocity, velocity + dt_s * acceleration)
        np.testing.assert_allclose(motion.position, position + dt_s * velocity + dt_s**2 / 2 * acceleration)
        transition = np.array([[1.0, dt_s, 0.0], [0.0, 1.0, -dt_s], [0.0, 0.0, 1.0]])
        change = (0.5**2 + 0.5**2 + 1.0**2) / 3
        noise = config.acceleration_noise**2 + config.acceleration_change**2 * change
        added = np.diag([0.0, noise * dt_s**2, config.acceleration_bias_drift**2 * dt_s])
        np.testing.assert_allclose(matrix(motion), transition @ before @ transition.T + added, rtol=1e-10)

    def test_correction_follows_the_textbook(self) -> None:
        """Each leg measures v, with a noise that grows as its contact falls."""
        config, motion = NO_OUTLIERS, coupled()
        state = np.array([motion.position, motion.velocity, motion.bias])
        covariance = matrix(motion)
        velocities = np.random.default_rng(5).standard_normal((4, 3))
        contact = np.array([1.0, 0.6, 0.0, 0.3])
        motion.correct(velocities.tolist(), contact.tolist(), LEVEL, 0.002)

        measures = np.tile([0.0, 1.0, 0.0], (4, 1))
        noise = np.diag(config.leg_velocity_noise * np.array([1.0, 1 / 0.36, 1000.0, 1 / 0.09])) ** 2
        gain = covariance @ measures.T @ np.linalg.inv(measures @ covariance @ measures.T + noise)
        state += gain @ (velocities - measures @ state)
        np.testing.assert_allclose([motion.position, motion.velocity, motion.bias], state, rtol=1e-9)
        np.testing.assert_allclose(matrix(motion), (np.eye(3) - gain @ measures) @ covariance, rtol=1e-7)

    def test_the_accelerometers_bias_is_in_body_axes(self) -> None:
        """The legs' correction in the body's axes is R' e for any orientation, by scipy."""
        for seed, turn in enumerate(Rotation.random(4, random_state=1)):
            motion, error = coupled(seed=seed), np.array([0.1, -0.2, 0.3])
            bias, seen = np.array(motion.bias), np.array(motion.velocity) + error
            share = motion.vb / (motion.vv + NO_OUTLIERS.leg_velocity_noise**2)
            motion.correct([seen.tolist()], [1.0], turn.as_matrix().tolist(), 0.002)
            np.testing.assert_allclose(motion.bias, bias + share * turn.inv().apply(error), rtol=1e-9)

    def test_the_weight_of_an_outlier(self) -> None:
        """The weight is Student's: misfit d = e'e / (3 (P + R)), noise R (1 + d / freedom)."""
        motion = MotionFilter(FilterConfig(push_m_s=1e6))
        motion.vv, noise = 4e-4, 9e-4
        motion.correct([[0.3, 0.0, 0.0]], [1.0], LEVEL, 0.002)
        misfit = 0.09 / (3 * (4e-4 + noise))
        assert motion.velocity[0] == pytest.approx(0.3 * 4e-4 / (4e-4 + noise * (1 + misfit / 4.0)))

    @pytest.mark.parametrize("axis", [0, 1, 2])
    @pytest.mark.parametrize(("ticks", "follows"), [(1, False), (15, True)])
    def test_the_velocity_follows_a_push_that_lasts(self, ticks: int, follows: bool, axis: int) -> None:
        """All legs measure 0.4 m/s, the accelerometer nothing: a shock lasts 2 ms, a push 30 ms."""
        motion = MotionFilter(FilterConfig())
        motion.predict([0.0, 0.0, 9.81], LEVEL, 0.002)
        for velocity in [np.zeros(3)] * 500 + [0.4 * np.eye(3)[axis]] * ticks:
            motion.predict([0.0, 0.0, 9.81], LEVEL, 0.002)
            motion.correct([velocity.tolist()] * 2, [1.0, 1.0], LEVEL, 0.002)
        assert (motion.velocity[axis] > 0.35) == follows
        assert (motion.velocity[axis] < 0.02) != follows
