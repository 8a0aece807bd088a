"""Plots of the test course that every policy walks: tracking, gait, motors, computing time."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from footfall.evaluate.plan import EpisodePlan
from footfall.evaluate.report.short_names import titled
from footfall.evaluate.report.svg import INK, Panel, Plot, Reading, colour, line
from footfall.plant.trace import Trace
from footfall.robots.actuator import limit_torque
from footfall.robots.description import Robot

SMOOTHED_S = 0.2  # about half a stride: the plot shows tracking; the figures use every sample
READ_EVERY_S = 0.1
GAIT_SHOWN_S = 2.0
AXES = (("forward velocity", "m/s"), ("leftward velocity", "m/s"), ("yaw rate", "rad/s"))


class Walk(NamedTuple):
    """A policy's walk over the course."""

    policy_index: int  # sets its colour
    policy: str
    trace: Trace
    period_ms: float  # between steps of the policy


def tracking(walks: Sequence[Walk], plan: EpisodePlan) -> Plot:
    """Commanded and true velocities over the course."""
    return Plot(
        "Tracking",
        f"True velocity over the test course, averaged over {SMOOTHED_S:g} s, and the command in steps."
        " Dotted: a push.",
        [_tracking_panel(axis, walks, plan) for axis in range(3)] if walks else [],
        legend=[walk.policy_index for walk in walks],
    )


def _tracking_panel(axis: int, walks: Sequence[Walk], plan: EpisodePlan) -> Markup:
    name, unit = AXES[axis]
    times = np.arange(0.0, plan.duration_s, READ_EVERY_S)
    commands = np.array([plan.schedule(time)[axis] for time in times])
    smoothed = [smooth(_velocity(walk.trace)[:, axis], walk.trace) for walk in walks]
    with Panel(f"tracking-{axis}") as panel:
        ax = panel.axes
        ax.plot(times, commands, color=INK, lw=1.0, drawstyle="steps-post")
        for walk, values in zip(walks, smoothed, strict=True):
            ax.plot(walk.trace.time_s, values, **line(walk.policy_index))
        for push in plan.pushes:
            ax.axvline(push.time_s, color=INK, lw=0.9, dashes=(1, 2))
        ax.set(xlabel="time, s", ylabel=unit, title=name, xlim=(0.0, plan.duration_s))
        readings = []
        for time, command in zip(times, commands, strict=True):
            lines = [f"{time:.1f} s: command {command:.2f} {unit}"]
            for (_, policy, trace, _), values in zip(walks, smoothed, strict=True):
                if time <= trace.time_s[-1]:
                    sample = int(np.searchsorted(trace.time_s, time - 1e-9))
                    lines.append(f"{policy} {values[sample]:.2f}")
                else:
                    lines.append(f"{policy} fallen" if trace.fell else f"{policy} –")
            readings.append(Reading(float(time), None, "\n".join(lines)))
        return panel.svg(f"Commanded and true {name} over the course", readings)


def gait(walks: Sequence[Walk], plan: EpisodePlan, robot: Robot) -> Plot:
    """Which feet are on the ground, over two seconds of steady walking."""
    start_s, end_s = steady_window(plan)
    forward, leftward, yaw = plan.schedule(start_s)
    return Plot(
        "Gait",
        f"Bars: a foot is on the ground, while the command is {forward:g} m/s forward, {leftward:g} m/s"
        f" leftward and {yaw:g} rad/s. Duty: share of the time that a foot is on the ground.",
        [_gait_panel(walk, robot, (start_s, end_s)) for walk in walks],
    )


def steady_window(plan: EpisodePlan) -> tuple[float, float]:
    """The last seconds of the longest constant command, preferring commands to move."""
    edges = [*plan.schedule.from_s, plan.duration_s]
    spans = [
        (any(command), end - start, start, end)
        for command, start, end in zip(plan.schedule.commands, edges[:-1], edges[1:], strict=True)
    ]
    _, _, start, end = max(spans, key=lambda span: span[:2])
    return max(start, end - GAIT_SHOWN_S), end


def _gait_panel(walk: Walk, robot: Robot, window_s: tuple[float, float]) -> Markup:
    policy_index, policy, trace, _ = walk
    feet = [foot.name for foot in robot.description.feet]
    in_window = (trace.time_s >= window_s[0]) & (trace.time_s <= window_s[1])
    time_s, contact = trace.time_s[in_window], trace.foot_contact[in_window]
    with Panel(f"gait-{policy_index}", height=60.0 + 26.0 * len(feet)) as panel:
        ax = panel.axes
        for row, foot in enumerate(contact.T):
            ax.broken_barh(contact_bars(time_s, foot), (row - 0.36, 0.72), color=colour(policy_index), lw=0)
        ax.set_yticks(range(len(feet)), feet)
        ax.set(xlabel="time, s", xlim=window_s, ylim=(len(feet) - 0.5, -0.5))
        ax.grid(visible=False, axis="y")
        if not len(time_s):
            ax.set_title(titled(policy, "fallen by then"))
            return panel.svg(f"{policy} had fallen by then")
        duty, rate_hz = contact.mean(), touchdown_rate_hz(contact, trace.record_rate_hz)
        ax.set_title(titled(policy, f"duty {duty:.2f}, {rate_hz:.1f} strides/s"))
        readings = [
            Reading(
                float(time),
                None,
                f"{time:.2f} s: " + (_names_on_ground(feet, row) or "no foot") + " on the ground",
            )
            for time, row in zip(time_s[::2], contact[::2], strict=True)
        ]
        return panel.svg(f"Feet of {policy} on the ground over time, duty factor {duty:.2f}", readings)


def _names_on_ground(feet: list[str], contact: np.ndarray) -> str:
    return ", ".join(name for name, is_on_ground in zip(feet, contact, strict=True) if is_on_ground)


def contact_bars(time_s: np.ndarray, contact: np.ndarray) -> list[tuple[float, float]]:
    """Start and length, s, of the intervals in which `contact` (T,) is true."""
    changes = np.flatnonzero(np.diff(np.concatenate([[False], contact, [False]]).astype(int)))
    ends = np.append(time_s, time_s[-1:] + np.diff(time_s)[-1:])
    return [(float(ends[a]), float(ends[min(b, len(ends) - 1)] - ends[a])) for a, b in changes.reshape(-1, 2)]


def touchdown_rate_hz(contact: np.ndarray, rate_hz: float) -> float:
    """Touchdowns per second, mean over feet; `contact` is (T, feet)."""
    return float((~contact[:-1] & contact[1:]).sum() / contact.shape[1] / (len(contact) / rate_hz))


def torque_speed(walks: Sequence[Walk], robot: Robot) -> Plot:
    """Operating points of the motors on the course, within their torque limits."""
    kinds: dict[str, list[int]] = {joint.motor: [] for joint in robot.description.joints}
    for index, joint in enumerate(robot.description.joints):
        kinds[joint.motor].append(index)
    return Plot(
        "Torque and speed",
        "Each mark is one joint at one of 100 samples per second on the course. Lines: limits of the motor.",
        [
            _torque_panel(f"torque-{row}-{walk.policy_index}", walk, kind, robot, joints)
            for row, (kind, joints) in enumerate(kinds.items())
            for walk in walks
        ],
    )


def _torque_panel(identity: str, walk: Walk, kind: str, robot: Robot, joints: list[int]) -> Markup:
    policy_index, policy, trace, _ = walk
    speed, torque = trace.joint_velocity[:, joints].ravel(), trace.motor_torque[:, joints].ravel()
    motor = type(robot.motor)(
        *(
            None if part is None else np.broadcast_to(part, robot.armature.shape)[joints[0]]
            for part in robot.motor
        )
    )
    with Panel(identity) as panel:
        ax = panel.axes
        ax.plot(speed, torque, ".", ms=2.4, mew=0, alpha=0.35, color=colour(policy_index), rasterized=True)
        grid = np.linspace(-1.05, 1.05, 43) * motor.no_load_speed
        limits = {}
        for sign in (1, -1):
            limits[sign] = limit_torque(np.full_like(grid, sign * np.inf), grid, motor)
            ax.plot(grid, limits[sign], color=INK, lw=1.0)
        edge = 1.08 * float(limits[1].max())
        ax.set(xlabel="speed, rad/s", ylabel="torque, N m", title=titled(policy, kind), ylim=(-edge, edge))
        step = grid[1] - grid[0]
        readings = []
        for grid_speed, upper, lower in zip(grid, limits[1], limits[-1], strict=True):
            torques = torque[np.abs(speed - grid_speed) <= step / 2]
            range_text = f"{torques.min():.1f} to {torques.max():.1f} N m" if len(torques) else "never"
            text = f"at {grid_speed:.1f} rad/s: {range_text}\nlimits {lower:.1f} and {upper:.1f} N m"
            readings.append(Reading(float(grid_speed), None, text))
        return panel.svg(
            f"Torque against speed of the {kind} motors of {policy}, with their limits", readings
        )


def timing(walks: Sequence[Walk]) -> Plot:
    """Computing time of policy steps, against their period."""
    timed = [walk for walk in walks if len(walk.trace.compute_ms)]
    fastest = min((float(walk.trace.compute_ms.min()) for walk in timed), default=0.1)
    slowest = max((max(walk.trace.compute_ms.max(), walk.period_ms) for walk in timed), default=1.0)
    bins = np.geomspace(0.9 * fastest, 1.3 * slowest, 60)
    return Plot(
        "Timing",
        "Time per policy step on the course, one policy at a time, on one core of this machine. Dashed: p50"
        " and p99. Line: the period of a step. On a busy machine, p99 reflects other programs.",
        [_timing_panel(walk, bins) for walk in timed],
    )


def _timing_panel(walk: Walk, bins: np.ndarray) -> Markup:
    policy_index, policy, trace, period_ms = walk
    compute_ms = trace.compute_ms
    p50, p99 = np.percentile(compute_ms, [50, 99])
    with Panel(f"timing-{policy_index}", height=170.0) as panel:
        ax = panel.axes
        shares, _, _ = ax.hist(
            compute_ms,
            bins.tolist(),
            weights=np.full(len(compute_ms), 100.0 / len(compute_ms)),
            color=colour(policy_index),
            alpha=0.8,
        )
        for time_ms, dashes in ((p50, (3, 2)), (p99, (3, 2)), (period_ms, (1, 0))):
            ax.axvline(time_ms, color=INK, lw=1.0, dashes=dashes)
        _plain_log_ticks(ax)
        ax.set(xlabel="time per step, ms", ylabel="% of steps")
        ax.set_title(titled(policy, f"p50 {p50:.2f}, p99 {p99:.2f} of {period_ms:g} ms"))
        middles = np.sqrt(bins[:-1] * bins[1:])
        readings = [
            Reading(float(middle), None, f"{low:.3g} to {high:.3g} ms: {share:.1f} % of steps")
            for middle, low, high, share in zip(middles, bins[:-1], bins[1:], np.asarray(shares), strict=True)
        ]
        return panel.svg(f"Histogram of the time that the steps of {policy} take", readings)


def _plain_log_ticks(ax: Axes) -> None:
    """A logarithmic x axis with 0.1, 1, 10 instead of powers, which need mathematical text."""
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.xaxis.set_minor_formatter(lambda *_: "")


def _velocity(trace: Trace) -> np.ndarray:
    """Forward and leftward velocity and yaw rate, (T, 3)."""
    return np.column_stack([trace.base_velocity[:, :2], trace.base_angular_velocity[:, 2]])


def smooth(values: np.ndarray, trace: Trace) -> np.ndarray:
    """Moving average over `SMOOTHED_S`, shape (T,)."""
    width = max(1, round(SMOOTHED_S * trace.record_rate_hz))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
