"""A bridge for height scans that speaks to no ROS."""
