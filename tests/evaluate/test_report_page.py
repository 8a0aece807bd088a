"""The page of the report."""

import json
import re
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from markupsafe import Markup
from report_pages import COURSE, Page, comparison, page_of, pushed, result, summary, walked

from footfall.evaluate.comparison import Comparison, command_line
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.plan import CommandSchedule
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import (
    course_plots,
    films,
    learning_curves,
    scenario_plots,
    svg,
)
from footfall.evaluate.report import page as page_module
from footfall.evaluate.report.caption import in_words, written_on
from footfall.evaluate.report.films import Film, FilmTask, arrows, frame_indices, frame_times
from footfall.evaluate.report.page import columns
from footfall.plant.episode import Push
from footfall.plant.trace import Trace
from footfall.robots.description import Robot


@pytest.fixture(scope="module")
def page(go1: Robot) -> str:
    good = result("mine", "runs/mine", 0.1, 0, 2.0, walked())
    return page_of(go1, good, result("trot", "trot", 0.3, 9, 1.0, walked(5.0, fell=True)))


class TestPage:
    def test_opens_with_the_verdict(self, page: str) -> None:
        words = Page(page).words
        sentence = "mine falls least often (0 of 24, against 9 of 24 of trot)"
        assert words.index(sentence) < words.index("Headline figures")

    def test_needs_nothing_but_itself_and_names_each_element_once(self, page: str) -> None:
        parsed = Page(page)
        assert all(reference.startswith(("data:", "#")) for reference in parsed.references)
        assert not re.search(r"(?:@import|url\(\s*['\"]?https?:)", page)
        assert len(set(parsed.identities)) == len(parsed.identities) > 100

    def test_falls_to_pushes_stand_in_a_table_of_their_own(self, page: str) -> None:
        words = Page(page).words
        assert "11 of 24" in words[words.index("Falls in each scenario") :][:600]

    def test_stars_go_to_intervals_that_lie_apart(self, page: str, go1: Robot) -> None:
        assert page.count("★</span>") == 7  # falls, error and push, falls again, and all below
        alike = [result(name, name, 0.1, 4, 2.0, walked(1.0)) for name in ("a", "b")]
        assert "★</span>" not in page_of(go1, *alike)

    def test_cells_say_what_they_are_where_the_heading_is_out_of_sight(self, page: str) -> None:
        cells = re.findall(r"<td[^>]*>", page)
        assert cells
        assert all('data-label="' in cell for cell in cells)

    def test_says_how_to_get_the_same_figures(self, page: str, go1: Robot) -> None:
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

    def test_says_how_it_was_measured(self, page: str) -> None:
        for fact in ("made by hand", "mujoco 3.1", "push_between_s", "reached the end", "fell after 5.0 s"):
            assert fact in page

    def test_rows_of_pictures_are_full_where_that_is_possible(self) -> None:
        assert [columns(count) for count in range(1, 10)] == [1, 2, 3, 2, 3, 3, 3, 2, 3]

    def test_without_a_film_says_why(self, go1: Robot) -> None:
        text = page_of(go1, result("mine", "mine", 0.1, 0, 2.0, None))
        assert "No film of mine: its process died." in text
        assert "mine did not walk the course: its process died" in text

    def test_policies_may_have_any_name(self, go1: Robot) -> None:
        names = ["a$\\frac$b", "<b>&amp;\"'", "{{ 1 + 1 }}", "_hidden", "$", "ø\u2028"]
        text = page_of(go1, *(result(name, name, 0.1, 1, 2.0, walked(3.0)) for name in names))
        words = Page(text).words
        assert all(" ".join(name.split()) in words for name in names)
        assert names[1] not in text

    def test_all_its_episodes_failed_is_said_and_no_figure_is_invented(self, go1: Robot) -> None:
        dead = result("dead", "dead", 0.1, 0, 2.0, None)
        failed = {"episodes": 0, "failed_episodes": ["episode 0: its process died"]}
        dead = replace(dead, result={"scenarios": {"nominal": failed, "push": failed}})
        text = page_of(go1, dead, result("mine", "mine", 0.1, 0, 2.0, walked()))
        assert "1 of 1 episode failed: its process died (1)" in text


def taken(name: str, trace: Trace) -> course_plots.Walk:
    """A walk with its place by letter."""
    return course_plots.Walk("abc".index(name), name, trace, 20.0)


def readings(panel: str) -> list[list[Any]]:
    """The points with numbers of a panel."""
    attribute = re.search(r'data-readings="([^"]*)"', panel)
    assert attribute is not None
    return list(json.loads(attribute.group(1).replace("&#34;", '"').replace("&#39;", "'"))["points"])


class TestPlots:
    def test_pushes_have_a_panel_for_each_policy_with_its_numbers(self) -> None:
        plot = scenario_plots.survival({"a": pushed(2.0, 3), "b": pushed(1.0, 3)})
        assert len(plot.panels) == 2
        assert "a guess" not in plot.caption
        single = pushed(2.0, 1)
        single["rows"] = [row | {"episodes": 1, "falls": 0} for row in single["rows"]]
        assert "With 1 episode at a size" in scenario_plots.survival({"a": single}).caption
        _, x, (_, _, text) = readings(plot.panels[0])
        assert text.startswith("push of 3 m/s: 0 of 8 stayed up\n95 % interval 0 to 32 %")
        assert "median survivable push 2.00 m/s (1.90 to 2.10)" in text
        assert "push of 2 m/s: 5 of 8 stayed up\n95 % interval 31 to 86 %" in x[2]

    def test_points_lie_where_they_are_drawn(self) -> None:
        with svg.Panel("p") as panel:
            panel.axes.plot([0.0, 10.0], [0.0, 1.0], color="#123456")
            panel.axes.set(xlim=(0.0, 10.0), ylim=(0.0, 1.0))
            drawn = panel.svg("a line", [svg.Reading(0.0, 0.0, "low"), svg.Reading(10.0, 1.0, "high")])
        (left, bottom, _), (right, top, _) = readings(drawn)
        path = re.search(r'd="M ([\d.]+) ([\d.]+) \s*L ([\d.]+) ([\d.]+) \s*"[^>]*#123456', drawn)
        assert path is not None
        ends = [float(each) for each in path.groups()]
        assert [left, bottom, right, top] == pytest.approx(ends, abs=0.06)

    def test_tracking_reads_what_was_asked_and_done(self) -> None:
        plot = course_plots.tracking([taken("a", walked()), taken("b", walked(3.0, fell=True))], COURSE)
        assert len(plot.panels) == 3
        texts = [text for _, _, text in readings(plot.panels[0])]
        assert texts[20] == "2.0 s: command 1.00 m/s\na 1.00\nb 1.00"
        assert texts[50] == "5.0 s: command 0.60 m/s\na 0.60\nb fallen"
        turning = [text for _, _, text in readings(plot.panels[2])]
        assert turning[50] == "5.0 s: command 0.80 rad/s\na 0.80\nb fallen"

    def test_the_gait_is_read_where_one_command_holds_longest(self, go1: Robot) -> None:
        assert course_plots.steady_window(COURSE) == (2.0, 4.0)
        plot = course_plots.gait([taken("a", walked()), taken("b", walked(1.0, fell=True))], COURSE, go1)
        assert "a: duty 0.50, 2.0 strides/s" in plot.panels[0]
        first, second = go1.description.feet[0].name, go1.description.feet[3].name
        assert f"2.10 s: {first}, {second} on the ground" in [text for _, _, text in readings(plot.panels[0])]
        assert "b: fallen by then" in plot.panels[1]

    def test_the_gait_is_read_of_no_other_command_where_each_is_short(self) -> None:
        schedule = CommandSchedule((0.0, 1.5), ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)))
        hasty = replace(COURSE, schedule=schedule, duration_s=2.5)
        assert course_plots.steady_window(hasty) == (1.5, 2.5)

    def test_bars_begin_and_end_with_contact(self) -> None:
        time_s = np.arange(6) / 10.0
        contact = np.array([True, True, False, False, True, True])
        assert course_plots._bars(time_s, contact) == [(0.0, 0.2), (0.4, pytest.approx(0.2))]

    def test_a_policy_keeps_its_colour_where_another_has_nothing_to_show(self) -> None:
        walk = taken("b", walked())
        for plot in (course_plots.tracking([walk], COURSE), course_plots.timing([walk])):
            assert svg.colour(1) in plot.panels[0]
            assert svg.colour(0) not in plot.panels[0]

    def test_conditions_show_the_share_that_fell(self) -> None:
        row = {"friction": 0.2, "episodes": 4, "falls": 1, "lin_vel_rmse": 0.123}
        error, falls = scenario_plots.conditions([("friction", {"a": summary(0.1, 1, rows=[row])})]).panels
        assert readings(error)[0][2] == "friction coefficient 0.2: velocity error, m/s\na 0.123"
        assert readings(falls)[0][2] == "friction coefficient 0.2: falls, %\na 25"

    def test_a_cell_of_the_sweep_stands_at_its_command(self) -> None:
        rows = [
            {"forward_m_s": forward, "yaw_rad_s": yaw, "episodes": 1, "falls": 0, "lin_vel_rmse": 0.1}
            for forward in (0.0, 1.0)
            for yaw in (-1.0, 0.5)
        ]
        (panel,) = scenario_plots.sweep({"a": summary(0.1, 0, rows=rows)}).panels
        places = {text.splitlines()[0]: (x, y) for x, y, text in readings(panel)}
        slow_right, fast_left = places["0 m/s forward, -1 rad/s"], places["1 m/s forward, 0.5 rad/s"]
        assert slow_right[0] < fast_left[0]
        assert slow_right[1] > fast_left[1]  # a picture's y points down

    def test_no_push_scenario_no_plot(self) -> None:
        assert not scenario_plots.survival({}).panels


class TestLearning:
    def test_curves_come_from_run_folders_only(self, tmp_path: Path) -> None:
        run = tmp_path / "mine"
        run.mkdir()
        lines = [json.dumps({"step": 1000 * i, "reward/total": 0.1 * i}) for i in range(1, 4)]
        (run / "metrics.jsonl").write_text("\n".join([*lines, '{"step": 4000, "rew']))
        plot = learning_curves.learning_curves({"trot": "trot", "mine": str(run)})
        assert len(plot.panels) == 1
        assert list(plot.legend) == [1]
        assert [text for _, _, text in readings(plot.panels[0])] == [
            f"mine: {0.1 * i:.3g}\nafter {i / 1000:.3g} million steps" for i in range(1, 4)
        ]
        across = [x for x, _, _ in readings(plot.panels[0])]
        assert 0 < across[0] < across[1] < across[2] < svg.PANEL_WIDTH
        assert not learning_curves.learning_curves({"trot": "trot"}).panels

    def test_long_curves_are_means_of_stretches(self) -> None:
        rows = [{"step": float(i), "a": float(i), "b": float("nan")} for i in range(960)]
        points = learning_curves.curve(rows, "a")
        assert points[0] == pytest.approx([1.5, 1.5])
        assert points.shape == (learning_curves.POINTS, 2)
        assert len(learning_curves.curve(rows, "b")) == 0


class TestFilm:
    def test_all_films_are_as_long_and_a_fall_holds_its_last_picture(self) -> None:
        whole, fallen = (
            FilmTask("go1", None, trace, (), 12.0) for trace in (walked(), walked(5.0, fell=True))
        )
        assert frame_times(whole)[[0, 1, -1]] == pytest.approx([0.0, 0.04, 11.96])
        assert len(frame_indices(whole)) == len(frame_indices(fallen)) == 300
        assert frame_indices(whole)[[0, 1, 299]].tolist() == [0, 4, 1196]
        assert frame_indices(fallen)[[124, 125, 299]].tolist() == [496, 499, 499]

    @pytest.mark.parametrize(("fell", "written"), [(True, 5.0), (False, None)])
    def test_a_film_says_of_a_fall_that_it_was_one_and_of_an_early_end_nothing(
        self, monkeypatch: pytest.MonkeyPatch, fell: bool, written: float | None
    ) -> None:
        said: list[float | None] = []
        monkeypatch.setattr(films, "camera_shots", lambda _: nullcontext(lambda _: np.zeros((8, 8, 3))))
        monkeypatch.setattr(films.caption, "written_on", lambda *line: said.append(line[3]))
        trace = walked(5.0, fell=fell)
        assert len(list(films.frames(FilmTask("go1", None, trace, (), 6.0)))) == 150
        assert said[:125] == [None] * 125
        assert said[-1] == (written and pytest.approx(written, abs=0.02))

    def test_arrows_point_where_the_robot_is_sent_and_goes(self) -> None:
        quarter_turn_left = np.tile([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], (1200, 1))
        trace = replace(walked(), base_quaternion=quarter_turn_left)
        task = FilmTask("go1", None, trace, (Push(3.0, (0.0, 0.0, 0.5)),), 12.0)
        commanded, true = arrows(task, 200, 0.3)  # 1 m/s forward
        assert commanded.vector == pytest.approx([0.0, 0.4, 0.0])
        assert true.vector == pytest.approx([0.0, 0.4, 0.0])
        assert commanded.start == pytest.approx(trace.base_position[200] + [0.0, 0.0, 0.21])
        shown = [len(arrows(task, index, 0.3)) for index in (299, 300, 339, 345)]
        assert shown == [2, 3, 3, 2]
        push = arrows(task, 300, 0.3)[2]
        assert push.start + push.vector == pytest.approx(trace.base_position[300])
        assert push.vector == pytest.approx([0.0, 0.0, 0.2])

    @pytest.mark.parametrize(
        ("command", "words"),
        [
            ((0.6, 0.0, 0.8), "forward 0.6 m/s, turn left 0.8 rad/s"),
            ((-0.5, -0.4, -1.0), "backward 0.5 m/s, right 0.4 m/s, turn right 1.0 rad/s"),
            ((0.0, 0.4, 0.0), "left 0.4 m/s"),
            ((0.0, 0.0, 0.0), "stand"),
        ],
    )
    def test_the_command_is_written_in_words(self, command: tuple[float, ...], words: str) -> None:
        assert in_words(np.array(command)) == words

    def test_the_line_changes_the_top_of_the_picture_only(self) -> None:
        picture = np.full((400, 640, 3), 120, np.uint8)
        walking = written_on(picture, 3.2, np.array([0.5, 0.0, 0.0]), None)
        fallen = written_on(picture, 3.2, np.array([0.5, 0.0, 0.0]), 3.0)
        assert np.all(picture == 120)
        assert np.array_equal(walking[60:], picture[60:])
        assert walking[:40].max() == 255
        assert not np.array_equal(walking, fallen)


@pytest.fixture
def two(go1: Robot) -> Comparison:
    """The second is worse at all but pushes, and did not walk the course."""
    return comparison(
        go1, result("mine", "runs/mine", 0.1, 0, 1.0, walked()), result("trot", "trot", 0.3, 12, 2.0, None)
    )


class TestOrder:
    def test_each_plot_gets_the_scenarios_that_it_is_about(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given: dict[str, Any] = {}

        def note(module: Any, name: str) -> None:
            monkeypatch.setattr(
                module, name, lambda *arguments: given.setdefault(name, arguments) and svg.Plot(name, "", [])
            )

        for name in ("survival", "conditions", "sweep"):
            note(scenario_plots, name)
        for name in ("tracking", "gait", "torque_speed", "timing"):
            note(course_plots, name)
        note(page_module, "learning_curves")
        names = ("friction", "sweep", "push", "nominal", "payload")
        policies = []
        for number, (name, trace) in enumerate((("a", None), ("b", walked(2.0)), ("c", walked(1.0)))):
            plain = result(name, f"runs/{name}", 0.1, 0, 2.0, trace)
            scenarios = {each: summary(0.1, number, about=each) for each in names}
            policies.append(replace(plain, period_ms=5.0 + number, result={"scenarios": scenarios}))
        of = replace(comparison(go1, *policies), config=EvaluationConfig("go1", names))
        assert [plot.title for plot in page_module.plots(of)] == [
            "survival", "tracking", "gait", "conditions", "sweep", "torque_speed", "timing",
            "learning_curves",
        ]  # fmt: skip
        (pushes,), (levels,), (commands,) = (given[name] for name in ("survival", "conditions", "sweep"))
        assert [(each["about"], each["falls"]) for each in pushes.values()] == [("push", k) for k in range(3)]
        assert [each["about"] for each in commands.values()] == ["sweep"] * 3
        assert [(level, summaries["b"]["about"]) for level, summaries in levels] == [
            ("friction", "friction"), ("payload_kg", "payload"),
        ]  # fmt: skip
        walks, plan = given["tracking"]
        assert [(walk.place, walk.policy, walk.period_ms) for walk in walks] == [(1, "b", 6.0), (2, "c", 7.0)]
        assert [walk.trace for walk in walks] == [policy.course.trace for policy in policies[1:]]
        assert plan == COURSE
        assert given["gait"] == (walks, plan, go1)
        assert given["torque_speed"] == (walks, go1)
        assert given["timing"] == (walks,)
        assert given["learning_curves"] == ({"a": "runs/a", "b": "runs/b", "c": "runs/c"},)

    def test_without_pushes_and_a_sweep_there_is_nothing_of_them(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given = {}
        for name in ("survival", "sweep"):
            monkeypatch.setattr(
                scenario_plots,
                name,
                lambda each, name=name: given.setdefault(name, each) or svg.Plot(name, "", []),
            )
        only = replace(
            comparison(go1, result("a", "a", 0.1, 0, 2.0, None)), config=EvaluationConfig("go1", ("nominal",))
        )
        page_module.plots(only)
        assert given == {"survival": {}, "sweep": {}}
        assert only.push_scenario is None

    @pytest.fixture
    def read(self, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
        """The words of a page with plots that are quick to make."""
        panel = Markup("<b>panel</b>")
        plots = [svg.Plot(f"Plot {k}", f"caption {k}", [panel] * (2 - k), [1]) for k in (0, 1, 2)]
        monkeypatch.setattr(page_module, "plots", lambda _: plots)

        def words(of: Comparison, **seen: Film) -> str:
            shown = {policy.name: TaskResult(seen.get(policy.name), "no light") for policy in of.policies}
            return " ".join(Page(page_module.render(of, shown)).words.split())

        return words

    def test_the_page_tells_all_in_order(self, two: Comparison, read: Callable[..., str]) -> None:
        words, place = read(two, mine=Film(b"f", b"p")), 0
        for part in (
            "mine · trot on go1", "mine falls least often", "seed 3, scenarios nominal, push",
            "Figures Films",
            "Plot 0 Plot 1 All figures", "trot did not walk the course", "Headline figures",
            "Falls in each scenario", "Films", "mine reached the end", "No film of trot: its process died.",
            "Plot 0 trot panel panel caption 0", "Plot 1 trot panel caption 1", "All figures by scenario",
            "nominal", "Figures of nominal", "Figures of push", "What ended episodes early",
            "How it was measured", "estimate it from the same readings", "mine : made by hand",
            "--seed 3 --episodes 24 --html report.html", "footfall 1.2.3, mujoco 3.1", "Definitions",
            "Episodes that ended in a fall", "Scenarios", "nominal about:", "push about:", "course about:",
        ):  # fmt: skip
            place = words.index(part, place) + len(part)
        assert "Plot 2" not in words  # it has no panels

    def test_what_was_unusual_is_said(self, two: Comparison, read: Callable[..., str]) -> None:
        usual = read(two)
        assert "plant" not in usual[: usual.index("Headline figures")]
        words = read(replace(two, config=replace(two.config, ground_truth=True, plant=Path("a/heavy.xml"))))
        assert "were handed the true one (--ground-truth)" in words
        assert "plant heavy.xml" in words

    def test_a_films_caption_says_how_the_walk_ended(self, go1: Robot, read: Callable[..., str]) -> None:
        fell = result("mine", "mine", 0.1, 0, 2.0, walked(5.0, fell=True))
        other = result("trot", "trot", 0.3, 9, 1.0, walked())
        words = read(comparison(go1, fell, other), mine=Film(b"f", b"p"), trot=Film(b"f", b"p"))
        assert "mine fell after 5.0 s trot reached the end" in words
        assert page_module._shown(fell, TaskResult(None, "no light")) == page_module.ShownFilm(
            "mine", None, "no light"
        )
