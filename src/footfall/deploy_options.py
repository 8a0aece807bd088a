"""The options of `footfall deploy`."""

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
    PolicyName,
    RobotName,
    Seed,
    Share,
)
from footfall.robots.default import DEFAULT_ROBOT

LYING = "lying"
FULL = 1.0
SIMULATED, VIRTUAL = "sim", "virtual"  # buses that lead to a simulated robot


@Parameter(name="*")
@dataclass(frozen=True)
class DeployOptions:
    """Where and how to run a policy."""

    robot: RobotName = DEFAULT_ROBOT
    also: Annotated[tuple[PolicyName, ...], Parameter(negative=(), show_default=False)] = ()
    """Another policy that may take over while it walks; may be given several times."""
    bus: str = "sim"
    """sim for the simulated robot, socketcan for the CAN interfaces that robot.yaml names, or python-can's
    name of another kind; virtual has a simulated robot at its other end."""
    command: Annotated[
        OptionalVelocity,
        Parameter(help="Forward and leftward velocity, m/s, and yaw rate, rad/s (default: 0.5,0,0)."),
    ] = None
    by: Annotated[str | None, AS_TYPED, Parameter(name="--from")] = None
    """Who steers, in the place of a fixed command: keyboard, gamepad, udp, ros2, cockpit, or a mission's YAML
    file (see docs/steering.md)."""
    duration: OptionalSeconds = None
    """Longest walking time, s (default: 10; with --from until the run is ended)."""
    start: Literal["standing", "lying"] = "standing"
    """How the simulated robot begins."""
    charge: Share = FULL
    """Charge of the simulated robot's battery at the start, where its robot.yaml declares one."""
    lie_down: bool = True
    """Lie down before the motors go off, where robot and fault permit it."""
    recover: bool = False
    """Your consent that the robot gets up after a fall and walks on (see docs/recovery.md)."""
    get_up: Annotated[PolicyName | None, AS_TYPED] = None
    """The policy that gets it up (default: the zoo's for this robot)."""
    realtime: bool = False
    """Keep to the wall clock; a bus other than sim always does."""
    plant: Plant = None
    engine: Engine = DEFAULT_ENGINE
    ground: str = ""
    """What the simulated robot walks on: a name with changes, such as stairs,step_m=0.1, or a .npy or .png
    file (see docs/terrain.md). Flat if none is given."""
    height_scan: Annotated[str, AS_TYPED] = "auto"
    """For policies that read height scans: auto takes those of the simulated robot, and none on a real bus;
    udp, udp:HOST:PORT, ros2 or ros2:FILE.yaml receives them; off walks without (see docs/height_scan.md)."""
    ground_truth: bool = False
    """Hand the policy the simulator's base velocity instead of an estimate, for study."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    wiring: Literal["auto", "check", "trust"] = "auto"
    """auto checks a real robot's wiring in its first run; check does so in this run, also a simulated one;
    trust runs on wiring that is not proven (see docs/bring_up.md)."""
    log: OptionalPath = None
    """Record the run to this MCAP file. A run on a real bus has a log in any case (see docs/logs.md)."""
    log_frames: bool = False
    """Record each CAN frame to the log, too."""
    feed: OptionalPath = None
    """Unix socket at which other programs read what the run tells, as it happens (see docs/logs.md)."""
    seed: Seed = 0
    settings: ControllerSettings = ()
    json: JsonFile = None


DEFAULTS = DeployOptions()
