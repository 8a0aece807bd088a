"""A bridge without ROS: it requests to walk ahead, and reports the path of the run's feed."""

import sys

from footfall.operate.ros2.arguments import parse
from footfall.operate.ros2.link import Link
from footfall.operate.ros2.reading import Reading

if __name__ == "__main__":
    import threading

    options, rest = parse("fake_bridge", sys.argv[1:])
    if "fail" in rest:
        sys.exit("first line\nthe last line says why")
    ended = threading.Event()
    if "hang" in rest:
        ended.wait()
    link = Link(str(options.steer), lambda _: None, lambda _: None)
    Reading(options, lambda message: link.post(note=message.channel.topic), ended.set)
    link.post(velocity=[0.25, 0.0, 0.0])
    ended.wait()
