"""Motion and pose of the base from the robot's own sensors.

`BaseEstimator` combines five parts: contacts of the feet (`contact`), their contact points (`feet`), the
gyro's bias (`gyro`), a Kalman filter on accelerometer and stance legs (`filter`), and the uncertainty of the
pose (`odometry`).
"""
