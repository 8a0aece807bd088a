"""The `cyclonedds` back end, for computers without ROS 2 (extra `ros2`): topics only."""
