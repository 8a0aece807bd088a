"""Sends the same scan every 10 ms to the port in its argument, until its standard input ends."""

import math
import sys
import threading

from footfall.operate.ros2.reading import report_ready
from footfall.operate.ros2.scan_sender import scan_sender

if __name__ == "__main__":
    ended = threading.Event()
    with scan_sender(int(sys.argv[1])) as send:
        report_ready(ended.set)
        while not ended.wait(0.01):
            send([-0.3, math.nan, 0.25])
