"""Films of the test course, their scene and their captions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from report_pages import walked

from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report import films, scene
from footfall.evaluate.report.caption import command_text
from footfall.evaluate.report.films import FilmTask, arrows
from footfall.plant.episode import Push
from footfall.plant.trace import Trace
from footfall.robots.description import Robot

TILTED = (0.9, 0.1, -0.2, 0.35)  # about all axes


class TestFilms:
    def task(self, trace: Trace, pushes: tuple[Push, ...] = ()) -> FilmTask:
        return FilmTask("go1", None, trace, pushes, 1.0)

    def test_another_renderer_is_tried_if_one_fails(self, monkeypatch: pytest.MonkeyPatch) -> None:
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

    def test_arrows_of_command_and_motion_differ_and_are_level(self) -> None:
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
        assert [len(arrows(task, index, 0.4)) for index in (99, 100, 140, 141)] == [2, 3, 3, 2]


def test_a_plant_without_a_floor_is_given_one(go1: Robot, tmp_path: Path) -> None:
    plant = tmp_path / "bare.xml"
    plant.write_text(
        '<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    model = scene.scene_model(go1, plant, 64, 64)
    assert model.geom_type[model.geom(scene.FLOOR).id] == mujoco.mjtGeom.mjGEOM_PLANE
    assert model.nq == 7


class TestCaption:
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
        assert command_text(np.array(command)) == words
