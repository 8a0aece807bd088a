"""ROS 2: a run's telemetry as topics, and commands from topics, services, parameters and an action."""
