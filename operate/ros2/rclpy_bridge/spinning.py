"""Runs a ROS node until the process ends."""

import sys
from collections.abc import Callable, Sequence
from contextlib import suppress

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node


def spin_node(name: str, ros_arguments: Sequence[str], begin: Callable[[Node], object]) -> None:
    """Spin a new node until `rclpy.try_shutdown` is called, or Ctrl-C.

    Args:
        name: name of the node.
        ros_arguments: arguments for ROS, such as -r __ns:=/robot.
        begin: sets up the node's publishers and subscriptions.
    """
    rclpy.init(args=[sys.argv[0], *ros_arguments])
    try:
        node = rclpy.create_node(name)
        begin(node)
        with suppress(KeyboardInterrupt, ExternalShutdownException):
            rclpy.spin(node)
    finally:
        rclpy.try_shutdown()
