"""The base estimator's own attitude: gyro, accelerometer and legs, without the IMU's orientation."""

import numpy as np
from direct_plant import DirectPlant, walk
from scipy.spatial.transform import Rotation

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.estimation.attitude import attitude_at_rest, leveled
from footfall.deploy.estimation.config import AttitudeConfig, EstimatorConfig, GyroConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.controllers.walk import Walk
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot

UP = np.array([0.0, 0.0, 1.0])
LEANING = Rotation.from_euler("xy", [2.0, -2.0], degrees=True)  # error of the first orientation


class Blind:
    """An estimator that never gets a correct orientation; records the error of its tilt."""

    def __init__(self, plant: DirectPlant) -> None:
        # The orientations after the first one are wrong: the gyro has a bias.
        unknown = GyroConfig(bias_half_s=1e6)
        self._plant = plant
        self._estimator = BaseEstimator(plant.robot, EstimatorConfig(own_attitude=True, gyro=unknown))
        self.tilt_errors: list[float] = []  # degrees

    def reset(self, sensed: Sensed) -> None:
        wrong = Rotation.from_quat(sensed.quaternion, scalar_first=True) * LEANING
        self._estimator.reset(sensed._replace(quaternion=wrong.as_quat(scalar_first=True)))

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        found = self._estimator.update(sensed._replace(quaternion=np.eye(4)[0]), stance, dt_s)
        orientation = Rotation.from_quat(self._estimator.odometry().orientation, scalar_first=True)
        true = Rotation.from_quat(self._plant.data.qpos[3:7], scalar_first=True)
        error = np.linalg.norm(orientation.inv().apply(UP) - true.inv().apply(UP))
        self.tilt_errors.append(float(np.degrees(error)))
        return found


def test_standing_legs_correct_the_tilt_of_a_robot_that_trots(go1: Robot) -> None:
    plant = DirectPlant(go1, seed=1)
    blind = Blind(plant)
    walk(Walk(go1, "trot"), plant, lambda _: np.array([0.4, 0.1, 0.4]), 4.0, blind)
    assert blind.tilt_errors[0] > 2.0
    assert np.sqrt(np.mean(np.square(blind.tilt_errors[-500:]))) < 1.0


def test_a_wrong_tilt_appears_as_a_horizontal_accelerometer_bias() -> None:
    true, config = Rotation.from_euler("xy", [0.1, -0.2]), AttitudeConfig()
    wrong = true * Rotation.from_euler("xy", [0.02, 0.01])
    attitude = attitude_at_rest((0.0, 0.0, 0.0), tuple(wrong.inv().apply(UP).tolist()), config)
    bias = GRAVITY_M_S2 * (true.inv().apply(UP) - wrong.inv().apply(UP))
    corrected, left = leveled(attitude, bias.tolist(), config)
    found = Rotation.from_quat(corrected.quaternion, scalar_first=True)
    assert np.linalg.norm(found.inv().apply(UP) - true.inv().apply(UP)) < 3e-4  # second order
    assert np.linalg.norm(left) < 0.02 * np.linalg.norm(bias)


def test_tilt_that_legs_keep_correcting_is_the_gyros_bias() -> None:
    """Corrections turn the vertical towards x: the body turns faster about y than the gyro reports."""
    config = AttitudeConfig()
    attitude = attitude_at_rest((0.0, 0.0, 0.0), (0.0, 0.0, GRAVITY_M_S2), config)
    corrected, _ = leveled(attitude, [0.1, 0.0, 0.0], config)
    turn = Rotation.from_quat(corrected.quaternion, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(corrected.bias, -config.legs_bias_hz * turn, rtol=1e-3)
    assert turn[1] < 0.0
