"""Sends height scans to a policy by real rclpy and checks the policy's inputs in the log; exit 1 if wrong.

    python benchmarks/ros2/scans.py jazzy/bin/python [--backend cyclonedds]

The first argument is a Python with rclpy; docs/ros2.md describes how to install one from PyPI.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from footfall.common.config import unstructure
from footfall.deploy.log_file import read_log
from footfall.deploy.log_numbers import unflatten
from footfall.deploy.replay import INPUTS
from footfall.policies.height_scan import height_scan_of
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

sys.path.insert(0, str(Path(__file__).parents[1]))

from relaxed_limits import RELAXED

DOMAIN = "88"  # only for these checks
POLICY, WALKING_S, SENDING_S, START_S = "go1-rough", 10.0, 6.0, 60.0
PUBLISHER = """
import sys, time, rclpy
from std_msgs.msg import Float32MultiArray
rclpy.init()
node = rclpy.create_node("mapper")
publisher = node.create_publisher(Float32MultiArray, "/height_scan", 1)
size = int(sys.argv[1])
while not publisher.get_subscription_count():
    time.sleep(0.02)
print("received", flush=True)
end_s = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end_s:
    wrong_size = time.monotonic() > end_s - 1.0
    publisher.publish(Float32MultiArray(data=[-0.3 + 0.001 * i for i in range(3 if wrong_size else size)]))
    time.sleep(0.04)
"""


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("python", type=Path, help="a Python that has rclpy")
    parser.add_argument("--priority", type=int, help="SCHED_FIFO priority of the loop, for a busy computer")
    parser.add_argument("--backend", choices=("rclpy", "cyclonedds"), default="rclpy")
    options = parser.parse_args()
    robot = load_robot("go1")
    scan = height_scan_of(load_policy(POLICY, robot).contract)
    assert scan is not None
    environment = {**os.environ, "ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config, ros, log, result = (
            folder / each for each in ("config.yaml", "ros2.yaml", "run.mcap", "r.json")
        )
        config.write_text(json.dumps(unstructure(replace(RELAXED, realtime_priority=options.priority))))
        ros.write_text(json.dumps({"python": str(options.python)} if options.backend == "rclpy" else {}))
        command = [sys.executable, "-m", "footfall", "deploy", POLICY, "--command", "0.2,0,0"]
        command += ["--duration", str(WALKING_S), "--config", str(config), "--log", str(log)]
        command += ["--height-scan", f"ros2:{ros}", "--json", str(result)]
        publisher = [str(options.python), "-c", PUBLISHER, str(scan.size), str(SENDING_S)]
        with (
            subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL) as run,
            subprocess.Popen(publisher, env=environment, stdout=subprocess.PIPE, text=True) as mapper,
        ):
            assert mapper.stdout is not None
            received = mapper.stdout.readline().strip() == "received"
            run.wait(START_S + WALKING_S)
            mapper.kill()
        notes, fell = (json.loads(result.read_text())[key] for key in ("notes", "fell"))
        content = read_log(log, (INPUTS,))
        inputs = [
            unflatten(np.array(entry.message.data), len(content.joints), scan.size, content.foot_sensors)
            for entry in content.entries
        ]
    sent = -0.3 + 0.001 * np.arange(scan.size)
    scans = [each.height_scan for each in inputs if each.height_scan is not None]
    equal = sum(np.allclose(each, sent, atol=1e-4) for each in scans)
    findings = [
        ("the run subscribes", received, "/height_scan"),
        ("policy steps with a scan", 50 < len(scans) < len(inputs), f"{len(scans)} of {len(inputs)}"),
        ("scans equal the published ones", equal == len(scans), f"{equal} of {len(scans)}"),
        ("a scan of another grid is noted", any("3 heights" in each for each in notes), notes),
        ("the last scan expires", inputs[-1].height_scan is None, f"{scan.max_age_s} s at most"),
        ("no fall", not fell, ""),
    ]
    for name, ok, seen in findings:
        print("ok   " if ok else "WRONG", name, "-", seen)
    return 0 if all(ok for _, ok, _ in findings) else 1


if __name__ == "__main__":
    sys.exit(main())
