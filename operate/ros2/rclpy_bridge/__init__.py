"""The `rclpy` back end, which the robot's own ROS Python runs: it needs `rclpy` and message packages."""
