"""How the base moves and where it is, from what the robot senses of itself.

`BaseEstimator` puts five parts together: which feet stand (`contact`), where they touch the ground (`feet`),
what the gyro reads too much (`gyro`), a Kalman filter on accelerometer and standing legs (`filter`), and how
sure the pose is (`odometry`).
"""
