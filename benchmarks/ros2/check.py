"""Checks a run that ROS 2 steers, with real rclpy: prints each finding, exit status 1 if one fails.

    python benchmarks/ros2/interfaces.py jazzy/bin/python    # tf2_msgs and nav2_msgs for ROS from PyPI
    python benchmarks/ros2/check.py jazzy/bin/python [--backend cyclonedds]

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

from footfall.common.config import unstructure
from footfall.deploy.telemetry.topics import TOPICS
from footfall.operate.ros2.table import CHOICES, PUBLISHED, SERVICES, TRIGGER, WAVE, absolute

sys.path.insert(0, str(Path(__file__).parents[1]))

from relaxed_limits import RELAXED

DOMAIN = "87"  # used only by these checks
LOOK_TIMEOUT_S, LIE_DOWN_S = 300.0, 30.0


def table(backend: str, policy: str) -> dict[str, list]:
    """The expected nodes, topics and services."""
    published = [(absolute(p.name), TOPICS[p.feed].kind, TOPICS[p.feed].latched) for p in PUBLISHED]
    if backend == "cyclonedds":
        return {"published": published, "services": []}
    chosen = {"gait": policy, "policy": "stand"}
    names = [CHOICES[key].name.format(name) for key, name in chosen.items()]
    services = [(s.name, s.kind) for s in (*SERVICES, WAVE)] + [(name, TRIGGER) for name in names]
    return {"published": published, "services": [(absolute(name), kind) for name, kind in services]}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("python", type=Path, help="a Python that has rclpy")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="trot", help="name of a policy with gaits")
    parser.add_argument("--priority", type=int, help="SCHED_FIFO priority of the loop, for a busy computer")
    parser.add_argument("--backend", choices=("rclpy", "cyclonedds"), default="rclpy")
    options = parser.parse_args()
    environment = {**os.environ, "ROS_DOMAIN_ID": DOMAIN, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with tempfile.TemporaryDirectory() as folder:
        config, expected, ros = (Path(folder) / name for name in ("config.yaml", "table.json", "ros2.yaml"))
        config.write_text(json.dumps(unstructure(replace(RELAXED, realtime_priority=options.priority))))
        expected.write_text(json.dumps(table(options.backend, options.policy)))
        ros.write_text(json.dumps({"python": str(options.python)} if options.backend == "rclpy" else {}))
        command = [
            sys.executable,
            "-m",
            "footfall",
            "deploy",
            options.policy,
            "--robot",
            options.robot,
            "--also",
            "stand",
        ]
        command += ["--from", f"ros2:{ros}", "--config", str(config)]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as run:
            looks = [str(options.python), str(Path(__file__).with_name("looks.py")), str(expected)]
            checks = subprocess.run(
                looks, env=environment, stdout=subprocess.PIPE, text=True, timeout=LOOK_TIMEOUT_S, check=False
            )
            try:
                summary = run.communicate(timeout=LIE_DOWN_S)[0]  # the checks have stopped the run
            except subprocess.TimeoutExpired:
                run.terminate()
                summary = run.communicate()[0]
    findings = [json.loads(line) for line in checks.stdout.splitlines() if line.startswith("{")]
    for finding in findings:
        print("ok   " if finding["ok"] else "WRONG", finding["check"], "-", finding["seen"])
    print(summary)
    complete = checks.returncode == 0
    return 0 if complete and all(finding["ok"] for finding in findings) else 1


if __name__ == "__main__":
    sys.exit(main())
