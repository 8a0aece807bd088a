"""Plots of one run's log: states, joints, torques, temperatures, contacts, paths of the feet, timing."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from footfall.deploy.log_analysis.columns import Column
from footfall.deploy.log_analysis.findings import LogFindings
from footfall.evaluate.report.svg import INK, Panel, Plot, Reading, colour, line

MAX_POINTS = 700  # of a line
MAX_READINGS = 120  # of a panel, shown under the pointer
PATH_SHOWN_S = 4.0
NO_COLUMN = Column(np.zeros(0), np.zeros((0, 0)))
CONTACT_THRESHOLD = 0.5  # contact probability above which a foot counts as standing


def plots(findings: LogFindings) -> list[Plot]:
    """All plots for which the log has data."""
    functions = (velocity, joints, torques, temperatures, contacts, paths, timing)
    return [plot for plot in (function(findings) for function in functions) if plot.panels]


def velocity(findings: LogFindings) -> Plot:
    """Commanded and estimated velocity."""
    columns, panels = findings.columns, []
    command, odometry = columns.column("/cmd_vel", 6), columns.column("/odom", 42)
    # Name, unit, and index in the command and in the odometry.
    components = (("forward", "m/s", 0, 0), ("leftward", "m/s", 1, 1), ("yaw rate", "rad/s", 5, 5))
    for name, unit, commanded, estimated in components:
        if not len(command.time_s):
            continue
        with Panel(f"velocity-{commanded}") as panel:
            ax = panel.axes
            ax.plot(*_envelope(command.time_s, command.values[:, commanded]), color=INK, lw=1.0)
            if len(odometry.time_s):
                ax.plot(*_envelope(odometry.time_s, odometry.values[:, estimated]), **line(0))
            ax.set(xlabel="time, s", ylabel=unit, title=name)
            panels.append(panel.svg(f"Commanded and estimated velocity, {name}"))
    return Plot("Velocity", "Thin: the command that the policy was given. Blue: odometry's estimate.", panels)


def joints(findings: LogFindings) -> Plot:
    """Joint positions and joint targets."""
    read, sent = findings.columns.readings, findings.columns.targets

    def draw(ax: Axes, joint: int, **style: Any) -> None:
        ax.plot(*_envelope(sent.time_s, sent.values[:, joint]), color=INK, lw=0.7)
        ax.plot(*_envelope(read.time_s, read.values[:, joint]), **style)

    values = read.values[:, : len(findings.columns.joints)]
    panels = _by_limb(findings, "joints", "rad", draw, Column(read.time_s, values))
    return Plot("Joints", "Measured position; thin: the target that was sent.", panels)


def torques(findings: LogFindings) -> Plot:
    """Torques as reported by the motors."""
    time_s, values = findings.columns.readings
    torque = values[:, 2 * len(findings.columns.joints) :]

    def draw(ax: Axes, joint: int, **style: Any) -> None:
        ax.plot(*_envelope(time_s, torque[:, joint]), lw=1.0, **style)

    panels = _by_limb(findings, "torques", "N m", draw, Column(time_s, torque))
    return Plot("Torques", "As reported by the motors.", panels)


def temperatures(findings: LogFindings) -> Plot:
    """Temperatures of the motors."""
    count = len(findings.columns.joints)
    time_s, values = findings.columns.column("/motor_health", 3 * count)
    bounds_s = np.append(time_s, findings.columns.duration_s)

    def draw(ax: Axes, joint: int, **style: Any) -> None:
        ax.plot(bounds_s, np.append(values[:, joint], values[-1:, joint]), drawstyle="steps-post", **style)

    measured = Column(time_s, values[:, :count]) if np.isfinite(values[:, :count]).any() else NO_COLUMN
    return Plot("Temperatures", "Of the motors.", _by_limb(findings, "heat", "°C", draw, measured))


def _by_limb(
    findings: LogFindings, quantity: str, unit: str, draw: Callable[..., None], values: Column
) -> list[Markup]:
    """A panel for each limb: `draw` draws one joint; `values` (T, n) are shown under the pointer."""
    if not len(values.time_s):
        return []
    panels = []
    for number, (name, members) in enumerate(_limbs(findings)):
        with Panel(f"{quantity}-{number}") as panel:
            for index, joint in enumerate(members):
                draw(panel.axes, joint, color=colour(index), label=findings.columns.joints[joint])
            panel.axes.set(xlabel="time, s", ylabel=unit, title=name)
            if len(members) > 1:
                panel.axes.legend(fontsize=9, frameon=False, loc="best")
            panels.append(panel.svg(f"{quantity} of {name}", _readings(findings, values, members, unit)))
    return panels


def contacts(findings: LogFindings) -> Plot:
    """Estimated stance of the feet."""
    column = findings.columns.columns.get("/contacts", NO_COLUMN)
    time_s, probability = column.time_s, column.values
    if not len(time_s):
        return Plot("Contacts", "", [])
    names = _feet(findings, probability.shape[1])
    probability = probability[:, probability.shape[1] - len(names) :]
    with Panel("contacts", height=80.0 + 26.0 * len(names)) as panel:
        ax = panel.axes
        for row, stands in enumerate((probability > CONTACT_THRESHOLD).T):
            edges = np.flatnonzero(np.diff(np.concatenate([[0], stands.astype(int), [0]])))
            bounds_s = np.append(time_s, time_s[-1])
            bars = [(bounds_s[a], bounds_s[b] - bounds_s[a]) for a, b in edges.reshape(-1, 2)]
            ax.broken_barh(bars, (row - 0.36, 0.72), color=colour(0), lw=0)
        ax.set_yticks(range(len(names)), names)
        ax.set(xlabel="time, s", ylim=(len(names) - 0.5, -0.5))
        ax.grid(visible=False, axis="y")
        return Plot(
            "Contacts", "Bars: stance of a foot, estimated.", [panel.svg("Feet that stand over time")]
        )


def paths(findings: LogFindings) -> Plot:
    """Paths of the feet, seen from the side."""
    if findings.robot is None or not len(findings.measured.time_s):
        return Plot("Paths of the feet", "", [])
    panels = []
    feet = [foot.name for foot in findings.robot.description.feet]
    read_s, sent_s = findings.measured.time_s, findings.policy_targets.time_s
    start_s = (findings.walking[0][1] if findings.walking else read_s[-1]) - PATH_SHOWN_S
    for foot, name in enumerate(feet):
        with Panel(f"paths-{foot}") as panel:
            ax = panel.axes
            target = _window(sent_s[: len(findings.target_feet)], findings.target_feet[:, foot], start_s)
            walked = _window(read_s, findings.measured_feet[:, foot], start_s)
            ax.plot(target[:, 0], target[:, 2], color=INK, lw=0.7)
            ax.plot(walked[:, 0], walked[:, 2], color=colour(0), lw=1.2)
            ax.set(xlabel="forward of the base, m", ylabel="up, m", title=name)
            panels.append(panel.svg(f"Path of foot {name} from the side"))
    return Plot(
        "Paths of the feet",
        f"Relative to the base, seen from the side, over {PATH_SHOWN_S:g} s of walking. Thin: the foot's"
        " position for the policy's joint targets.",
        panels,
    )


def timing(findings: LogFindings) -> Plot:
    """Computing time and lateness of ticks."""
    time_s, values = findings.columns.column("/loop_timing", 2)
    panels: list[Markup] = []
    for number, name in enumerate(("work of a tick", "lateness of a tick")):
        if not len(time_s):
            continue
        p50, p99 = np.percentile(values[:, number], (50, 99))
        with Panel(f"timing-{number}") as panel:
            panel.axes.plot(*_peaks(time_s, values[:, number]), color=colour(number), lw=1.0)
            panel.axes.set(xlabel="time, s", ylabel="µs", title=f"{name}: p50 {p50:.0f}, p99 {p99:.0f} µs")
            panel.axes.set_yscale("symlog", linthresh=100.0)
            panel.axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
            panels.append(panel.svg(f"{name} over time, maximum of each interval"))
    return Plot("Loop timing", "Maximum of each interval of the run, in wall-clock time.", panels)


def _limbs(findings: LogFindings) -> Iterator[tuple[str, list[int]]]:
    """Joints of each limb, named after its foot; without a robot, all joints in groups of three."""
    joints = list(range(len(findings.columns.joints)))
    if findings.robot is None:
        for start in joints[::3]:
            yield findings.columns.joints[start], joints[start : start + 3]
        return
    legs = findings.robot.legs
    of_limbs = [legs.joints[leg][legs.present[leg]].tolist() for leg in range(legs.count)]
    for foot, members in zip(findings.robot.description.feet, of_limbs, strict=True):
        yield foot.name, members
    if others := [joint for joint in joints if not any(joint in members for members in of_limbs)]:
        yield "other joints", others


def _feet(findings: LogFindings, count: int) -> list[str]:
    if findings.robot is not None:
        return [foot.name for foot in findings.robot.description.feet]
    return [f"foot {number}" for number in range(count)]


def _readings(findings: LogFindings, values: Column, members: Sequence[int], unit: str) -> list[Reading]:
    """Numbers shown under the pointer."""
    rows = np.unique(np.linspace(0, len(values.time_s) - 1, MAX_READINGS).astype(int))
    return [
        Reading(float(values.time_s[row]), None, _text(findings, values, members, unit, row)) for row in rows
    ]


def _text(findings: LogFindings, values: Column, members: Sequence[int], unit: str, row: int) -> str:
    names = findings.columns.joints
    lines = [f"{names[joint]} {values.values[row, joint]:.3g} {unit}" for joint in members]
    return "\n".join([f"{values.time_s[row]:.2f} s", *lines])


def _window(time_s: np.ndarray, positions: np.ndarray, start_s: float) -> np.ndarray:
    return positions[(time_s >= start_s) & (time_s <= start_s + PATH_SHOWN_S)]


def _envelope(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and maximum of each interval, so that peaks stay visible."""
    size = -(-len(values) // (MAX_POINTS // 2))
    if size <= 2:
        return time_s, values
    covered = len(values) // size * size
    parts = values[:covered].reshape(-1, size)
    ends = np.sort(np.stack([parts.argmin(axis=1), parts.argmax(axis=1)], axis=1), axis=1)
    rows = (ends + size * np.arange(len(parts))[:, None]).ravel()
    return time_s[rows], values[rows]


def _peaks(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Maximum of each interval."""
    size = -(-len(values) // MAX_POINTS)
    covered = len(values) // size * size
    return time_s[:covered:size], values[:covered].reshape(-1, size).max(axis=1)
