"""Telemetry of a run: encoded once as ROS 2 messages, for its log and its live subscribers."""
