"""A bridge for height scans without ROS."""
