"""The page of the report."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from markupsafe import Markup
from report_pages import COURSE, Page, comparison, page_of, result, walked

from footfall.evaluate.comparison import Comparison, command_line
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import (
    course_plots,
    learning_curves,
    svg,
)
from footfall.evaluate.report import page as page_module
from footfall.evaluate.report.films import Film, FilmTask, frame_indices, frame_times
from footfall.robots.description import Robot


@pytest.fixture(scope="module")
def page(go1: Robot) -> str:
    good = result("mine", "runs/mine", 0.1, 0, 2.0, walked())
    return page_of(go1, good, result("trot", "trot", 0.3, 9, 1.0, walked(5.0, fell=True)))


@pytest.fixture
def quick_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three plots that are made in no time, the last of which is empty."""
    panel = Markup("<b>panel</b>")
    plots = [svg.Plot(f"Plot {k}", f"caption {k}", [panel] * (2 - k), [1]) for k in (0, 1, 2)]
    monkeypatch.setattr(page_module, "plots", lambda _: plots)


class TestPage:
    def test_opens_with_the_verdict(self, page: str) -> None:
        words = Page(page).words
        sentence = "mine falls least often (0 of 24, against 9 of 24 of trot)"
        assert words.index(sentence) < words.index("Headline figures")

    def test_is_self_contained_and_ids_are_unique(self, page: str) -> None:
        parsed = Page(page)
        assert all(reference.startswith(("data:", "#")) for reference in parsed.references)
        assert not re.search(r"(?:@import|url\(\s*['\"]?https?:)", page)
        assert len(set(parsed.identities)) == len(parsed.identities) > 100

    def test_falls_to_pushes_stand_in_a_table_of_their_own(self, page: str) -> None:
        words = Page(page).words
        assert "11 of 24" in words[words.index("Falls in each scenario") :][:600]

    def test_stars_mark_intervals_that_do_not_overlap(self, page: str, go1: Robot, quick_plots: None) -> None:
        assert page.count("★</span>") == 7  # falls, error and push, falls again, and all below
        alike = [result(name, name, 0.1, 4, 2.0, walked(1.0)) for name in ("a", "b")]
        assert "★</span>" not in page_of(go1, *alike)

    def test_shows_the_command_for_the_same_figures(self, page: str, go1: Robot) -> None:
        command = (
            "footfall compare runs/mine trot --robot go1 --scenarios nominal,push --seed 3 --episodes 24"
        )
        assert command in page
        odd = comparison(go1, result("x", "my runs/x; rm", 0.1, 0, 1.0, None))
        bare = replace(odd, config=replace(odd.config, episodes=None, plant=Path("b.xml"), ground_truth=True))
        assert command_line(bare) == (
            "footfall compare 'my runs/x; rm' --robot go1 --scenarios nominal,push --seed 3"
            " --plant b.xml --ground-truth --html report.html"
        )

    def test_shows_how_it_was_measured(self, page: str) -> None:
        for fact in ("made by hand", "mujoco 3.1", "push_between_s", "reached the end", "fell after 5.0 s"):
            assert fact in page

    def test_without_a_film_the_reason_is_given(self, go1: Robot) -> None:
        text = page_of(go1, result("mine", "mine", 0.1, 0, 2.0, None))
        assert "No film of mine: its process died." in text
        assert "mine did not walk the course: its process died" in text

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
        assert "1 of 1 episode failed: its process died (1)" in text


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


def test_long_curves_are_means_of_stretches() -> None:
    rows = [{"step": float(i), "a": float(i), "b": float("nan")} for i in range(960)]
    points = learning_curves.curve(rows, "a")
    assert points[0] == pytest.approx([1.5, 1.5])
    assert points.shape == (learning_curves.MAX_POINTS, 2)
    assert len(learning_curves.curve(rows, "b")) == 0


def test_all_films_are_as_long_and_a_fall_holds_its_last_picture() -> None:
    whole, fallen = (FilmTask("go1", None, trace, (), 12.0) for trace in (walked(), walked(5.0, fell=True)))
    assert frame_times(whole)[[0, 1, -1]] == pytest.approx([0.0, 0.04, 11.96])
    assert len(frame_indices(whole)) == len(frame_indices(fallen)) == 300
    assert frame_indices(whole)[[0, 1, 299]].tolist() == [0, 4, 1196]
    assert frame_indices(fallen)[[124, 125, 299]].tolist() == [496, 499, 499]


@pytest.fixture
def two(go1: Robot) -> Comparison:
    """The second policy is worse except for pushes, and did not walk the course."""
    return comparison(
        go1, result("mine", "runs/mine", 0.1, 0, 1.0, walked()), result("trot", "trot", 0.3, 12, 2.0, None)
    )


class TestOrder:
    @pytest.fixture
    def read(self, quick_plots: None) -> Callable[..., str]:
        """The words of a page."""

        def words(of: Comparison, **seen: Film) -> str:
            shown = {policy.name: TaskResult(seen.get(policy.name), "no light") for policy in of.policies}
            return " ".join(Page(page_module.render(of, shown)).words.split())

        return words

    def test_unusual_conditions_are_stated(self, two: Comparison, read: Callable[..., str]) -> None:
        usual = read(two)
        assert "plant" not in usual[: usual.index("Headline figures")]
        words = read(replace(two, config=replace(two.config, ground_truth=True, plant=Path("a/heavy.xml"))))
        assert "--ground-truth" in words
        assert "plant heavy.xml" in words

    def test_a_films_caption_has_the_end_of_the_walk(self, go1: Robot, read: Callable[..., str]) -> None:
        fell = result("mine", "mine", 0.1, 0, 2.0, walked(5.0, fell=True))
        other = result("trot", "trot", 0.3, 9, 1.0, walked())
        words = read(comparison(go1, fell, other), mine=Film(b"f", b"p"), trot=Film(b"f", b"p"))
        assert "mine fell after 5.0 s trot reached the end" in words

    def test_films_on_a_ground_follow_those_of_the_course(self, go1: Robot, quick_plots: None) -> None:
        plan = replace(COURSE, levels={"step_m": 0.2})
        both = [
            replace(
                each, on_grounds={"stairs": replace(each.course, plan=plan, trace=walked(3.0, fell=True))}
            )
            for each in (result(name, name, 0.1, 0, 2.0, walked()) for name in ("mine", "trot"))
        ]
        shown = {name: TaskResult(Film(b"f", b"p")) for name in ("mine", "trot")}
        page = page_module.render(comparison(go1, *both), shown, {"stairs": shown})
        assert page.count("<video") == 4
        words = " ".join(Page(page).words.split())
        assert (
            words.index("trot reached the end")
            < words.index("step_m 0.2")
            < words.index("mine fell after 3.0 s")
        )
