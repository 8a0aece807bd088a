"""Attitude without the IMU's orientation: by the base estimator, and by the filter of inertial readings."""

import numpy as np
import pytest
from changed_robots import described
from deploy_policies import Hold, short_episode
from direct_plant import DirectPlant, walk
from scipy.spatial.transform import Rotation

from footfall import Push, Robot, load_policy, run_episode
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import rotation_matrix
from footfall.deploy.estimation.attitude import attitude_at_rest, leveled
from footfall.deploy.estimation.config import AttitudeConfig, EstimatorConfig, GyroConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.robot import SimulatedRobot
from footfall.policies.controllers.walk import Walk
from footfall.policies.policy import Sensed

UP = np.array([0.0, 0.0, 1.0])
CONFIG = AttitudeConfig()


def turn(quaternion: np.ndarray | tuple) -> Rotation:
    return Rotation.from_quat(quaternion, scalar_first=True)


class Blind:
    """An estimator that never gets a correct orientation; records the error of its tilt."""

    def __init__(self, plant: DirectPlant) -> None:
        # The orientations after the first one are wrong: the gyro has a bias.
        config = EstimatorConfig(own_attitude=True, gyro=GyroConfig(bias_half_s=1e6))
        self._plant, self._estimator = plant, BaseEstimator(plant.robot, config)
        self.tilt_errors: list[float] = []  # degrees

    def reset(self, sensed: Sensed) -> None:
        wrong = turn(sensed.quaternion) * Rotation.from_euler("xy", [2.0, -2.0], degrees=True)
        self._estimator.reset(sensed._replace(quaternion=wrong.as_quat(scalar_first=True)))

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        found = self._estimator.update(sensed._replace(quaternion=np.eye(4)[0]), stance, dt_s)
        own, true = turn(self._estimator.odometry().orientation), turn(self._plant.data.qpos[3:7])
        error = np.linalg.norm(own.inv().apply(UP) - true.inv().apply(UP))
        self.tilt_errors.append(float(np.degrees(error)))
        return found


class TestEstimator:
    def test_standing_legs_correct_the_tilt_of_a_robot_that_trots(self, go1: Robot) -> None:
        plant = DirectPlant(go1, seed=1)
        blind = Blind(plant)
        walk(Walk(go1, "trot"), plant, lambda _: np.array([0.4, 0.1, 0.4]), 4.0, blind)
        assert blind.tilt_errors[0] > 2.0
        assert np.sqrt(np.mean(np.square(blind.tilt_errors[-500:]))) < 1.0

    def test_a_wrong_tilt_appears_as_a_horizontal_accelerometer_bias(self) -> None:
        true = Rotation.from_euler("xy", [0.1, -0.2])
        wrong = true * Rotation.from_euler("xy", [0.02, 0.01])
        attitude = attitude_at_rest((0.0, 0.0, 0.0), tuple(wrong.inv().apply(UP).tolist()), CONFIG)
        bias = GRAVITY_M_S2 * (true.inv().apply(UP) - wrong.inv().apply(UP))
        corrected, left = leveled(attitude, bias.tolist(), CONFIG)
        tilt_error = turn(corrected.quaternion).inv().apply(UP) - true.inv().apply(UP)
        assert np.linalg.norm(tilt_error) < 3e-4  # second order
        assert np.linalg.norm(left) < 0.02 * np.linalg.norm(bias)

    def test_tilt_that_legs_keep_correcting_is_the_gyros_bias(self) -> None:
        """Corrections turn the vertical towards x: the body turns faster about y than the gyro reports."""
        attitude = attitude_at_rest((0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY_M_S2), CONFIG)
        corrected, _ = leveled(attitude, [0.1, 0.0, 0.0], CONFIG)
        correction = turn(corrected.quaternion).as_rotvec()
        assert correction[1] < 0.0
        np.testing.assert_allclose(corrected.bias, -CONFIG.legs_bias_hz * correction, rtol=1e-3)


class TestFilter:
    """A robot whose IMU gives no orientation."""

    @pytest.fixture
    def robot(self, go1: Robot) -> Robot:
        return described(go1, imu_protocol="footfall-inertial")

    def test_the_tilt_of_a_pushed_robot_is_right_within_a_degree(self, robot: Robot) -> None:
        """The gyro has a bias; the tilt's error is a root mean square."""
        errors = []

        def compare(loop: ControlLoop, body: SimulatedRobot) -> None:
            if loop.walking:
                up = rotation_matrix(loop.sensed.quaternion)[2]
                errors.append(np.linalg.norm(up - rotation_matrix(body.truth().base_quaternion)[2]))

        episode = short_episode(
            command_source=lambda _: np.array([0.8, 0.0, 0.3]),
            duration_s=2.0,
            sample={"gyro_bias": np.array([0.02, -0.015, 0.01])},
            noise=load_scenarios(robot).noise,
            pushes=(Push(0.6, (0.5, 0.0, 0.0)), Push(1.4, (0.0, -0.5, 0.0))),
        )
        trace = run_episode(robot, load_policy("go1-flat", robot), episode, compare)
        assert (trace.fell, trace.faults) == (False, ())
        assert np.degrees(np.sqrt(np.mean(np.square(errors)))) <= 1.0
        assert np.median(trace.base_velocity[50:, 0]) == pytest.approx(0.8, abs=0.2)

    def test_a_robot_that_moves_at_first_may_not_stand_up(self, robot: Robot) -> None:
        """The robot's gyro reads 0.2 rad/s, which the filter would take for a bias."""
        episode = short_episode(sample={"gyro_bias": np.array([0.0, 0.2, 0.0])})
        trace = run_episode(robot, Hold(robot), episode)
        assert (len(trace.faults), len(trace.time_s)) == (1, 0)
