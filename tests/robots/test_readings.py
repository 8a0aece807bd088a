"""Readings as a dictionary and as one vector."""

import numpy as np

from footfall.robots.readings import READINGS, Sensed, as_vector, from_vector, read, readings_size

# Turned left by 90 degrees, then nose down by 30: gravity lies forward and down in the body frame.
HALF = np.pi / 12
YAWED_AND_PITCHED = np.sqrt(0.5) * np.array([np.cos(HALF), -np.sin(HALF), np.sin(HALF), np.cos(HALF)])
SENSED = Sensed(
    gyro=np.array([1.0, 2.0, 3.0]),
    acceleration=np.array([4.0, 5.0, 6.0]),
    quaternion=YAWED_AND_PITCHED,
    joint_position=np.array([0.1, 0.2]),
    joint_velocity=np.array([-7.0, -8.0]),
    joint_torque=np.array([70.0, 80.0]),
)


def test_a_policy_may_use_four_readings() -> None:
    seen = read(SENSED)
    assert list(seen) == ["gyro", "gravity", "joint_position", "joint_velocity"] == list(READINGS)
    assert seen["gyro"].tolist() == [1.0, 2.0, 3.0]
    np.testing.assert_allclose(seen["gravity"], [0.5, 0.0, -np.sqrt(0.75)], atol=1e-12)
    assert seen["joint_position"].tolist() == [0.1, 0.2]
    assert seen["joint_velocity"].tolist() == [-7.0, -8.0]
    assert [name for name, each in READINGS.items() if each.unit_length] == ["gravity"]


def test_a_vector_of_readings_is_split_into_the_same_readings() -> None:
    seen = read(SENSED)
    vector = as_vector(seen)
    assert readings_size(2) == len(vector) == 10
    np.testing.assert_allclose(vector, [1, 2, 3, 0.5, 0, -np.sqrt(0.75), 0.1, 0.2, -7, -8], atol=1e-12)
    batch = as_vector({name: np.stack([value, 2 * value]) for name, value in seen.items()})
    assert batch.shape == (2, 10)
    for name, part in from_vector(batch, joints=2).items():
        np.testing.assert_array_equal(part, [seen[name], 2 * seen[name]])
