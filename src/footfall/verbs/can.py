"""`footfall can`: tests of single motors of a robot on a stand."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclopts import App, Parameter

from footfall.common.errors import UserError
from footfall.confirm import Yes, confirm
from footfall.options import Names, OptionalSeconds, RobotName, Seconds
from footfall.plain_table import print_table
from footfall.robot_bus import interface_bus
from footfall.robots.default import DEFAULT_ROBOT

if TYPE_CHECKING:
    from rich.table import Table

    from footfall.deploy.bench import Bench, MotorState
    from footfall.deploy.wiring import Wiring
    from footfall.robots.description import Robot

can = App(name="can", help="A robot on a stand: find, enable, zero and monitor its motors.")

PROBLEM_STATUS = 1
FRAMES_PER_SECOND = 5
REPORT_S = 0.5  # every motor reports its errors within this time: heartbeats come ten times per second


@Parameter(name="*")
@dataclass(frozen=True)
class Target:
    """Motors and interface."""

    robot: RobotName = DEFAULT_ROBOT
    bus: str = "socketcan"
    """python-can interface of the robot's buses; virtual includes a simulated robot."""


@can.command
def scan(*, where: Target = Target()) -> int:
    """Find motors by id and maker, and compare them with robot.yaml; exit 1 if they differ."""
    from footfall.deploy.scan import accept_all
    from footfall.deploy.scan import expected as expected_motors
    from footfall.deploy.scan import scan as scan_buses

    robot, wiring = _wired(where)
    with interface_bus(robot, wiring, where.bus, accept_all(wiring)) as bus:
        found = scan_buses(bus, wiring)
    expected = expected_motors(wiring)
    rows: list[tuple[str, ...]] = []
    for each in sorted(found | set(expected)):
        verdict = "found" if each in found else "missing"
        joint = expected.get(each, "not in robot.yaml")
        rows.append((wiring.buses[each.channel], str(each.id), each.maker, joint, verdict))
    print_table(("bus", "id", "maker", "joint", ""), rows)
    return 0 if found == set(expected) else PROBLEM_STATUS


@can.command
def monitor(*, where: Target = Target(), joint: Names = (), duration: OptionalSeconds = None) -> int:
    """Show the reports of disabled motors, until Ctrl-C.

    Parameters
    ----------
    joint
        Only these joints.
    duration
        Time until the end, s.
    """
    with _bench(where, joint) as bench:
        problem = bench.query_settings()
        with _live(bench) as show, suppress(KeyboardInterrupt):
            bench.watch(math.inf if duration is None else duration, show)
        return _verdict(bench, problem or bench.missing())


@can.command
def enable(*, where: Target = Target(), joint: Names = (), duration: Seconds = 3.0, yes: Yes = False) -> int:
    """Enable motors for a moment, without torque, and disable them again.

    Parameters
    ----------
    joint
        Only these joints.
    duration
        Time for which they are enabled, s.
    """
    _wired(where, joint)  # refuses wrong names before the question
    confirm("enable the motors, without torque? The robot must hang or lie: its joints are limp", yes)
    with _bench(where, joint) as bench:
        problem = bench.query_settings() or bench.enable()
        if not problem:
            with _live(bench) as show:
                bench.idle(duration, show)
            problem = bench.missing()
        return _verdict(bench, problem)


@can.command
def zero(*, where: Target = Target(), joint: Names = (), yes: Yes = False) -> int:
    """Set the zero position of disabled motors at rest to their current position.

    Parameters
    ----------
    joint
        Only these joints.
    """
    _wired(where, joint)  # refuses wrong names before the question
    which = ", ".join(joint) if joint else "every joint"
    confirm(f"set the zero of {which} to the current position? The old zero is lost", yes)
    with _bench(where, joint) as bench:
        problem = bench.query_settings() or bench.settle()
        if not problem:
            problem = bench.zero() or bench.missing()
        _print_motors(bench)
        return _verdict(bench, problem)


@can.command
def clear(*, where: Target = Target(), joint: Names = (), yes: Yes = False) -> int:
    """Clear latched errors of disabled motors; exit 1 if a motor still reports an error.

    Parameters
    ----------
    joint
        Only these joints.
    """
    _wired(where, joint)  # refuses wrong names before the question
    which = ", ".join(joint) if joint else "every joint"
    confirm(f"clear the errors of {which}? Motors that were kept disabled by them can be enabled then", yes)
    with _bench(where, joint) as bench:
        bench.watch(REPORT_S, lambda: None)
        earlier_states = bench.states()
        problem = bench.clear() or bench.missing()
        for earlier, state in zip(earlier_states, bench.states(), strict=True):
            if earlier.error and not state.error:
                print(f"{earlier.joint} reported {earlier.error}: cleared")
        _print_motors(bench)
        return _verdict(bench, problem)


def _wired(where: Target, joints: tuple[str, ...] = ()) -> "tuple[Robot, Wiring]":
    """A robot and its wiring.

    Raises:
        UserError: there is no such robot or joint, or no driver for a motor.
    """
    from footfall.deploy.drivers.choice import by_driver
    from footfall.deploy.wiring import wiring_of
    from footfall.robots.description import load_robot

    robot = load_robot(where.robot)
    wiring = wiring_of(robot)
    by_driver(wiring)  # raises UserError for motors without a driver
    for name in joints:
        if name not in robot.joint_names:
            raise UserError(f"no joint '{name}': there are {', '.join(robot.joint_names)}")
    return robot, wiring


@contextmanager
def _bench(where: Target, joints: tuple[str, ...]) -> "Iterator[Bench]":
    """All motors of a robot, or of some joints; they are disabled at the end of the context."""
    import numpy as np

    from footfall.deploy.bench import Bench, disabled_afterwards
    from footfall.deploy.drivers.choice import open_driver

    robot, wiring = _wired(where, joints)
    selected = wiring.take(np.array([robot.joint_index(name) for name in joints])) if joints else wiring
    with interface_bus(robot, wiring, where.bus, open_driver(selected).filters) as bus:
        bench = Bench(selected, bus)
        with disabled_afterwards(bench):
            yield bench


def _verdict(bench: "Bench", problem: str) -> int:
    errors = [f"{state.joint} reports {state.error}" for state in bench.states() if state.error]
    for line in [*([problem] if problem else []), *errors]:
        print(line)
    return PROBLEM_STATUS if problem or errors else 0


@contextmanager
def _live(bench: "Bench") -> Iterator[Callable[[], None]]:
    """Table that is updated on a terminal, or printed once at the end."""
    from rich.console import Console
    from rich.live import Live

    console = Console()
    if not console.is_terminal:
        yield lambda: None
        _print_motors(bench)
        return
    with Live(_table(bench.states()), console=console, auto_refresh=False) as live:
        shown_s = time.monotonic()

        def show() -> None:
            nonlocal shown_s
            if time.monotonic() - shown_s >= 1.0 / FRAMES_PER_SECOND:
                shown_s = time.monotonic()
                live.update(_table(bench.states()), refresh=True)

        yield show
        live.update(_table(bench.states()), refresh=True)


HEADER = ("joint", "bus", "id", "motor", "rad", "rad/s", "N m", "deg C", "V", "age, ms", "")


def _table(states: "list[MotorState]") -> "Table":
    from rich.table import Table

    table = Table(*HEADER, box=None)
    for state in states:
        table.add_row(*_row(state))
    return table


def _row(state: "MotorState") -> tuple[str, ...]:
    figures = (
        (state.position, "+.3f"),
        (state.velocity, "+.2f"),
        (state.torque, "+.2f"),
        (state.temperature_c, ".0f"),
        (state.voltage, ".1f"),
        (1e3 * state.age_s, ".0f"),
    )
    shown = [format(value, spec) if math.isfinite(value) else "-" for value, spec in figures]
    return (state.joint, state.bus, str(state.id), state.model, *shown, state.error)


def _print_motors(bench: "Bench") -> None:
    print_table(HEADER, [_row(state) for state in bench.states()])
