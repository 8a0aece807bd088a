"""Controls and curves beside the 3-D view."""

import json
from pathlib import Path

import numpy as np
import pytest
from page_controls import PageControls

from footfall.pages.metrics_file import MetricsFile
from footfall.pages.panel import Panel
from footfall.robots.commands import CommandRange

WIDE = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0))
AXES = ("Forward, m/s", "Left, m/s", "Yaw, rad/s")


@pytest.fixture
def page() -> PageControls:
    return PageControls()


@pytest.fixture
def panel(page: PageControls) -> Panel:
    return Panel(page)  # type: ignore[arg-type]


class TestCommands:
    def test_sliders_span_the_ranges_and_begin_near_a_walk_ahead(self) -> None:
        narrow = CommandRange((-1.0, 0.3), (0.1, 0.7), (-1.4, -0.2))
        for ranges, first in ((WIDE, [0.5, 0.0, 0.0]), (narrow, [0.3, 0.1, -0.2])):
            page = PageControls()
            panel = Panel(page)  # type: ignore[arg-type]
            assert not page["Command"].visible
            panel.offer_commands(ranges)
            assert page["Command"].visible
            assert [(page[axis].min, page[axis].max) for axis in AXES] == list(vars(ranges).values())
            np.testing.assert_allclose(panel.command, first)

    def test_a_number_beyond_a_range_is_clipped_and_shown(self, panel: Panel, page: PageControls) -> None:
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

    def test_pushes_and_restarts_are_taken_once(self, panel: Panel, page: PageControls) -> None:
        assert (panel.take_push(), panel.take_restart()) == (0.0, False)
        page["Push, m/s"].value = 1.7
        page["Push it"].click()
        assert (panel.take_push(), panel.take_restart()) == (1.7, False)
        page["Start again"].click()
        assert (panel.take_push(), panel.take_restart()) == (0.0, True)
        assert not panel.take_restart()
        for typed in (0.05, 50.0):
            page["Push, m/s"].value = typed
            page["Push it"].click()
            assert panel.take_push() == np.clip(typed, page["Push, m/s"].min, page["Push, m/s"].max)


def test_each_chart_shows_its_metric(panel: Panel, page: PageControls, tmp_path: Path) -> None:
    """The names are those that a training writes. A single point is not drawn."""
    scales = {"reward/total": 1.0, "tracking/linear_error_m_s": 1.0, "tracking/yaw_error_rad_s": 1.0}
    scales |= {"episode/length_s": 1.0, "learning/learning_rate": 1e3, "speed/steps_per_s": 1e-3}
    metrics = MetricsFile(tmp_path / "metrics.jsonl")
    steps = np.array([1, 2, 4])
    for count in (1, 2, 3):
        rows = [{"step": 1_000_000 * k} | {name: k + n for n, name in enumerate(scales)} for k in (1, 2, 4)]
        text = "".join(json.dumps(row) + "\n" for row in rows[:count])
        (tmp_path / "metrics.jsonl").write_text(text)
        metrics.refresh()
        panel.draw(metrics, finished=False)
        assert len(page.charts) == (len(scales) if count > 1 else 0)
    for n, (chart, scale) in enumerate(zip(page.charts.values(), scales.values(), strict=True)):
        np.testing.assert_allclose(chart.data, [steps, scale * (steps + n)])
