"""What a run tells: encoded once as ROS 2 messages, for its log and for whoever looks at it meanwhile."""
