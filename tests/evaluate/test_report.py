"""The report: short comparisons end to end, and its page, tables and names for figures made by hand."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from markupsafe import Markup
from report_pages import FILE, Page, comparison, page_of, result, walked
from rich.console import Console

from footfall.evaluate import api
from footfall.evaluate.comparison import Comparison
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import course_plots, films, svg, tables
from footfall.evaluate.report import page as page_module
from footfall.evaluate.report.short_names import MAX_CHARS, short_names
from footfall.evaluate.report.tables import Cell, Heading
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint
from footfall.evaluate.suite import run_suite
from footfall.plant.episode import Push
from footfall.robots.description import Robot

PUSHES = {"push_m_s": (0.1, 6.0), "push_direction_deg": (0.0, 90.0)}
SHORT = ScenarioFile(
    noise=FILE.noise,
    scenarios={
        "still": Scenario("Standing", 2, 1.3),
        "push": Scenario("Pushed", 4, 1.0, levels=PUSHES, push_between_s=(0.1, 0.2), rows=("push_m_s",)),
        "course": Scenario("A stand", 1, 1.2, script=(Waypoint(0.0),), pushes=(Push(0.5, (0.0, 0.2, 0.0)),)),
    },
)


def test_figures_depend_on_the_push_and_not_on_the_number_of_workers() -> None:
    """A standing robot survives a small push and falls after a large one."""
    alone, together = (
        run_suite(["stand"], EvaluationConfig("go1", ("push",), workers=workers), SHORT)["stand"]["push"]
        for workers in (1, 2)
    )
    for figures in (alone, together):
        del figures["compute_ms"], figures["missed_deadlines"]
        assert [(row["push_m_s"], row["falls"]) for row in figures["rows"]] == [(0.1, 0), (6.0, 2)]
        assert 0.1 < figures["dv50"] < 6.0
    assert alone == together


def test_a_comparison_without_rendering(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Results are grouped by policy; the page gives the reason for missing films."""
    monkeypatch.setattr(api, "load_scenarios", lambda *_: SHORT)
    failed = TaskResult(None, "egl: no display")
    monkeypatch.setattr(films, "render_films", lambda tasks, *_: [failed] * len(tasks))
    config = EvaluationConfig("go1", ("still", "push"), episodes=1, workers=1)
    outputs = {"json_path": tmp_path / "report.json", "html_path": tmp_path / "report.html"}
    results = api.compare_policies(["stand", "trot"], config, **outputs, console=Console(quiet=True))
    assert results == json.loads((tmp_path / "report.json").read_text())
    assert list(results) == ["stand", "trot"]
    for name, figures in results.items():
        assert (figures["policy"], set(figures["scenarios"])) == (name, {"still", "push"})
        assert 0.0 < figures["compute_ms"]["p50"] <= figures["compute_ms"]["p99"]
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert text.count("No film of ") == text.count("egl: no display") == 2


@pytest.fixture(scope="module")
def page(go1: Robot) -> str:
    good = result("mine", "runs/mine", 0.1, 0, 2.0, walked())
    return page_of(go1, good, result("trot", "trot", 0.3, 9, 1.0, walked(5.0, fell=True)))


@pytest.fixture
def quick_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three plots that are quick to draw; the third is empty."""
    panel = Markup("<b>panel</b>")
    plots = [svg.Plot(f"Plot {k}", f"caption {k}", [panel] * (2 - k), [1]) for k in (0, 1, 2)]
    monkeypatch.setattr(page_module, "plots", lambda _: plots)


class TestPage:
    def test_the_page_opens_with_the_verdict(self, page: str) -> None:
        words = Page(page).words
        sentence = "mine falls least often (0 of 24, against 9 of 24 of trot)"
        assert words.index(sentence) < words.index("Headline figures")

    def test_the_page_is_self_contained_and_ids_are_unique(self, page: str) -> None:
        parsed = Page(page)
        assert all(reference.startswith(("data:", "#")) for reference in parsed.references)
        assert not re.search(r"(?:@import|url\(\s*['\"]?https?:)", page)
        assert len(set(parsed.identities)) == len(parsed.identities) > 100

    def test_stars_mark_intervals_that_do_not_overlap(self, page: str, go1: Robot, quick_plots: None) -> None:
        assert page.count("★</span>") == 7  # columns: falls, error and push, falls again, and all below
        alike = [result(name, name, 0.1, 4, 2.0, walked(1.0)) for name in ("a", "b")]
        assert "★</span>" not in page_of(go1, *alike)

    def test_policies_may_have_any_name(self, go1: Robot) -> None:
        names = ["_a$\\frac$b", "<b>&amp;\"' {{ 1 + 1 }}", "ø\u2028 $"]
        text = page_of(go1, *(result(name, name, 0.1, 1, 2.0, walked(3.0)) for name in names))
        words = Page(text).words
        assert all(" ".join(name.split()) in words for name in names)
        assert names[1] not in text

    def test_a_policy_whose_episodes_all_failed_has_no_figures(self, go1: Robot, quick_plots: None) -> None:
        failed = {"episodes": 0, "failed_episodes": ["episode 0: its process died"]}
        dead = result("dead", "dead", 0.1, 0, 2.0, None)
        dead = replace(dead, result={"scenarios": {"nominal": failed, "push": failed}})
        assert "1 of 1 episode" in page_of(go1, dead, result("mine", "mine", 0.1, 0, 2.0, walked()))


def test_a_walk_keeps_its_position_after_others(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A policy's index determines its colour in all plots."""
    given: list[course_plots.Walk] = []
    for name in ("tracking", "gait", "torque_speed", "timing"):
        note = lambda walks, *_: given.extend(walks) or svg.Plot("", "", [])  # noqa: E731
        monkeypatch.setattr(course_plots, name, note)
    traces = {"a": None, "b": walked(2.0), "c": walked(1.0)}
    of = comparison(go1, *(result(name, name, 0.1, 0, 2.0, trace) for name, trace in traces.items()))
    page_module.plots(of)
    assert [(walk.policy_index, walk.policy) for walk in given] == [(1, "b"), (2, "c")] * 4
    assert [walk.trace for walk in given[:2]] == [traces["b"], traces["c"]]


class TestTables:
    @pytest.fixture
    def two(self, go1: Robot) -> Comparison:
        """The second policy is worse except for pushes, and did not walk the course."""
        mine = result("mine", "runs/mine", 0.1, 0, 1.0, walked())
        return comparison(go1, mine, result("trot", "trot", 0.3, 12, 2.0, None))

    def test_the_headline_has_a_figure_of_each_policy_in_its_row(self, two: Comparison) -> None:
        table = tables.headline_table(two)
        assert table.corner == "Policy"
        assert table.columns == [
            Heading("Falls", "nominal"),
            Heading("Velocity error", "m/s, nominal"),
            Heading("Median survivable push", "m/s, push"),
            Heading("Time per step", "ms p50 / p99, alone"),
        ]
        per_step = Cell("0.21 / 0.40", "of 20 ms")
        best = [Cell("0 of 24", "0 to 14 %", is_best=True), Cell("0.100", "0.090 to 0.110", is_best=True)]
        worse = [Cell("12 of 24", "31 to 69 %"), Cell("0.300", "0.270 to 0.330")]
        push = Cell("2.00", "1.90 to 2.10", is_best=True)
        assert table.rows == [
            (Heading("mine", "made by hand", 0), [*best, Cell("1.00", "0.90 to 1.10"), per_step]),
            (Heading("trot", "made by hand", 1), [*worse, push, per_step]),
        ]

    def test_each_scenario_has_its_own_figures_and_endings(self, two: Comparison) -> None:
        nominal, push = tables.scenario_parts(two)
        for part, name in ((nominal, "nominal"), (push, "push")):
            assert (part.name, part.about) == (name, FILE.scenarios[name].about)
        assert nominal.table.columns == [Heading("mine", index=0), Heading("trot", index=1)]
        error = Heading("Velocity error", "m/s")
        assert [heading for heading, _ in nominal.table.rows] == [Heading("Falls"), error]
        assert Heading("Median survivable push", "m/s") in [heading for heading, _ in push.table.rows]
        assert [cell.text for cell in nominal.table.rows[1][1]] == ["0.100", "0.300"]
        assert nominal.endings == ["trot: the base touched the ground (12)"]
        assert push.endings == [f"{name}: the base touched the ground (11)" for name in ("mine", "trot")]


class TestShortNames:
    """A name is complete where there is room, otherwise without its middle."""

    LONG = "runs/2026-11-23_go1_without-height-scan_seed-17_policy-final"

    def test_a_long_name_keeps_its_beginning_and_its_end(self) -> None:
        names = ["mpc", "x" * MAX_CHARS]
        short = f"{self.LONG[:12]}…{self.LONG[-19:]}"
        assert len(short) == MAX_CHARS
        assert short_names([*names, self.LONG]) == {name: name for name in names} | {self.LONG: short}

    def test_shortened_names_stay_different(self) -> None:
        others = [self.LONG.replace("height", kind) for kind in ("camera", "memory")]
        found = short_names([self.LONG, *others])
        assert len(set(found.values())) == 3
        assert [short[-4:] for short in found.values()] == ["inal", " (2)", " (3)"]
        assert max(map(len, found.values())) == MAX_CHARS
        taken = short_names([self.LONG])[self.LONG]
        both = short_names([self.LONG, taken])
        assert both[taken] == taken != both[self.LONG]
