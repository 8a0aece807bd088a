"""The page, the film and the functions that the command line calls, end to end with short scenarios."""

import json
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
from rich.console import Console

from footfall.evaluate import api
from footfall.evaluate.api import compare_policies
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.plan import CommandSchedule
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import films
from footfall.evaluate.report.films import Film, FilmTask, render_films
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint, load_scenarios
from footfall.evaluate.suite import run_suite
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.trace import Trace
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

SHORT = ScenarioFile(
    noise=load_scenarios(load_robot("go1")).noise,
    scenarios={
        "still": Scenario("Standing still", 2, 1.3),
        "push": Scenario(
            "Standing, then pushed",
            4,
            1.0,
            levels={"push_m_s": (0.1, 6.0), "push_direction_deg": (0.0, 90.0)},
            push_between_s=(0.1, 0.2),
            rows=("push_m_s",),
        ),
        "course": Scenario("A stand", 1, 1.2, script=(Waypoint(0.0),), pushes=(Push(0.5, (0.0, 0.2, 0.0)),)),
    },
)


@pytest.fixture(scope="module")
def standing(go1: Robot) -> Trace:
    episode = Episode(CommandSchedule((0.0,), ((0.0, 0.0, 0.0),)), 0.4)
    return run_episode(go1, load_policy("stand", go1), episode)


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


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict, Path, Path]:
    """A comparison on a machine that cannot render: results, JSON, page."""
    folder = tmp_path_factory.mktemp("compared")
    html, results = folder / "report.html", folder / "report.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(api, "load_scenarios", lambda *_: SHORT)
        patch.setattr(
            films, "render_films", lambda tasks, *_: [TaskResult(None, "egl: no display")] * len(tasks)
        )
        returned = compare_policies(
            ["stand", "trot"],
            EvaluationConfig("go1", ("still", "push"), episodes=1, workers=1),
            json_path=results,
            html_path=html,
            console=Console(quiet=True),
        )
    return returned, results, html


class TestCompare:
    def test_results_are_grouped_by_contender(self, compared: tuple[dict, Path, Path]) -> None:
        results, path, _ = compared
        assert list(results) == ["stand", "trot"]
        assert results == json.loads(path.read_text())
        for name, result in results.items():
            assert result["policy"] == name
            assert 0.0 < result["compute_ms"]["p50"] <= result["compute_ms"]["p99"]
            assert set(result["scenarios"]) == {"still", "push"}

    def test_the_page_gives_the_reason_for_missing_films(self, compared: tuple[dict, Path, Path]) -> None:
        text = compared[2].read_text(encoding="utf-8")
        assert text.count("No film of ") == text.count("egl: no display") == 2


class TestFilm:
    def test_a_film_shows_the_robot_and_plays_in_a_browser(self, standing: Trace, tmp_path: Path) -> None:
        film = _film_or_skip(standing)
        path = tmp_path / "film.mp4"
        path.write_bytes(film.mp4)
        reader = imageio_ffmpeg.read_frames(str(path))
        facts = next(reader)
        assert facts["codec"] == "h264"
        assert facts["pix_fmt"].startswith("yuv420p")
        assert facts["source_size"] == (films.WIDTH, films.HEIGHT)
        frame = np.frombuffer(next(reader), np.uint8).reshape(films.HEIGHT, films.WIDTH, 3).astype(int)
        reader.close()
        red, green, blue = np.moveaxis(frame, -1, 0)
        orange = (red > 140) & (green < 0.75 * red) & (blue < 0.5 * red)  # the robot's hip motors
        rows, columns = np.nonzero(orange)
        assert len(rows) > 200
        assert abs(columns.mean() - films.WIDTH / 2) < films.WIDTH / 6
        assert blue[:20].mean() > red[:20].mean() + 20  # the sky

    def test_without_rendering_the_reason_is_given(
        self, standing: Trace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("MUJOCO_GL", "crayons")
        (outcome,) = render_films([FilmTask("go1", None, standing, (), 0.4)])
        assert outcome.value is None
        assert "crayons" in outcome.error


def _film_or_skip(trace: Trace) -> Film:
    (outcome,) = render_films([FilmTask("go1", None, trace, (), 0.6)])
    if outcome.value is None:
        pytest.skip(f"this machine cannot render: {outcome.error}")
    return outcome.value
