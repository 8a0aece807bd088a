"""Findings about a run from its log: end, faults, continuity of its paths, extreme values."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from footfall.deploy.log_analysis.columns import Column, LogColumns
from footfall.deploy.log_analysis.continuity import FOOT_JUMP_M, JOINT_JUMP_RAD, Continuity, continuity
from footfall.robots.description import Robot

MAX_POSES = 20_000  # readings of a long log that are used for the paths of the feet


@dataclass(frozen=True)
class LogFindings:
    """Values computed from a log's columns."""

    columns: LogColumns
    robot: Robot | None  # None if not available: then feet are omitted

    @cached_property
    def walking(self) -> list[tuple[float, float]]:
        """Start and end of each walking interval, s."""
        return [(start, end) for mode, start, end in self.columns.states() if mode == "WALKING"]

    @cached_property
    def faults(self) -> list[tuple[float, str]]:
        """Each fault with its time, s."""
        return [
            (event.time_s, event.text.partition(": ")[2])
            for event in self.columns.events
            if event.topic == "/state" and ": " in event.text
        ]

    @cached_property
    def policy_targets(self) -> Column:
        """Position targets from the policy, (T, n)."""
        count = len(self.columns.joints)
        time_s, values = self.columns.column("/policy/command", 5 * count)
        return Column(time_s, values[:, :count])

    def feet(self, joints: Column) -> np.ndarray:
        """Positions of the feet relative to the base for joint positions (T, n), (T, feet, 3) m."""
        assert self.robot is not None
        return np.array([self.robot.legs.pose(position.copy()).foot for position in joints.values]).reshape(
            -1, len(self.robot.description.feet), 3
        )

    @cached_property
    def measured(self) -> Column:
        """Measured joint positions, at most `MAX_POSES` from the start of walking, (T, n)."""
        count = len(self.columns.joints)
        time_s, values = self.columns.readings
        start = np.searchsorted(time_s, self.walking[0][0]) if self.walking else 0
        return Column(time_s[start:][:MAX_POSES], values[start:, :count][:MAX_POSES])

    @cached_property
    def target_feet(self) -> np.ndarray:
        """Positions of the feet for the policy's targets, (T, feet, 3) m."""
        return self.feet(Column(*(part[:MAX_POSES] for part in self.policy_targets)))

    @cached_property
    def measured_feet(self) -> np.ndarray:
        """Positions of the feet for the readings, (T, feet, 3) m."""
        return self.feet(self.measured)

    def paths(self) -> list[tuple[str, str, list[str], Continuity]]:
        """Continuity of each kind of path: kind, unit, names of the paths, finding."""
        joints = self.columns.joints
        found = [
            ("joint target", "rad", joints, _of_joints(self.policy_targets)),
            ("joint reading", "rad", joints, _of_joints(self.measured)),
        ]
        if self.robot is not None:
            names = [foot.name for foot in self.robot.description.feet]
            for what, column, positions in (
                ("foot target", self.policy_targets, self.target_feet),
                ("foot path", self.measured, self.measured_feet),
            ):
                finding = continuity(column.time_s[: len(positions)], positions, FOOT_JUMP_M)
                found.append((what, "m", names, finding))
        return [each for each in found if each[3].largest]

    def verdicts(self) -> list[str]:
        """Main findings, one line each."""
        log = self.columns.log
        modes = self.columns.states()
        last = modes[-1][0] if modes else "no state"
        lines = [f"It {'ended properly, in' if log.complete else 'was truncated in'} state {last}."]
        if log.damaged:
            lines.append(f"{log.damaged} damaged parts are skipped.")
        lines += [f"Fault at {time_s:.2f} s: {text}." for time_s, text in self.faults] or ["No fault."]
        for what, unit, names, (largest, largest_s, jumps) in self.paths():
            if jumps:
                time_s, path, size = jumps[0]
                lines.append(
                    f"{len(jumps)} jump{'s' * (len(jumps) > 1)} in {what}s: the first is in {names[path]}, by"
                    f" {size:.3g} {unit} at {time_s:.2f} s."
                )
            else:
                largest_step = f"the largest step is {largest:.3g} {unit}, at {largest_s:.2f} s"
                lines.append(f"Each {what} is continuous; {largest_step}.")
        return lines

    @property
    def good(self) -> bool:
        """Whether the run ended properly, without a fault, and with continuous measured paths."""
        jumped = any(finding.jumps for what, _, _, finding in self.paths() if "target" not in what)
        return self.columns.log.complete and not self.faults and not jumped

    def extremes(self) -> list[tuple[str, str]]:
        """Largest torque, speed and temperature, lowest voltage, timing: name and value."""
        count, joints = len(self.columns.joints), self.columns.joints
        rows = []
        readings = self.columns.readings.values.reshape(-1, 3, count)
        for part, name, unit in ((2, "largest torque", "N m"), (1, "largest speed", "rad/s")):
            size = np.abs(readings[:, part])
            if np.isfinite(size).any():
                size = np.nan_to_num(size)
                joint = int(size.max(axis=0).argmax())
                rows.append((name, f"{size[:, joint].max():.3g} {unit} ({joints[joint]})"))
        health = self.columns.column("/motor_health", 3 * count).values.reshape(-1, 3, count)
        if np.isfinite(health[:, 0]).any():
            hottest = int(np.nanmax(health[:, 0], axis=0).argmax()) if len(health) else 0
            rows.append(("hottest motor", f"{np.nanmax(health[:, 0]):.0f} °C ({joints[hottest]})"))
        if np.isfinite(health[:, 1]).any():
            rows.append(("lowest supply", f"{np.nanmin(health[:, 1]):.1f} V"))
        timing = self.columns.column("/loop_timing", 2).values
        if len(timing):
            p50, p99 = np.percentile(timing, (50, 99), axis=0)
            rows.append(("tick work", f"{p50[0]:.0f} µs p50, {p99[0]:.0f} µs p99"))
            rows.append(("tick lateness", f"{p50[1]:.0f} µs p50, {p99[1]:.0f} µs p99"))
        return rows


def _of_joints(column: Column) -> Continuity:
    return continuity(column.time_s, column.values[:, :, None], JOINT_JUMP_RAD)
