"""Films of the test course, their scene and their captions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from report_pages import walked
from scipy.spatial.transform import Rotation

from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import films, scene
from footfall.evaluate.report.caption import command_text
from footfall.evaluate.report.films import FilmTask, arrows, frame_indices, frame_times, render_films
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.trace import Trace
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot


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
        ([0.6, 0.0, 0.8], "forward 0.6 m/s, turn left 0.8 rad/s"),
        ([-0.31, 0.5, 0.0], "backward 0.3 m/s, left 0.5 m/s"),
        ([0.0, -0.5, -0.06], "right 0.5 m/s, turn right 0.1 rad/s"),
        ([0.04, -0.04, 0.049], "stand"),
    ):
        assert command_text(np.array(command)) == words
