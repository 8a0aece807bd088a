"""Options of `footfall deploy`."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Parameter

from footfall.common.engines import DEFAULT_ENGINE
from footfall.options import (
    AS_TYPED,
    ControllerSettings,
    Engine,
    JsonFile,
    OptionalPath,
    OptionalSeconds,
    OptionalVelocity,
    Plant,
    RobotName,
    Seed,
    Share,
)
from footfall.robots.default import DEFAULT_ROBOT

LYING = "lying"
FULL = 1.0


@Parameter(name="*")
@dataclass(frozen=True)
class DeployOptions:
    """Where and how to run a policy."""

    robot: RobotName = DEFAULT_ROBOT
    also: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = ()
    """Another policy to which the run can switch while walking; may be given several times."""
    bus: str = "sim"
    """sim for the simulated robot, socketcan for the CAN interfaces named in robot.yaml, or the name of
    another python-can interface; virtual includes a simulated robot."""
    command: Annotated[
        OptionalVelocity,
        Parameter(help="Forward and leftward velocity, m/s, and yaw rate, rad/s (default: 0.5,0,0)."),
    ] = None
    source: Annotated[str | None, AS_TYPED, Parameter(name="--from")] = None
    """Source of commands instead of a fixed command: keyboard, gamepad, udp, ros2, cockpit, or the YAML file
    of a mission (see docs/steering.md)."""
    duration: OptionalSeconds = None
    """Longest walking time, s (default: 10; with --from: until the run is ended)."""
    start: Literal["standing", "lying"] = "standing"
    """Initial state of the simulated robot."""
    charge: Share = FULL
    """Initial charge of the simulated robot's battery, if robot.yaml has a battery."""
    lie_down: bool = True
    """Lie down before the motors are disabled, if robot and fault permit it."""
    recover: bool = False
    """Your consent to get up after a fall and to walk on (see docs/recovery.md)."""
    get_up: Annotated[str | None, AS_TYPED] = None
    """The get-up policy (default: the zoo's policy for this robot)."""
    realtime: bool = False
    """Run in real time; always on with a bus other than sim."""
    plant: Plant = None
    engine: Engine = DEFAULT_ENGINE
    ground: str = ""
    """Ground below the simulated robot: a name with changes, such as stairs,step_m=0.1, or a .npy or .png
    file (see docs/terrain.md). Default: flat."""
    height_scan: Annotated[str, AS_TYPED] = "auto"
    """For policies with a height scan: auto uses the simulated robot's scans, and none on a real bus;
    udp, udp:HOST:PORT, ros2 or ros2:FILE.yaml receives scans; off uses none (see docs/height_scan.md)."""
    ground_truth: bool = False
    """Give the policy the simulator's base velocity instead of an estimate, for studies."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    wiring: Literal["auto", "check", "trust"] = "auto"
    """auto checks a real robot's wiring in its first run; check does so in this run, also in simulation;
    trust runs without proof that the wiring is right (see docs/bring_up.md)."""
    log: OptionalPath = None
    """Record the run to this MCAP file. A run on a real bus always has a log (see docs/logs.md)."""
    log_frames: bool = False
    """Record each CAN frame to the log, too."""
    feed: OptionalPath = None
    """Unix socket from which other programs read the run's telemetry (see docs/logs.md)."""
    seed: Seed = 0
    settings: ControllerSettings = ()
    json: JsonFile = None


DEFAULTS = DeployOptions()
