"""The parts of a report, each against what it is made from: tables, order of the page, films, scenery."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from markupsafe import Markup
from PIL import Image
from report_pages import COURSE, FILE, Page, comparison, result, summary, walked

from footfall.common import colours
from footfall.evaluate.comparison import Comparison
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import course_plots, films, page, scenario_plots, scene, svg, tables
from footfall.evaluate.report.caption import MARGIN, SHADE, in_words, written_on
from footfall.evaluate.report.films import Film, FilmTask, arrows
from footfall.evaluate.report.tables import Cell, Heading
from footfall.plant.episode import Push
from footfall.plant.trace import Trace
from footfall.robots.description import Robot

TILTED = (0.9, 0.1, -0.2, 0.35)  # about all axes


@pytest.fixture
def two(go1: Robot) -> Comparison:
    """The second is worse at all but pushes, and did not walk the course."""
    return comparison(
        go1, result("mine", "runs/mine", 0.1, 0, 1.0, walked()), result("trot", "trot", 0.3, 12, 2.0, None)
    )


class TestTables:
    def test_the_headline_has_a_figure_of_each_policy_in_its_row(self, two: Comparison) -> None:
        table = tables.headline_table(two)
        assert table.corner == "Policy"
        assert table.columns == [
            Heading("Falls", "nominal"),
            Heading("Velocity error", "m/s, nominal"),
            Heading("Median survivable push", "m/s, push"),
            Heading("Time per step", "ms p50 / p99, alone"),
        ]
        (mine, cells), (trot, others) = table.rows
        assert (mine, trot) == (Heading("mine", "made by hand", 0), Heading("trot", "made by hand", 1))
        assert cells == [
            Cell("0 of 24", "0 to 14 %", best=True),
            Cell("0.100", "0.090 to 0.110", best=True),
            Cell("1.00", "0.90 to 1.10"),
            Cell("0.21 / 0.40", "of 20 ms"),
        ]
        assert others == [
            Cell("12 of 24", "31 to 69 %"),
            Cell("0.300", "0.270 to 0.330"),
            Cell("2.00", "1.90 to 2.10", best=True),
            Cell("0.21 / 0.40", "of 20 ms"),
        ]

    def test_who_took_no_step_has_no_time_per_step(self, go1: Robot) -> None:
        none = result("a", "a", 0.1, 0, 1.0, None)
        none.course.compute["compute_ms"] = {"p50": None, "p99": None}
        (_, cells), *_ = tables.headline_table(comparison(go1, none)).rows
        assert cells[-1] == Cell("–")

    def test_falls_stand_by_scenario(self, two: Comparison) -> None:
        table = tables.falls_table(two)
        assert table.columns == [Heading("nominal"), Heading("push")]
        shown = [(row.label, row.place, [cell.text for cell in cells]) for row, cells in table.rows]
        assert shown == [
            ("mine", 0, ["0 of 24", "11 of 24"]), ("trot", 1, ["12 of 24", "11 of 24"]),
        ]  # fmt: skip

    def test_each_scenario_has_its_own_figures_and_endings(self, two: Comparison) -> None:
        nominal, push = tables.scenario_parts(two)
        assert (nominal.name, push.name) == ("nominal", "push")
        assert (nominal.about, push.about) == (FILE.scenarios["nominal"].about, FILE.scenarios["push"].about)
        assert nominal.table.columns == [Heading("mine", place=0), Heading("trot", place=1)]
        assert [heading for heading, _ in nominal.table.rows] == [
            Heading("Falls"),
            Heading("Velocity error", "m/s"),
        ]
        assert Heading("Median survivable push", "m/s") in [heading for heading, _ in push.table.rows]
        assert [cell.text for cell in nominal.table.rows[1][1]] == ["0.100", "0.300"]
        assert nominal.endings == ["trot: the base touched the ground (12)"]
        assert push.endings == [f"{name}: the base touched the ground (11)" for name in ("mine", "trot")]

    def test_warnings_are_of_episodes_and_of_the_course(self, two: Comparison) -> None:
        mine, trot = two.policies
        nominal = trot.result["scenarios"]["nominal"] | {
            "failed_episodes": ["episode 4: no"],
            "notes": ["no floor"],
        }
        trot = replace(trot, result={"scenarios": trot.result["scenarios"] | {"nominal": nominal}})
        assert tables.all_warnings(replace(two, policies=[mine, trot])) == [
            "trot, nominal: 1 of 25 episodes failed: no (1)",
            "no floor",
            "trot did not walk the course: its process died",
        ]


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
        note(page, "learning_curves")
        names = ("friction", "sweep", "push", "nominal", "payload")
        policies = []
        for number, (name, trace) in enumerate((("a", None), ("b", walked(2.0)), ("c", walked(1.0)))):
            plain = result(name, f"runs/{name}", 0.1, 0, 2.0, trace)
            scenarios = {each: summary(0.1, number, about=each) for each in names}
            policies.append(replace(plain, period_ms=5.0 + number, result={"scenarios": scenarios}))
        of = replace(comparison(go1, *policies), config=EvaluationConfig("go1", names))
        assert [plot.title for plot in page.plots(of)] == [
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
        page.plots(only)
        assert given == {"survival": {}, "sweep": {}}
        assert only.push_scenario is None

    @pytest.fixture
    def read(self, monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
        """The words of a page with plots that are quick to make."""
        panel = Markup("<b>panel</b>")
        plots = [svg.Plot(f"Plot {k}", f"caption {k}", [panel] * (2 - k), [1]) for k in (0, 1, 2)]
        monkeypatch.setattr(page, "plots", lambda _: plots)

        def words(of: Comparison, **seen: Film) -> str:
            shown = {policy.name: TaskResult(seen.get(policy.name), "no light") for policy in of.policies}
            return " ".join(Page(page.render(of, shown)).words.split())

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
        assert page._shown(fell, TaskResult(None, "no light")) == page.ShownFilm("mine", None, "no light")

    @pytest.mark.parametrize(
        ("place", "dashes"), [(0, ""), (1, "8 3.2"), (3, "11.2 3.2 3.2 3.2"), (7, "8 3.2")]
    )
    def test_a_swatch_is_the_line_and_the_mark_of_a_policy(self, place: int, dashes: str) -> None:
        drawn = page.swatch(place)
        assert f'stroke="{svg.colour(place)}" fill="{svg.colour(place)}"' in drawn
        assert f'stroke-dasharray="{dashes}"' in drawn
        assert f'd="{svg.MARKER_PATHS[svg.MARKERS[place % 6]]}"' in drawn


class TestFilms:
    def task(self, trace: Trace, pushes: tuple[Push, ...] = (), duration_s: float = 1.0) -> FilmTask:
        return FilmTask("go1", None, trace, pushes, duration_s)

    def test_each_policy_that_walked_is_filmed_with_the_courses_pushes(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[Any] = []

        def render(tasks: list[FilmTask], workers: int | None) -> list[TaskResult]:
            asked.append((tasks, workers))
            return [TaskResult(len(task.trace.time_s)) for task in tasks]

        monkeypatch.setattr(films, "render_films", render)
        lengths = {"a": 2.0, "b": None, "c": 1.0, "d": 3.0}
        policies = [
            result(name, name, 0.1, 0, 1.0, None if length is None else walked(length))
            for name, length in lengths.items()
        ]
        nothing = replace(walked(1.0), time_s=np.zeros(0))
        policies[2] = replace(policies[2], course=replace(policies[2].course, trace=nothing))
        config = EvaluationConfig("go1", ("nominal",), plant=Path("other.xml"), workers=3)
        found = films.films_of(replace(comparison(go1, *policies), config=config))
        assert list(found) == ["a", "b", "c", "d"]
        assert {name: outcome.value for name, outcome in found.items()} == {
            "a": 200,
            "b": None,
            "c": None,
            "d": 300,
        }
        assert found["b"].error == found["c"].error == "it did not walk"
        ((tasks, workers),) = asked
        assert workers == 3
        for task in tasks:
            assert (task.robot, task.plant, task.pushes) == ("go1", Path("other.xml"), COURSE.pushes)
            assert task.duration_s == COURSE.duration_s

    def test_the_next_way_to_render_is_tried_where_one_fails(self, monkeypatch: pytest.MonkeyPatch) -> None:
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
        task = self.task(walked(1.0))
        assert films.render_films([task], 3) == [TaskResult("film")]
        assert tried == [(3, {"MUJOCO_GL": name, "PYOPENGL_PLATFORM": name}) for name in ("egl", "osmesa")]
        works.clear()
        assert films.render_films([task, task]) == [TaskResult(None, "egl: no egl; osmesa: no osmesa")] * 2
        works.add("glfw")
        monkeypatch.setenv("MUJOCO_GL", "glfw")
        tried.clear()
        assert films.render_films([task]) == [TaskResult("film")]
        assert [environment["MUJOCO_GL"] for _, environment in tried] == ["glfw"]

    def test_a_film_has_its_frames_in_order_and_a_poster_of_its_first_third(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        def frames(task: FilmTask) -> Iterator[np.ndarray]:
            for number in range(len(films.frame_times(task))):
                yield np.full((films.HEIGHT, films.WIDTH, 3), 10 + 10 * number, np.uint8)

        monkeypatch.setattr(films, "frames", frames)
        film = films.film(self.task(walked(1.0), duration_s=0.48))
        assert np.asarray(Image.open(io.BytesIO(film.poster_jpeg))).mean() == pytest.approx(50.0, abs=2.0)
        path = tmp_path / "film.mp4"
        path.write_bytes(film.mp4)
        reader = imageio_ffmpeg.read_frames(str(path))
        assert next(reader)["fps"] == films.FRAME_RATE_HZ == 25
        shown = [np.frombuffer(frame, np.uint8).mean() for frame in reader]
        assert shown == pytest.approx([10.0 + 10.0 * k for k in range(12)], abs=3.0)

    def test_a_frame_is_the_sample_of_its_time_with_its_command(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        written: list[Any] = []
        shots: list[int] = []

        @contextmanager
        def camera(_: FilmTask) -> Iterator[Any]:
            yield lambda index: shots.append(index) or np.full((2, 2, 3), index % 251, np.uint8)

        monkeypatch.setattr(films, "_camera_shots", camera)
        monkeypatch.setattr(films.caption, "written_on", lambda *line: written.append(line))
        trace = walked(5.0, fell=True)
        list(films.frames(self.task(trace, duration_s=6.0)))
        for number in (0, 60, 124):
            picture, time_s, command, fell_at_s = written[number]
            assert (picture[0, 0, 0], time_s, fell_at_s) == (
                4 * number % 251,
                pytest.approx(0.04 * number),
                None,
            )
            np.testing.assert_array_equal(command, trace.command[4 * number])
        assert written[140][3] == pytest.approx(4.99)  # the fall
        np.testing.assert_array_equal(written[140][2], trace.command[-1])
        assert len(shots) == len(set(shots)) == 126  # the last picture is rendered once

    def test_arrows_differ_for_what_is_asked_and_done_and_are_level(self) -> None:
        trace = walked(5.0)
        attitude = np.array(TILTED) / np.linalg.norm(TILTED)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, attitude)
        yaw = np.arctan2(rotation[3], rotation[0])
        count = len(trace.time_s)
        trace = replace(
            trace,
            base_quaternion=np.tile(attitude, (count, 1)),
            base_position=np.array([0.0, 0.0, 0.3]) + np.outer(np.arange(count), [0.01, 0.02, 0.0]),
            command=np.tile([0.6, -0.3, 0.9], (count, 1)),
            base_velocity=np.tile([0.2, 0.5, 0.7], (count, 1)),
        )
        task = self.task(trace, (Push(1.0, (0.5, -1.0, 0.2)), Push(9.0, (1.0, 0.0, 0.0))))
        level = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        commanded, true, push = arrows(task, 120, 0.4)
        np.testing.assert_allclose(commanded.vector, level @ [0.24, -0.12, 0.0], atol=1e-9)
        np.testing.assert_allclose(true.vector, level @ [0.08, 0.2, 0.0], atol=1e-9)
        np.testing.assert_allclose(commanded.start, [1.2, 2.4, 0.58])
        np.testing.assert_allclose(true.start, [1.2, 2.4, 0.63])
        np.testing.assert_allclose(push.vector, [0.2, -0.4, 0.08])
        np.testing.assert_allclose(push.start + push.vector, [1.2, 2.4, 0.3])
        assert [each.colour is colour for each, colour in zip(
            (commanded, true, push), (colours.COMMAND, colours.VELOCITY, colours.PUSH), strict=True
        )] == [True] * 3  # fmt: skip
        assert [len(arrows(task, index, 0.4)) for index in (99, 100, 140, 141)] == [2, 3, 3, 2]

    def test_the_camera_sees_the_sample_and_trails_behind_the_robot(
        self, go1: Robot, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        seen: list[Any] = []
        drawn: list[Any] = []

        class Renderer:
            def __init__(self, model: mujoco.MjModel, height: int, width: int) -> None:
                assert (height, width) == (films.HEIGHT, films.WIDTH)
                self.scene = "scene"

            def __enter__(self) -> "Renderer":
                return self

            def __exit__(self, *_: object) -> None: ...

            def update_scene(self, data: Any, camera: Any, options: Any) -> None:
                groups, place = options.geomgroup.copy(), data.xpos[1].copy()
                seen.append((data.qpos.copy(), place, camera.lookat.copy(), groups, camera.distance))

            def render(self) -> np.ndarray:
                return np.zeros((1, 1, 3), np.uint8)

        monkeypatch.setattr(films.mujoco, "Renderer", Renderer)
        monkeypatch.setattr(films.scene, "add_arrow", lambda *arrow: drawn.append(arrow))
        trace = walked(1.0)
        place = np.array([1.0, 2.0, 0.3]) + np.outer(np.arange(100), [0.01, -0.02, 0.0])
        qpos = np.zeros((100, 19))
        qpos[:, :3], qpos[:, 3] = place, 1.0
        qpos[:, 7:] = np.linspace(-0.3, 0.3, 12) * np.linspace(0, 1, 100)[:, None]
        trace = replace(trace, qpos=qpos, base_position=place)
        with films._camera_shots(self.task(trace)) as shoot:
            shoot(0), shoot(50)
        first, second = seen
        np.testing.assert_array_equal(second[0], qpos[50])
        np.testing.assert_allclose(second[1], place[50])
        np.testing.assert_allclose(first[2], [1.0, 2.0, 0.24])
        np.testing.assert_allclose(second[2], [1.0 + 0.15 * 0.5, 2.0 - 0.15 * 1.0, 0.24])
        assert second[3].tolist() == [1, 1, 1, 0, 0, 0]
        model = scene.scene_model(go1, None, 64, 64)
        assert second[4] == pytest.approx(2.2 * scene.size_of(model, qpos[0]))
        assert len(drawn) == 4  # two a picture
        expected = arrows(self.task(trace), 50, go1.description.standing_height_m)
        for (where, *arrow), wanted in zip(drawn[2:], expected, strict=True):
            assert where == "scene"
            for part, other in zip(arrow, wanted, strict=True):
                np.testing.assert_array_equal(part, other)


class TestScene:
    def test_the_scene_holds_the_plants_body_and_nothing_that_acts(self, go1: Robot) -> None:
        model = scene.scene_model(go1, None, 320, 200)
        assert (model.nq, model.nu, model.nsensor, model.nkey) == (19, 0, 0, 0)
        assert (model.vis.global_.offwidth, model.vis.global_.offheight) == (320, 200)
        (ground,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
        assert model.geom_size[ground].tolist() == [0.0, 0.0, 0.05]
        assert model.geom_matid[ground] == model.material(scene.FLOOR_MATERIAL).id
        sun, lamp = range(model.nlight)[-2:]
        assert model.light_castshadow[[sun, lamp]].tolist() == [0, 1]
        assert model.light_bodyid[lamp] == model.body(go1.description.base).id
        assert model.light_mode[lamp] == mujoco.mjtCamLight.mjCAMLIGHT_TRACK
        direction = np.array([-0.25, 0.3, -1.0])
        unit = direction / np.linalg.norm(direction)
        np.testing.assert_allclose(model.light_dir[[sun, lamp]], [unit, unit], atol=1e-6)
        height = 2.0 * go1.description.standing_height_m
        np.testing.assert_allclose(model.light_pos[lamp], -6.0 * height * direction, rtol=1e-6)

    def test_a_plant_without_a_floor_is_given_one(self, go1: Robot, tmp_path: Path) -> None:
        plant = tmp_path / "bare.xml"
        plant.write_text(
            '<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/><geom size=".1"/></body>'
            "</worldbody></mujoco>"
        )
        model = scene.scene_model(go1, plant, 64, 64)
        assert model.geom_type[model.geom(scene.FLOOR).id] == mujoco.mjtGeom.mjGEOM_PLANE
        assert model.nq == 7

    @pytest.mark.parametrize(("turned", "size_m"), [([1.0, 0, 0, 0], 0.8), ([0.5**0.5, 0, 0.5**0.5, 0], 0.7)])
    def test_a_robot_is_as_large_as_the_longest_side_of_its_box(
        self, turned: list[float], size_m: float
    ) -> None:
        """A box 0.6 m long and 0.2 m high, with a foot reaching 0.2 m beyond its end, or hanging below."""
        model = mujoco.MjModel.from_xml_string(
            '<mujoco><worldbody><geom type="plane" size="9 9 .1"/><body><freejoint/>'
            '<geom type="box" size=".3 .1 .1"/><geom type="sphere" size="5" group="3"/>'
            '<body pos=".3 0 0"><joint axis="0 1 0"/><geom type="sphere" size=".1" pos=".1 0 0"/></body>'
            "</body></worldbody></mujoco>"
        )
        knee = 0.0 if turned[0] == 1.0 else np.pi / 2
        assert scene.size_of(model, np.array([5.0, 5.0, 1.0, *turned, knee])) == pytest.approx(size_m)

    def test_the_camera_looks_from_the_front_and_the_side_at_the_lower_body(self) -> None:
        camera = mujoco.MjvCamera()
        scene.follow(camera, np.array([3.0, -2.0, 0.5]), 0.6)
        np.testing.assert_allclose(camera.lookat, [3.0, -2.0, 0.4])
        assert (camera.distance, camera.azimuth, camera.elevation) == pytest.approx((1.32, 130.0, -16.0))
        assert camera.type == mujoco.mjtCamera.mjCAMERA_FREE

    def test_an_arrow_begins_at_its_start_and_points_along_its_vector(self, go1: Robot) -> None:
        model = scene.scene_model(go1, None, 64, 64)
        drawing = mujoco.MjvScene(model, maxgeom=3)
        start, vector = np.array([1.0, 2.0, 0.5]), np.array([0.0, 0.3, -0.4])
        scene.add_arrow(drawing, start, vector, colours.PUSH)
        assert drawing.ngeom == 1
        geom = drawing.geoms[0]
        np.testing.assert_allclose(geom.pos, start)
        np.testing.assert_allclose(geom.mat[:, 2], vector / 0.5, atol=1e-6)
        np.testing.assert_allclose(geom.rgba, colours.PUSH, atol=1e-6)
        assert geom.type == mujoco.mjtGeom.mjGEOM_ARROW
        assert geom.size[2] == pytest.approx(0.5)
        scene.add_arrow(drawing, start, 0.05 * vector, colours.PUSH)  # 2.5 cm
        assert drawing.ngeom == 1
        for _ in range(3):
            scene.add_arrow(drawing, start, 0.07 * vector, colours.COMMAND)
        assert drawing.ngeom == 3  # as many as there is room for
        np.testing.assert_allclose(drawing.geoms[1].rgba, colours.COMMAND, atol=1e-6)


class TestCaption:
    def bright(self, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns with writing, and the colour of the brightest point at the right."""
        band = picture[:40].astype(int)
        columns = np.flatnonzero((band.max(axis=2) > 200).any(axis=0))
        right = band[:, 320:]
        return columns, right.reshape(-1, 3)[right.sum(axis=2).argmax()]

    def test_the_time_stands_at_the_left_and_the_command_ends_at_the_right(self) -> None:
        picture = np.full((400, 640, 3), 100, np.uint8)
        columns, ink = self.bright(written_on(picture, 3.2, np.array([0.5, 0.0, 0.0]), None))
        assert MARGIN <= columns[0] < MARGIN + 6
        assert 640 - MARGIN - 6 < columns[-1] <= 640 - MARGIN
        assert ((columns > 100) & (columns < 400)).sum() == 0
        assert ink.tolist() == [255, 255, 255]
        columns, ink = self.bright(written_on(picture, 3.2, np.zeros(3), 3.0))
        assert ink[0] > ink[1] + 50

    @pytest.mark.parametrize(
        ("command", "words"),
        [
            ((0.6, 0.0, 0.8), "forward 0.6 m/s, turn left 0.8 rad/s"),
            ((-0.31, 0.5, 0.0), "backward 0.3 m/s, left 0.5 m/s"),
            ((0.0, -0.5, -0.06), "right 0.5 m/s, turn right 0.1 rad/s"),
            ((0.04, -0.04, 0.049), "stand"),
        ],
    )
    def test_a_command_in_words(self, command: tuple[float, float, float], words: str) -> None:
        assert in_words(np.array(command)) == words

    def test_the_picture_itself_is_left_as_it_was(self) -> None:
        picture = np.full((60, 640, 3), 100, np.uint8)
        written_on(picture, 0.0, np.zeros(3), None)
        assert (picture == 100).all()

    def test_the_band_behind_it_is_shaded(self) -> None:
        shaded = written_on(np.full((400, 640, 3), 100, np.uint8), 0.0, np.zeros(3), None)
        assert shaded[:37, 300].tolist() == [[100 * SHADE] * 3] * 37
        assert shaded[37, 300].tolist() == [100, 100, 100]

    def test_what_differs_is_written_differently(self) -> None:
        picture = np.zeros((60, 640, 3), np.uint8)
        lines = [
            written_on(picture, time_s, np.array(command), fell)
            for time_s, command, fell in (
                (1.0, (0.5, 0.0, 0.0), None), (2.0, (0.5, 0.0, 0.0), None), (1.0, (0.0, 0.5, 0.0), None),
                (1.0, (0.5, 0.0, 0.0), 0.5), (1.0, (0.5, 0.0, 0.0), 0.9),
            )
        ]  # fmt: skip
        assert len({line.tobytes() for line in lines}) == 5
