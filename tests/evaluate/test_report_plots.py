"""Data of the lines, bars and marks of a report's plots."""

import html
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from traces import walk

from footfall import Push, Robot, Trace
from footfall.evaluate.plan import CommandSchedule, EpisodePlan
from footfall.evaluate.report import course_plots, learning_curves, scenario_plots, svg
from footfall.evaluate.report.course_plots import Walk
from footfall.evaluate.report.svg import Panel, Reading

PLAN = EpisodePlan(
    scenario="course", index=0, seed=0, duration_s=6.0,
    schedule=CommandSchedule((0.0, 2.0, 5.0), ((0.0, 0.0, 0.0), (0.6, -0.2, 0.3), (1.0, 0.1, -0.4))),
    pushes=(Push(1.5, (0.0, 0.4, 0.0)), Push(4.25, (0.5, 0.0, 0.0))), levels={}, randomised=False,
)  # fmt: skip


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Axes]:
    """The axes of a plot's panels in drawing order; no SVG is made of them."""
    panels: list[Axes] = []
    monkeypatch.setattr(Panel, "svg", lambda panel, *_: panels.append(panel.axes) or Markup("<panel>"))
    return panels


def lines(panel: Axes, colour: str) -> list[Line2D]:
    return [line for line in panel.lines if line.get_color() == colour]


def points(panel: Axes, colour: str) -> list[list[float]]:
    """x and y of the first line of this colour."""
    return np.asarray(lines(panel, colour)[0].get_xydata()).T.tolist()


def row(falls: int, episodes: int, interval: tuple[float, float], **more: float | None) -> dict[str, Any]:
    return {"falls": falls, "episodes": episodes, "fall_rate_interval": list(interval), **more}


def test_the_share_without_a_fall_is_drawn_for_each_push(drawn: list[Axes]) -> None:
    rows = [row(1, 8, (0.05, 0.4), push_m_s=1.0), row(6, 8, (0.5, 0.9), push_m_s=2.5)]
    half = {"dv50": 1.8, "dv50_interval": [1.5, None], "dv50_width": 0.25, "strongest_push": 3.0}
    summary = {"rows": rows, "falls": 7, "episodes": 16, **half}
    scenario_plots.survival({"none": {"episodes": 0}, "a": summary})
    (panel,) = drawn  # of the second policy
    (bar,) = panel.containers
    measured, _, (edges,) = bar
    assert measured.get_xydata().tolist() == [[1.0, 0.875], [2.5, 0.25]]
    shares = [segment[:, 1] for segment in edges.get_segments()]
    np.testing.assert_allclose(shares, [[0.6, 0.95], [0.1, 0.5]])


def test_each_condition_has_its_error_and_its_falls(drawn: list[Axes]) -> None:
    def rows(level: str, *errors: float | None) -> dict[str, Any]:
        levels = [{level: 0.2 * (k + 1), "lin_vel_rmse": error} for k, error in enumerate(errors)]
        return {"rows": [row(k, 8, (0, 1), **each) for k, each in enumerate(levels)]}

    none = {"episodes": 0}
    plot = scenario_plots.conditions(
        [
            ("friction", {"none": none, "a": rows("friction", 0.3, 0.1, None)}),
            ("payload_kg", {"none": none, "a": {"rows": []}}),
            ("kp", {"none": rows("kp", 0.5), "a": rows("kp", 0.25, 0.75)}),
        ]
    )
    assert list(plot.legend) == [0, 1]
    error, falls, _, other_falls = drawn
    np.testing.assert_allclose(points(error, svg.colour(1)), [[0.2, 0.4, 0.6], [0.3, 0.1, np.nan]])
    assert points(falls, svg.colour(1))[1] == [0.0, 12.5, 25.0]
    assert points(other_falls, svg.colour(1))[1] == [0.0, 12.5]


def test_a_cell_of_a_sweep_has_the_error_of_its_command(drawn: list[Axes]) -> None:
    tried = (
        (1.0, -0.5, 0.1, 0), (0.25, 0.8, 0.3, 2), (0.25, -0.5, 0.9, 0),
        (-1.0, 0.8, None, 0), (-1.0, -0.5, 0.6, 0),
    )  # fmt: skip
    rows = [
        row(falls, 4, (0, 1), forward_m_s=forward, yaw_rad_s=yaw, lin_vel_rmse=error)
        for forward, yaw, error, falls in tried
    ]
    scenario_plots.sweep({"none": {"episodes": 0}, "a": {"rows": rows}})
    (panel,) = drawn
    (picture,) = panel.images
    cells: Any = np.ma.filled(np.ma.asarray(picture.get_array()), np.nan)
    np.testing.assert_array_equal(cells, [[0.6, 0.9, 0.1], [np.nan, 0.3, np.nan]])
    assert picture.origin == "lower"
    largest = np.percentile([0.1, 0.3, 0.6, 0.9], 95)
    assert (picture.norm.vmin, picture.norm.vmax) == (0.0, pytest.approx(largest))
    assert [label.get_text() for label in panel.get_xticklabels()] == ["-1", "0.25", "1"]
    assert [label.get_text() for label in panel.get_yticklabels()] == ["-0.5", "0.8"]


def wandering(seconds: float = 6.0, fell: bool = False) -> Trace:
    """A trace with a different velocity on each axis."""
    trace = walk(seconds)
    velocity = np.tile([0.5, -0.2, 9.0], (len(trace.time_s), 1))
    turning = np.array([7.0, 8.0, 0.0]) + np.outer(trace.time_s, [0.0, 0.0, 0.1])
    return replace(trace, base_velocity=velocity, base_angular_velocity=turning, fell=fell)


def test_the_command_is_a_staircase_and_each_policy_a_line(drawn: list[Axes]) -> None:
    walks = [Walk(1, "b", wandering(), 20.0), Walk(2, "c", wandering(3.0, fell=True), 20.0)]
    assert list(course_plots.tracking(walks, PLAN).legend) == [1, 2]
    for axis, panel in enumerate(drawn):
        x, y = points(panel, svg.INK)
        np.testing.assert_allclose(x, np.arange(60) / 10)
        edges = (0, 19, 20, 49, 50)
        assert [y[k] for k in edges] == [PLAN.schedule(k / 10)[axis] for k in edges]
        for colour, seconds in ((svg.colour(1), 6.0), (svg.colour(2), 3.0)):
            x, y = points(panel, colour)
            assert (x[0], x[-1]) == (0.0, pytest.approx(seconds - 0.01))
            assert y[150] == pytest.approx((0.5, -0.2, 0.15)[axis], abs=2e-3)
        pushes_s = [np.asarray(line.get_xdata())[0] for line in lines(panel, svg.INK)[1:]]
        assert pushes_s == [1.5, 4.25]


class TestGait:
    def test_the_steady_window_is_in_the_longest_motion_not_in_a_longer_stand(self) -> None:
        def window(from_s: tuple[float, ...], *forward: float) -> tuple[float, float]:
            schedule = CommandSchedule(from_s, tuple((each, 0.0, 0.0) for each in forward))
            return course_plots.steady_window(replace(PLAN, schedule=schedule))

        assert window((0.0, 4.5), 0.0, 0.5) == (4.5, 6.0)
        assert window((0.0, 3.5, 4.0), 0.5, 0.0, 0.7) == (1.5, 3.5)
        assert window((0.0, 1.0, 2.0), 0.0, 0.5, 0.0) == (1.0, 2.0)

    def test_bars_begin_and_end_at_contact(self) -> None:
        for contact, bars in (
            ([1, 1, 1, 1], [(0.0, 0.4)]), ([1, 0, 1, 0], [(0.0, 0.1), (0.2, 0.1)]), ([0, 0, 0, 0], []),
            ([1], [(0.0, 0.0)]),  # one sample is no stretch of time
        ):  # fmt: skip
            found = course_plots.contact_bars(np.arange(len(contact)) / 10.0, np.array(contact, dtype=bool))
            np.testing.assert_allclose(np.reshape(found, (-1, 2)), np.reshape(bars, (-1, 2)), atol=1e-12)

    def test_touchdowns_are_counted_per_foot_and_second(self) -> None:
        contact = np.array([[1, 0], [0, 0], [1, 1], [1, 0], [0, 1]], dtype=bool)
        assert course_plots.touchdown_rate_hz(contact, 10.0) == pytest.approx(3 / 2 / 0.5)


def test_a_learning_curve_is_over_million_steps_in_its_colour(drawn: list[Axes], tmp_path: Path) -> None:
    first, _, third, *_ = learning_curves.CURVES
    rows = [{"step": 1_500_000 * k, first: 0.5 * k, third: -3.0 * k} for k in (1, 2, 3)]
    (tmp_path / "metrics.jsonl").write_text("\n".join(json.dumps(row) for row in rows))
    plot = learning_curves.learning_curves({"stand": "stand", "mine": str(tmp_path)})
    reward, length = drawn  # there is no error to show
    assert points(reward, svg.colour(1)) == [[1.5, 3.0, 4.5], [0.5, 1.0, 1.5]]
    assert points(length, svg.colour(1))[1] == [-3.0, -6.0, -9.0]
    assert list(plot.legend) == [1]


def test_without_data_there_is_no_panel(go1: Robot) -> None:
    plots = [
        scenario_plots.survival({}), course_plots.tracking([], PLAN), course_plots.gait([], PLAN, go1),
        scenario_plots.conditions([]), scenario_plots.sweep({}), course_plots.torque_speed([], go1),
        course_plots.timing([]), learning_curves.learning_curves({}),
    ]  # fmt: skip
    assert not any(plot.panels for plot in plots)


def test_each_value_is_at_its_point() -> None:
    with Panel("p", height=120.0) as panel:
        panel.axes.plot([0.0, 4.0], [-1.0, 1.0], color="#123456")
        panel.axes.set(xlim=(0.0, 4.0), ylim=(-1.0, 1.0))
        drawing = panel.svg("x", [Reading(0.0, -1.0, "a"), Reading(4.0, 1.0, "b"), Reading(2.0, None, "c")])
    placed = json.loads(html.unescape(drawing.split('data-readings="')[1].split('"')[0]))
    left, top, right, bottom = placed["box"]
    middle = pytest.approx((left + right) / 2, abs=0.1)
    assert placed["points"] == [[left, bottom, "a"], [right, top, "b"], [middle, None, "c"]]
    path = re.search(r'd="M ([\d.]+) ([\d.]+) \s*L ([\d.]+) ([\d.]+) \s*"[^>]*#123456', drawing)
    assert path is not None
    assert [left, bottom, right, top] == pytest.approx([float(each) for each in path.groups()], abs=0.06)
