"""The `rclpy` back end, for the robot's own ROS Python: it requires `rclpy` and message packages."""
