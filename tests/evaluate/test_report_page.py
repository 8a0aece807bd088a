"""The page of the report."""

import re
from dataclasses import replace

import pytest
from markupsafe import Markup
from report_pages import Page, comparison, page_of, result, walked

from footfall.evaluate.report import course_plots, svg
from footfall.evaluate.report import page as page_module
from footfall.evaluate.report.films import FilmTask, frame_indices, frame_times
from footfall.robots.description import Robot


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
        dead = result("dead", "dead", 0.1, 0, 2.0, None)
        failed = {"episodes": 0, "failed_episodes": ["episode 0: its process died"]}
        dead = replace(dead, result={"scenarios": {"nominal": failed, "push": failed}})
        text = page_of(go1, dead, result("mine", "mine", 0.1, 0, 2.0, walked()))
        assert "1 of 1 episode" in text


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


def test_films_are_equally_long_and_a_film_of_a_fall_ends_with_its_last_frame() -> None:
    whole, fallen = (FilmTask("go1", None, trace, (), 12.0) for trace in (walked(), walked(5.0, fell=True)))
    assert frame_times(whole)[[0, 1, -1]] == pytest.approx([0.0, 0.04, 11.96])
    assert len(frame_indices(whole)) == len(frame_indices(fallen)) == 300
    assert frame_indices(whole)[[0, 1, 299]].tolist() == [0, 4, 1196]
    assert frame_indices(fallen)[[124, 125, 299]].tolist() == [496, 499, 499]
