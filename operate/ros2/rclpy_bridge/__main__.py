"""The bridge process: `python -m footfall.operate.ros2.rclpy_bridge --feed SOCKET [--steer SOCKET]`."""

import sys
from collections.abc import Sequence

import rclpy
from rclpy.node import Node

from footfall.operate.ros2.arguments import parse
from footfall.operate.ros2.rclpy_bridge.publishing import Publishing
from footfall.operate.ros2.rclpy_bridge.spinning import spin_node
from footfall.operate.ros2.rclpy_bridge.steering import Steering
from footfall.operate.ros2.reading import Reading
from footfall.operate.ros2.table import NODE


def main(arguments: Sequence[str]) -> None:
    """Run until the end of the run or of the parent process."""
    options, ros_arguments = parse("rclpy_bridge", arguments)

    def begin(node: Node) -> None:
        publishing = Publishing(node)
        if options.steer is not None:
            Steering(node, options.steer, options.stamped)
        Reading(options, publishing.pass_on, rclpy.try_shutdown)

    spin_node(NODE, ros_arguments, begin)


if __name__ == "__main__":
    main(sys.argv[1:])
