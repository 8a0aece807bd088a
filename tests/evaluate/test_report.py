"""The report: short comparisons end to end; its page, tables, names and films for figures made by hand."""

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from browser import Tab, chromium, tab
from markupsafe import Markup
from report_pages import FILE, Page, comparison, page_of, result, walked
from rich.console import Console
from scipy.spatial.transform import Rotation

from footfall import Episode, EvaluationConfig, Push, Robot, Trace, load_policy, run_episode
from footfall.evaluate import api
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import course_plots, films, scene, svg, tables
from footfall.evaluate.report import page as page_module
from footfall.evaluate.report.caption import command_text
from footfall.evaluate.report.films import FilmTask, arrows, frame_indices, frame_times, render_films
from footfall.evaluate.report.short_names import MAX_CHARS, short_names
from footfall.evaluate.report.tables import Cell, Heading
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint
from footfall.evaluate.suite import run_suite

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
    def test_the_page_is_self_contained_and_opens_with_the_verdict(self, page: str) -> None:
        parsed = Page(page)
        sentence = "mine falls least often (0 of 24, against 9 of 24 of trot)"
        assert parsed.words.index(sentence) < parsed.words.index("Headline figures")
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


def test_tables_have_the_figures_and_endings_of_each_policy(go1: Robot) -> None:
    """The second policy is worse except for pushes, and did not walk the course."""
    mine = result("mine", "runs/mine", 0.1, 0, 1.0, walked())
    two = comparison(go1, mine, result("trot", "trot", 0.3, 12, 2.0, None))
    table = tables.headline_table(two)
    assert table.corner == "Policy"
    assert table.columns == [
        Heading("Falls", "nominal"), Heading("Velocity error", "m/s, nominal"),
        Heading("Median survivable push", "m/s, push"), Heading("Time per step", "ms p50 / p99, alone"),
    ]  # fmt: skip
    per_step = Cell("0.21 / 0.40", "of 20 ms")
    best = [Cell("0 of 24", "0 to 14 %", is_best=True), Cell("0.100", "0.090 to 0.110", is_best=True)]
    worse = [Cell("12 of 24", "31 to 69 %"), Cell("0.300", "0.270 to 0.330")]
    push = Cell("2.00", "1.90 to 2.10", is_best=True)
    assert table.rows == [
        (Heading("mine", "made by hand", 0), [*best, Cell("1.00", "0.90 to 1.10"), per_step]),
        (Heading("trot", "made by hand", 1), [*worse, push, per_step]),
    ]
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


def test_a_long_name_loses_its_middle_and_stays_different() -> None:
    long = "runs/2026-11-23_go1_without-height-scan_seed-17_policy-final"
    names, short = ["mpc", "x" * MAX_CHARS], f"{long[:12]}…{long[-19:]}"
    assert len(short) == MAX_CHARS
    assert short_names([*names, long]) == {name: name for name in names} | {long: short}
    others = [long.replace("height", kind) for kind in ("camera", "memory")]
    found = short_names([long, *others])
    assert len(set(found.values())) == 3
    assert [each[-4:] for each in found.values()] == ["inal", " (2)", " (3)"]
    assert max(map(len, found.values())) == MAX_CHARS
    both = short_names([long, short])
    assert both[short] == short != both[long]


LIGHT = "getComputedStyle({}).backgroundColor.match(/\\d+/g).slice(0, 3).reduce((a, b) => a + +b, 0) / 765"


@pytest.fixture(scope="module")
def report(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """A report of two policies, one of them with a long name, in a browser."""
    if chromium() is None:
        pytest.skip("needs Chromium")
    folder = tmp_path_factory.mktemp("report")
    file = folder / "report.html"
    long = "/home/someone/runs/2026-11-23_go1_no-height-scan_and-more-than-90-letters_seed-7/policy.onnx"
    good = result("mine", "runs/mine", 0.1, 0, 2.0, walked())
    bad = result(long, long, 0.3, 9, 1.0, walked(5.0, fell=True))
    file.write_text(page_of(go1, good, bad), encoding="utf-8")
    with tab(folder / "profile") as opened:
        opened.go(file.as_uri())
        opened.wait_for(lambda page: page.value("document.readyState") == "complete")
        yield opened


def resize(page: Tab, width: int, media: str = "screen", colours: str = "light") -> None:
    """Show the page on a screen or paper of this width, px."""
    page.ask("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
    scheme = {"name": "prefers-color-scheme", "value": colours}
    page.ask("Emulation.setEmulatedMedia", media=media, features=[scheme])


def test_the_page_is_dark_on_request_and_not_too_wide(report: Tab) -> None:
    """Paper is never dark."""
    on_screens = [(width, "screen", colours) for width in (420, 1400) for colours in ("light", "dark")]
    for width, media, colours in (*on_screens, (760, "print", "dark")):
        resize(report, width, media, colours)
        assert report.value("[innerWidth, document.documentElement.scrollWidth]") == [width, width]
        dark = media == "screen" and colours == "dark"
        for element in ("document.body", "document.querySelector('header')"):
            luminance = report.value(LIGHT.format(element))
            assert luminance < 0.2 if dark else luminance > 0.9


def test_the_page_is_short_and_a_link_to_a_folded_part_opens_it(report: Tab) -> None:
    for width, screens in ((1280, 6), (420, 9)):
        resize(report, width)
        assert report.value("document.documentElement.scrollHeight") < 900 * screens
    identity = report.value("document.querySelector('details.plot:not([open])').id")
    report.value(f"document.querySelector('nav a[href=\"#{identity}\"]').click()")
    assert report.value(f"document.getElementById('{identity}').open")
    report.value(f"document.getElementById('{identity}').open = false")


def test_all_that_can_be_unfolded_is_open_on_paper_and_closed_again_after_it(report: Tab) -> None:
    resize(report, 1400)
    folded = "[...document.querySelectorAll('details')].filter(each => !each.open).length"
    before = report.value(folded)
    assert before > 0
    report.value(f"addEventListener('beforeprint', () => {{ window.foldedInPrint = {folded} }})")
    report.ask("Page.printToPDF")
    assert report.value("window.foldedInPrint") == 0
    assert report.value(folded) == before
    assert report.errors == []


def task(trace: Trace, seconds: float = 1.0, pushes: tuple[Push, ...] = ()) -> FilmTask:
    return FilmTask("go1", None, trace, pushes, seconds)


def test_a_film_shows_the_robot_and_plays_in_a_browser(go1: Robot, tmp_path: Path) -> None:
    standing = Episode(lambda _: np.zeros(3), 0.4)
    (outcome,) = render_films([task(run_episode(go1, load_policy("stand", go1), standing), 0.6)])
    if outcome.value is None:
        pytest.skip(f"this machine cannot render: {outcome.error}")
    (tmp_path / "film.mp4").write_bytes(outcome.value.mp4)
    reader = imageio_ffmpeg.read_frames(str(tmp_path / "film.mp4"))
    facts = next(reader)
    assert (facts["codec"], facts["source_size"]) == ("h264", (films.WIDTH, films.HEIGHT))
    assert facts["pix_fmt"].startswith("yuv420p")
    frame = np.frombuffer(next(reader), np.uint8).reshape(films.HEIGHT, films.WIDTH, 3).astype(int)
    reader.close()
    red, green, blue = np.moveaxis(frame, -1, 0)
    orange = (red > 140) & (green < 0.75 * red) & (blue < 0.5 * red)  # the robot's hip motors
    rows, columns = np.nonzero(orange)
    assert len(rows) > 200
    assert abs(columns.mean() - films.WIDTH / 2) < films.WIDTH / 6
    assert blue[:20].mean() > red[:20].mean() + 20  # the sky


def test_without_rendering_the_reason_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "crayons")
    (outcome,) = render_films([task(walked(1.0))])
    assert outcome.value is None
    assert "crayons" in outcome.error


def test_another_renderer_is_tried_if_one_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[Any] = []
    works = {"osmesa"}

    def run_all(function: Any, tasks: Any, workers: Any, environment: dict[str, str]) -> list[TaskResult]:
        assert function is films.film
        tried.append((workers, environment))
        name = environment.get("MUJOCO_GL", "")
        return [TaskResult("film") if name in works else TaskResult(None, f"no {name}") for _ in tasks]

    monkeypatch.setattr(films, "run_all", run_all)
    monkeypatch.setattr(films, "BACK_ENDS", ("egl", "osmesa"))
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    one = task(walked(1.0))
    assert render_films([one], 3) == [TaskResult("film")]
    assert tried == [(3, {"MUJOCO_GL": name, "PYOPENGL_PLATFORM": name}) for name in ("egl", "osmesa")]
    works.clear()
    assert render_films([one, one]) == [TaskResult(None, "egl: no egl; osmesa: no osmesa")] * 2
    works.add("glfw")
    monkeypatch.setenv("MUJOCO_GL", "glfw")
    tried.clear()
    assert render_films([one]) == [TaskResult("film")]
    assert [environment["MUJOCO_GL"] for _, environment in tried] == ["glfw"]


def test_arrows_of_command_and_motion_differ_and_are_level() -> None:
    trace = walked(5.0)
    tilted = Rotation.from_quat([0.1, -0.2, 0.35, 0.9])  # about all axes
    count = len(trace.time_s)
    trace = replace(
        trace,
        base_quaternion=np.tile(tilted.as_quat()[[3, 0, 1, 2]], (count, 1)),
        base_position=np.array([0.0, 0.0, 0.3]) + np.outer(np.arange(count), [0.01, 0.02, 0.0]),
        command=np.tile([0.6, -0.3, 0.9], (count, 1)),
        base_velocity=np.tile([0.2, 0.5, 0.7], (count, 1)),
    )
    pushed = task(trace, pushes=(Push(1.0, (0.5, -1.0, 0.2)), Push(9.0, (1.0, 0.0, 0.0))))
    level = Rotation.from_euler("Z", tilted.as_euler("ZYX")[0])
    commanded, true, push = arrows(pushed, 120, 0.4)
    np.testing.assert_allclose(commanded.vector, level.apply([0.24, -0.12, 0.0]), atol=1e-9)
    np.testing.assert_allclose(true.vector, level.apply([0.08, 0.2, 0.0]), atol=1e-9)
    np.testing.assert_allclose(commanded.start, [1.2, 2.4, 0.58])
    np.testing.assert_allclose(true.start, [1.2, 2.4, 0.63])
    np.testing.assert_allclose(push.vector, [0.2, -0.4, 0.08])
    np.testing.assert_allclose(push.start + push.vector, [1.2, 2.4, 0.3])
    assert [len(arrows(pushed, index, 0.4)) for index in (99, 100, 140, 141)] == [2, 3, 3, 2]


def test_films_are_equally_long_and_a_film_of_a_fall_ends_with_its_last_frame() -> None:
    whole, fallen = task(walked(), 12.0), task(walked(5.0, fell=True), 12.0)
    assert frame_times(whole)[[0, 1, -1]] == pytest.approx([0.0, 0.04, 11.96])
    assert len(frame_indices(whole)) == len(frame_indices(fallen)) == 300
    assert frame_indices(whole)[[0, 1, 299]].tolist() == [0, 4, 1196]
    assert frame_indices(fallen)[[124, 125, 299]].tolist() == [496, 499, 499]


def test_a_plant_without_a_floor_is_given_one(go1: Robot, tmp_path: Path) -> None:
    body = '<body name="trunk" pos="0 0 1"><freejoint/><geom size=".1"/></body>'
    (tmp_path / "bare.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    model = scene.scene_model(go1, tmp_path / "bare.xml", 64, 64)
    assert model.geom_type[model.geom(scene.FLOOR).id] == mujoco.mjtGeom.mjGEOM_PLANE
    assert model.nq == 7


def test_a_command_in_words() -> None:
    for command, words in (
        ([0.6, 0.0, 0.8], "forward 0.6 m/s, turn left 0.8 rad/s"), ([0.04, -0.04, 0.049], "stand"),
        ([-0.31, 0.5, 0.0], "backward 0.3 m/s, left 0.5 m/s"),
        ([0.0, -0.5, -0.06], "right 0.5 m/s, turn right 0.1 rad/s"),
    ):  # fmt: skip
        assert command_text(np.array(command)) == words
