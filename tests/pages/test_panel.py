"""Controls and curves beside the 3-D view, and the metrics that they show while a run grows."""

import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from page_controls import PageControls

from footfall.pages.live_curves import LiveCurves
from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.pages.moment import Moment
from footfall.pages.panel import Panel
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot

WIDE = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0))
AXES = ("Forward, m/s", "Left, m/s", "Yaw, rad/s")
TWO_LINES = '{"step": 10, "a": 1}\n{"step": 20, "a": 2}\n'


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The file of a run's metrics."""
    return tmp_path / "metrics.jsonl"


@pytest.fixture
def page() -> PageControls:
    return PageControls()


@pytest.fixture
def panel(page: PageControls) -> Panel:
    return Panel(page)  # type: ignore[arg-type]


def test_sliders_span_the_ranges_and_begin_with_a_walk_forward_if_possible() -> None:
    narrow = CommandRange((-1.0, 0.3), (0.1, 0.7), (-1.4, -0.2))
    for ranges, first in ((WIDE, [0.5, 0.0, 0.0]), (narrow, [0.3, 0.1, -0.2])):
        page = PageControls()
        panel = Panel(page)  # type: ignore[arg-type]
        assert not page["Command"].visible
        panel.offer_commands(ranges)
        assert page["Command"].visible
        assert [(page[axis].min, page[axis].max) for axis in AXES] == list(vars(ranges).values())
        np.testing.assert_allclose(panel.command, first)


def test_a_number_beyond_a_range_is_clipped_and_shown(panel: Panel, page: PageControls) -> None:
    panel.offer_commands(WIDE)
    for axis, value in zip(AXES, (9.0, -9.0, 0.25), strict=True):
        page[axis].value = value  # before the value has been handled
    np.testing.assert_allclose(panel.command, [1.5, -0.5, 0.25])
    page[AXES[0]].type(9.0)
    page["Push, m/s"].type(9.0)
    assert (page[AXES[0]].value, page["Push, m/s"].value) == (1.5, page["Push, m/s"].max)
    for value in (np.nan, "fast", None, [1.0]):
        page[AXES[0]].type(value)
        assert page[AXES[0]].value == 0.0
        page[AXES[1]].value = value  # before the value has been handled
        assert np.isfinite(panel.command).all()


def test_pushes_and_restarts_are_taken_once(panel: Panel, page: PageControls) -> None:
    assert (panel.take_push(), panel.take_restart()) == (0.0, False)
    push = page["Push, m/s"]
    for speed in (1.7, 0.05, 50.0):
        push.value = speed
        page["Push it"].click()
        taken = np.clip(speed, push.min, push.max)
        assert (panel.take_push(), panel.take_restart()) == (taken, False)
    assert push.min < 1.7 < push.max
    page["Start again"].click()
    assert (panel.take_push(), panel.take_restart()) == (0.0, True)
    assert not panel.take_restart()


def test_each_chart_shows_its_metric(panel: Panel, page: PageControls, path: Path) -> None:
    """The names are those that a training writes. A single point is not drawn."""
    scales = {"reward/total": 1.0, "tracking/linear_error_m_s": 1.0, "tracking/yaw_error_rad_s": 1.0}
    scales |= {"episode/length_s": 1.0, "learning/learning_rate": 1e3, "speed/steps_per_s": 1e-3}
    metrics, steps = MetricsFile(path), np.array([1, 2, 4])
    rows = [{"step": 1_000_000 * k} | {name: k + n for n, name in enumerate(scales)} for k in (1, 2, 4)]
    for count in (1, 2, 3):
        path.write_text("".join(json.dumps(row) + "\n" for row in rows[:count]))
        metrics.refresh()
        panel.draw(metrics, finished=False)
        assert len(page.charts) == (len(scales) if count > 1 else 0)
    for n, (chart, scale) in enumerate(zip(page.charts.values(), scales.values(), strict=True)):
        np.testing.assert_allclose(chart.data, [steps, scale * (steps + n)])


def test_the_time_of_curves_counts_back_from_now(go1: Robot, page: PageControls) -> None:
    curves = LiveCurves(page, page.add_folder("curves"), go1)  # type: ignore[arg-type]
    sensed: Any = SimpleNamespace(gyro=np.zeros(3), joint_torque=np.zeros(len(go1.joint_names)))
    still, level = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    for tick in range(41):
        time_s = 1_795_778_150.0 + 0.5 * tick  # Unix time, as a run on the wall clock has it
        curves.add(Moment(time_s, still, level, np.array([0.3, 0.0, 0.0]), still, sensed, np.ones(4)))
    times, measured, command = page.charts["Forward, m/s"].data
    np.testing.assert_allclose(times, np.arange(-10.0, 0.1, 0.5), atol=1e-6)
    np.testing.assert_allclose(measured, 0.3)
    np.testing.assert_allclose(command, 0.0)


def test_the_age_of_metrics_is_since_the_last_line(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MetricsFile(path).age_s() is None
    path.write_text(TWO_LINES)
    os.utime(path, (1000.0, 2000.0))
    monkeypatch.setattr("footfall.pages.metrics_file.time.time", lambda: 2042.0)
    assert MetricsFile(path).age_s() == pytest.approx(42.0)


def test_an_invalid_line_is_ignored(path: Path) -> None:
    for line in ("", "{", "[1]", "7", '{"a": 1}', '{"step": null}', '{"step": "x"}'):
        path.write_text(f'{{"step": 5, "a": 3}}\n{line}\n{TWO_LINES}')
        metrics = MetricsFile(path)
        assert metrics.refresh()
        np.testing.assert_array_equal(metrics.curve("a"), [[5, 10, 20], [3, 1, 2]], line)


def test_curves_grow_with_the_file_by_whole_lines_and_begin_again_with_a_shorter_file(path: Path) -> None:
    metrics, three_lines = MetricsFile(path), TWO_LINES + '{"step": 30, "a": 9}\n'
    assert not metrics.refresh()
    for text, refreshed, steps, values in (
        (TWO_LINES, True, [10, 20], [1, 2]),
        (TWO_LINES + '{"step": 30, ', False, [10, 20], [1, 2]),
        (three_lines, True, [10, 20, 30], [1, 2, 9]),
        (three_lines, False, [10, 20, 30], [1, 2, 9]),  # nothing new
        ('{"step": 10, "a": 3}\n', True, [10], [3]),
    ):
        path.write_text(text)
        assert metrics.refresh() is refreshed
        np.testing.assert_array_equal(metrics.curve("a"), [steps, values])
        assert metrics.last_step == steps[-1]


def test_a_long_curve_is_thinned_except_at_its_ends() -> None:
    few = thinned(np.arange(10_000), 400)
    assert (len(few), few[0], few[-1]) == (400, 0, 9999)
    assert (np.diff(few) > 0).all()
