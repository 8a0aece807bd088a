"""The simulated robot in one process, `footfall deploy --bus socketcan` in another, with faults in between.

    python benchmarks/socketcan.py [--rows walk motor_silent ...] [--out FOLDER]

Needs the interfaces in the robot's `robot.yaml`, up, without other nodes:

    for bus in can0 can1 can2 can3; do ip link add $bus type vcan; ip link set $bus up; done

as root. For a machine whose kernel has no CAN see `benchmarks/socketcan_qemu.py`. Each row of the table below
prints a JSON object, with the controller's faults and the time at which the motors were disabled. `candump`
logs all frames to --out. Exit status 1 if a row did not end as expected.
"""

import argparse
import json
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from footfall.plant.frame_changes import flipped

ORDERLY, ESTOP, KILLED = "IDLE", "ESTOP", ""  # final states; a killed controller reports none
PROCESS_TIMEOUT_S = 300.0  # a slow machine takes long to import
START_TIMEOUT_S = 30.0  # the robot starts after the controller
MOTORS_TIMEOUT_S = 0.5  # longer than the motors' timeout
SLOW_DRIFT_RAD = 0.2
FLIPPED_SHARE = 0.2  # share of the robot's frames with a flipped bit, as if no checksum had detected it


@dataclass(frozen=True)
class Row:
    """One event, and the expected end of the run."""

    final_state: str
    fault: str = ""  # expected part of the reported faults
    to_robot: str = ""  # fault for `inject`
    to_controller: int = 0  # signal to the controller
    to_system: tuple[str, ...] = ()  # command on the system
    policy: str = ""  # replaces --policy


ROWS = {
    "walk": Row(ORDERLY),
    "motor_silent": Row(ESTOP, "no reply from", to_robot="motor_silent"),
    "bus_silent": Row(ESTOP, "no reply from FL_", to_robot="bus_silent"),
    "motor_error": Row(ESTOP, "reports", to_robot="motor_error"),
    "imu_silent": Row(ESTOP, "no new IMU reading", to_robot="imu_silent"),
    "encoder_frozen": Row(ESTOP, "FL_thigh_joint", to_robot="encoder_frozen"),
    "frames_corrupted": Row(ESTOP, to_robot="frames_corrupted"),
    "bus_down": Row(ESTOP, "bus can1 is down", to_system=("ip", "link", "set", "can1", "down")),
    "sigterm": Row(ORDERLY, to_controller=signal.SIGTERM),
    "sighup": Row(ORDERLY, to_controller=signal.SIGHUP),
    "sigkill": Row(KILLED, to_controller=signal.SIGKILL),
    "policy_nan": Row(
        ESTOP, "is not finite", to_controller=signal.SIGUSR1, policy="benchmarks.failing_policies:NotANumber"
    ),
    "policy_hung": Row(
        ESTOP, "ran late", to_controller=signal.SIGUSR1, policy="benchmarks.failing_policies:Hung"
    ),
}


def inject(fault: str, body: Any) -> None:
    """Inject a fault into the simulated robot."""
    if fault == "motor_silent":
        body.faults.motors.silent[4] = True
    elif fault == "bus_silent":
        body.faults.motors.silent[3:6] = True  # go1's front left leg, alone on can1
    elif fault == "encoder_frozen":
        body.faults.motors.stuck[4] = True
    elif fault == "frames_corrupted":
        body.faults.on_wire = flipped(FLIPPED_SHARE, np.random.default_rng(0))
    elif fault == "motor_error":
        body.faults.motors.error[7] = 1
    elif fault == "imu_silent":
        body.faults.imu_silent = True


def robot(name: str, bus: str, slow: bool) -> None:
    """The robot's process: simulated robots in sequence, controlled by lines of input.

    `start` puts a robot on the bus, `stop` removes it, any other line is a fault. Prints a JSON object
    whenever motors were enabled or disabled.
    """
    import footfall.plant.imu_ends as imu_module
    import footfall.plant.serve as serve_module
    import footfall.robots.model as model_module
    from footfall.robots.description import load_robot

    if slow:
        imu_module.IMU_PERIOD_S, model_module.PLANT_TIMESTEP_S, serve_module.PERIOD_US = 0.01, 0.002, 2000
    description = load_robot(name)
    for line in sys.stdin:
        if line.strip() == "start":
            with serve_module.serving(description, bus) as body:
                report(ready=True)
                ended = threading.Event()
                watcher = threading.Thread(target=watch, args=(body, ended))
                watcher.start()
                for command in sys.stdin:
                    if command.strip() == "stop":
                        break
                    inject(command.strip(), body)
                ended.set()
                watcher.join()
            report(stopped=True)


def watch(body: Any, ended: threading.Event) -> None:
    """Report motors that are enabled or disabled."""
    previous = -1
    while not ended.wait(0.005):
        enabled = int(body.motors_on.sum())
        if enabled != previous:
            report(motors_on=enabled)
            previous = enabled


def report(**content: Any) -> None:
    print(json.dumps({"at_s": time.monotonic(), **content}), flush=True)


def progress(text: str) -> None:
    print(f"{time.monotonic():.1f} s: {text}", file=sys.stderr, flush=True)


class Robot:
    """Handle of the robot's process."""

    def __init__(self, name: str, bus: str, slow: bool) -> None:
        command = [sys.executable, __file__, "--robot", name, "--as-robot", "--bus", bus]
        command += ["--slow"] if slow else []
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.messages: list[dict[str, Any]] = []
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.messages.append(json.loads(line))

    def start(self) -> None:
        """Put a new robot on the bus."""
        self.messages.clear()
        self.order("start")
        self.wait_for("ready")

    def stop(self) -> None:
        """Remove the robot from the bus."""
        self.order("stop")
        self.wait_for("stopped")

    def order(self, line: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()

    def wait_for(self, what: str) -> None:
        """Wait for a message of the robot in which `what` is set."""
        deadline = time.monotonic() + PROCESS_TIMEOUT_S
        while not any(each.get(what) for each in list(self.messages)):
            if time.monotonic() > deadline:
                sys.exit(f"the robot does not report '{what}'")
            time.sleep(0.02)

    def off_at(self, after_s: float) -> float | None:
        """First time after `after_s` at which no motor was enabled, s; None if there is none."""
        times = [e["at_s"] for e in self.messages if e.get("motors_on") == 0 and e["at_s"] > after_s]
        return times[0] if times else None


def run(name: str, body: Robot, options: argparse.Namespace) -> dict[str, Any]:
    """Run one row: robot on the bus, controller, fault, end."""
    row, out = ROWS[name], options.out
    result = out / f"{name}.json"
    dump = start_dump(out / f"{name}.candump") if options.bus == "socketcan" else None
    progress(f"{name}: starting the controller")
    command = [sys.executable, "-m", "footfall", "deploy", row.policy or options.policy]
    command += ["--robot", options.robot, "--bus", options.bus]
    command += ["--duration", str(options.seconds), "--json", str(result)]
    config = out / "loop.yaml"
    # On a slow machine, replies are late by milliseconds, which looks like drift.
    sensors = f", sensors: {{drift_rad: {SLOW_DRIFT_RAD}}}" if options.slow else ""
    safety = f"{{start_timeout_s: {START_TIMEOUT_S}{sensors}}}"
    config.write_text(f"joint_rate_hz: {options.joint_rate}\nsafety: {safety}\n")
    command += ["--config", str(config)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    while dump is not None and not frames_in(out / f"{name}.candump"):  # the controller is running
        if process.poll() is not None:
            sys.exit(process.communicate()[0])
        time.sleep(0.05)
    progress(f"{name}: starting the robot")
    body.start()
    body.wait_for("motors_on")
    fault_at = time.monotonic()
    progress(f"{name}: motors are on")
    if name != "walk":
        time.sleep(options.fault_after)
        fault_at = time.monotonic()
        if row.to_robot:
            body.order(row.to_robot)
        if row.to_controller:
            process.send_signal(row.to_controller)
        if row.to_system:
            subprocess.run(row.to_system, check=True)
    progress(f"{name}: waiting for the controller's end")
    text, _ = process.communicate(timeout=PROCESS_TIMEOUT_S)
    time.sleep(MOTORS_TIMEOUT_S)
    if row.to_system:
        subprocess.run([*row.to_system[:-1], "up"], check=True)
    body.stop()
    frames = None if dump is None else end_dump(dump, out / f"{name}.candump")
    reported = json.loads(result.read_text()) if result.exists() else {}
    final_state, faults = reported.get("final_state", ""), reported.get("faults", [])
    off_at = body.off_at(fault_at)
    good = (
        final_state == row.final_state
        and row.fault in " ".join(faults)
        and bool(faults) == (row.final_state == ESTOP)
        and off_at is not None
    )
    shown = {
        "row": name,
        "as_expected": good,
        "exit": process.returncode,
        "final_state": final_state,
        "faults": faults,
        "motors_off_after_s": round(off_at - fault_at, 3) if off_at else None,
        "frames_seen": frames,
        "walked_s": reported.get("walked_s"),
        "timing": reported.get("timing"),
    }
    if not good:
        shown["output"] = text[-2000:]
        shown["robot"] = body.messages[-20:]
    return shown


def start_dump(path: Path) -> subprocess.Popen[bytes]:
    """Record all frames of all interfaces in a file, with time stamps."""
    with path.open("wb") as file:
        return subprocess.Popen(["candump", "-L", "any"], stdout=file)


def end_dump(dump: subprocess.Popen[bytes], path: Path) -> int:
    """End a dump; returns its number of frames."""
    dump.send_signal(signal.SIGINT)
    dump.wait(PROCESS_TIMEOUT_S)
    return frames_in(path)


def frames_in(path: Path) -> int:
    """Number of frames in a log of candump."""
    return path.read_bytes().count(b"\n")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--seconds", type=float, default=5.0, help="walking time")
    parser.add_argument("--fault-after", type=float, default=3.0, help="seconds after the first motor is on")
    parser.add_argument("--joint-rate", type=float, default=500.0, help="rate of the control loop, Hz")
    parser.add_argument("--bus", default="socketcan", help="udp_multicast works without CAN")
    parser.add_argument("--slow", action="store_true", help="physics at half the rate, IMU at 100 Hz")
    parser.add_argument("--out", type=Path, default=Path("socketcan"))
    parser.add_argument("--as-robot", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.as_robot:
        robot(options.robot, options.bus, options.slow)
        return
    options.out.mkdir(parents=True, exist_ok=True)
    process, unexpected = Robot(options.robot, options.bus, options.slow), 0
    for name in options.rows:
        result = run(name, process, options)
        unexpected += not result["as_expected"]
        print(json.dumps(result), flush=True)
    sys.exit(1 if unexpected else 0)


if __name__ == "__main__":
    main()
