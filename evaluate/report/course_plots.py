"""Plots of the course that every contender walks. Each is an SVG, or None where there is nothing to show."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes

from footfall.evaluate.plan import EpisodePlan
from footfall.evaluate.report.svg import INK, WIDTH_IN, axes_grid, colour, drawing, legend_above, line, to_svg
from footfall.plant.trace import Trace
from footfall.robots.actuator import limit_torque
from footfall.robots.description import Robot

SMOOTHED_S = 0.2  # half a stride or so: the plot shows tracking, the figures count every sample


def tracking(traces: Mapping[str, Trace], plan: EpisodePlan) -> str | None:
    """Commanded and true velocities over the course."""
    if not traces:
        return None
    with drawing("tracking"):
        figure, axes = axes_grid(3, 1, (WIDTH_IN, 5.4), sharex="all")
        names = ("forward\nm/s", "leftward\nm/s", "yaw rate\nrad/s")
        times = np.arange(0.0, plan.duration_s, 0.02)
        commands = np.array([plan.schedule(time) for time in times])
        for axis, (ax, name) in enumerate(zip(axes, names, strict=True)):
            ax.plot(times, commands[:, axis], color=INK, lw=1.1, drawstyle="steps-post", label="command")
            for place, (policy, trace) in enumerate(traces.items()):
                ax.plot(trace.time_s, _smooth(_velocity(trace)[:, axis], trace), label=policy, **line(place))
            for push in plan.pushes:
                ax.axvline(push.time_s, color=INK, lw=0.8, dashes=(2, 2))
            ax.set_ylabel(name)
        for push in plan.pushes:
            axes[0].annotate(
                "push", (push.time_s, 1.0), (4, -4), xycoords=("data", "axes fraction"),
                textcoords="offset points", va="top",
            )  # fmt: skip
        axes[-1].set_xlabel("time, s")
        axes[-1].set_xlim(0.0, plan.duration_s)
        legend_above(figure, axes[0], 6)
        return to_svg(figure, "Commanded and true forward, leftward and yaw velocity over the course")


def torque_speed(traces: Mapping[str, Trace], robot: Robot) -> str | None:
    """Where the motors work on the course, within what they can deliver."""
    if not traces:
        return None
    kinds: dict[str, list[int]] = {joint.motor: [] for joint in robot.description.joints}
    for index, joint in enumerate(robot.description.joints):
        kinds[joint.motor].append(index)
    with drawing("torque"):
        figure, axes = axes_grid(
            len(kinds), len(traces), (WIDTH_IN, 2.6 * len(kinds)), sharex="row", sharey="row"
        )
        for row, (kind, joints) in enumerate(kinds.items()):
            for place, (policy, trace) in enumerate(traces.items()):
                ax = axes[row * len(traces) + place]
                speed, torque = trace.joint_velocity[:, joints], trace.motor_torque[:, joints]
                ax.plot(
                    speed.ravel(), torque.ravel(), ".", ms=2.2, mew=0, alpha=0.35,
                    color=colour(place), rasterized=True,
                )  # fmt: skip
                _envelope(ax, robot, joints[0])
                if row == 0:
                    ax.set_title(policy)
                if place == 0:
                    ax.set_ylabel(f"{kind}\ntorque, N m")
        for ax in axes[-len(traces) :]:
            ax.set_xlabel("speed, rad/s")
        return to_svg(figure, "Motor torque against joint speed on the course, with the motors' limits")


def _envelope(ax: Axes, robot: Robot, joint: int) -> None:
    motor = type(robot.motor)(*(np.broadcast_to(part, robot.armature.shape)[joint] for part in robot.motor))
    speed = np.linspace(-1.05, 1.05, 211) * motor.no_load_speed
    for extreme in (np.inf, -np.inf):
        ax.plot(speed, limit_torque(np.full_like(speed, extreme), speed, motor), color=INK, lw=1.0)


def timing(traces: Mapping[str, Trace], periods_ms: Mapping[str, float]) -> str | None:
    """How long policy steps take, against the time they have."""
    shown = {name: trace for name, trace in traces.items() if len(trace.compute_ms)}
    if not shown:
        return None
    with drawing("timing"):
        figure, axes = axes_grid(len(shown), 1, (WIDTH_IN, 0.7 + 1.15 * len(shown)), sharex="all")
        fastest = min(float(trace.compute_ms.min()) for trace in shown.values())
        slowest = max(*periods_ms.values(), *(float(t.compute_ms.max()) for t in shown.values()))
        bins = np.geomspace(0.9 * fastest, 1.3 * slowest, 90).tolist()
        for place, (ax, (policy, trace)) in enumerate(zip(axes, shown.items(), strict=True)):
            weights = np.full(len(trace.compute_ms), 1.0 / len(trace.compute_ms))
            ax.hist(trace.compute_ms, bins, weights=weights, color=colour(place), alpha=0.8)
            p50, p99 = np.percentile(trace.compute_ms, [50, 99])
            for time_ms, name in ((p50, "p50"), (p99, "p99"), (periods_ms[policy], "deadline")):
                ax.axvline(time_ms, color=INK, lw=0.9, dashes=(1, 0) if name == "deadline" else (3, 2))
                ax.annotate(
                    name, (time_ms, 1.0), (3, -2), xycoords=("data", "axes fraction"),
                    textcoords="offset points", va="top", fontsize=8.5,
                )  # fmt: skip
            ax.set_title(f"{policy}: p50 {p50:.3f} ms, p99 {p99:.3f} ms, {1e3 / periods_ms[policy]:.0f} Hz")
            ax.set(xscale="log", yticks=[])
            ax.spines["left"].set_visible(False)
        axes[-1].set_xlabel("time per policy step, ms")
        return to_svg(figure, "Histogram of the time that each contender's steps take")


def _velocity(trace: Trace) -> np.ndarray:
    """Forward and leftward velocity and yaw rate, (T, 3)."""
    return np.column_stack([trace.base_velocity[:, :2], trace.base_angular_velocity[:, 2]])


def _smooth(values: np.ndarray, trace: Trace) -> np.ndarray:
    """Moving average over `SMOOTHED_S`, shape (T,)."""
    width = max(1, round(SMOOTHED_S * trace.record_rate_hz))
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="edge")
    return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
