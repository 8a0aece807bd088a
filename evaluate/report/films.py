"""A film of an episode: H.264 in an MP4, rendered without a screen, with time and command in the picture."""

import base64
import io
import os
import sys
import tempfile
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

import imageio_ffmpeg
import mujoco
import numpy as np
from PIL import Image

from footfall.common import colours
from footfall.common.rotations import heading, heading_matrix
from footfall.evaluate.comparison import Comparison
from footfall.evaluate.pool import TaskResult, run_all
from footfall.evaluate.report import caption, scene
from footfall.evaluate.suite import CourseWalk
from footfall.plant.episode import Push
from footfall.plant.trace import Trace
from footfall.robots.description import load_robot
from footfall.terrain.declaration import make_ground
from footfall.terrain.ground import Ground

T = TypeVar("T")

WIDTH, HEIGHT, FRAME_RATE_HZ = 640, 400, 25
PUSH_SHOWN_S = 0.4
ARROW_S = 0.4  # an arrow is as long as the distance covered in this time
# Offscreen GL back ends, best first. The user's MUJOCO_GL takes precedence.
BACK_ENDS = ("egl", "osmesa") if sys.platform.startswith("linux") else ("",)


@dataclass(frozen=True)
class FilmTask:
    """What to film, as plain data."""

    robot: str
    plant: Path | None
    trace: Trace
    pushes: tuple[Push, ...]
    duration_s: float  # of the film; if the episode ends earlier, the last picture stays
    ground: Ground | None = None  # None is level


@dataclass(frozen=True)
class Film:
    """A film and a still of it."""

    mp4: bytes
    poster_jpeg: bytes

    @property
    def mp4_base64(self) -> str:
        return base64.b64encode(self.mp4).decode()

    @property
    def poster_base64(self) -> str:
        return base64.b64encode(self.poster_jpeg).decode()


class Arrow(NamedTuple):
    """An arrow among the scenery, (3,) each, m, in the world."""

    start: np.ndarray
    vector: np.ndarray
    colour: np.ndarray  # red, green, blue, opacity


def films_of(comparison: Comparison) -> dict[str, TaskResult[Film]]:
    """A film of each policy's walk over the test course, by name, or the reason why there is none."""
    return _films(comparison, {policy.name: policy.course for policy in comparison.policies})


def films_on_grounds(comparison: Comparison) -> dict[str, dict[str, TaskResult[Film]]]:
    """Films of walks on the scenarios' grounds, by scenario and name, or the reason why there is none."""
    scenarios = dict.fromkeys(name for policy in comparison.policies for name in policy.on_grounds)
    return {
        scenario: _films(
            comparison, {policy.name: policy.on_grounds[scenario] for policy in comparison.policies}
        )
        for scenario in scenarios
    }


def _films(comparison: Comparison, walks: Mapping[str, CourseWalk]) -> dict[str, TaskResult[Film]]:
    config = comparison.config
    tasks = {
        name: FilmTask(
            config.robot,
            config.plant,
            walk.trace,
            walk.plan.pushes,
            walk.plan.duration_s,
            None if walk.plan.ground is None else make_ground(walk.plan.ground, walk.plan.seed),
        )
        for name, walk in walks.items()
        if walk.trace is not None and len(walk.trace.time_s)
    }
    films = dict(zip(tasks, render_films(list(tasks.values()), config.workers), strict=True))
    no_film: TaskResult[Film] = TaskResult(None, "the policy did not walk")
    return {name: films.get(name, no_film) for name in walks}


def render_films(tasks: Sequence[FilmTask], workers: int | None = None) -> list[TaskResult[Film]]:
    """Films of several episodes, or the reason if this machine cannot render."""
    return render_in_processes(film, tasks, workers)


def render_in_processes(
    function: Callable[[FilmTask], T], tasks: Sequence[FilmTask], workers: int | None = None
) -> list[TaskResult[T]]:
    """Results of a module-level rendering function for several episodes, or the reason of its failure.

    It runs in other processes, since MuJoCo chooses its GL back end when it is imported, and since a broken
    driver may crash its process.
    """
    outcomes: list[TaskResult[T]] = [TaskResult(None, "no back end was tried")] * len(tasks)
    reasons = []
    users_back_end = os.environ.get("MUJOCO_GL")
    for back_end in (users_back_end,) if users_back_end else BACK_ENDS:
        variables = {"MUJOCO_GL": back_end, "PYOPENGL_PLATFORM": back_end} if back_end else {}
        outcomes = run_all(function, tasks, workers, environment=variables)
        failed = next((outcome.error for outcome in outcomes if outcome.error), "")
        if not failed:
            return outcomes
        reasons.append(f"{back_end or 'default'}: {failed}")
    return [o if o.value else TaskResult(None, "; ".join(reasons)) for o in outcomes]


def film(task: FilmTask) -> Film:
    """Render one episode. Runs in a worker; MUJOCO_GL in its environment names the GL back end."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        encoder = _encoder(path)
        times = frame_times(task)
        for index, frame in enumerate(frames(task)):
            encoder.send(frame)
            if index == len(times) // 3:
                poster = _jpeg(frame)
        encoder.close()
        return Film(path.read_bytes(), poster)


def frame_times(task: FilmTask) -> np.ndarray:
    """Times of the frames, s, (frames,). All films of a comparison have the same times."""
    return np.arange(0.0, task.duration_s, 1.0 / FRAME_RATE_HZ)


def frame_indices(task: FilmTask) -> np.ndarray:
    """Index of the trace's sample for each frame, int (frames,); after the end, the last sample."""
    recorded = task.trace.time_s
    if not len(recorded):
        raise ValueError("the episode has no samples to film")
    return np.minimum(np.searchsorted(recorded, frame_times(task) - 1e-9), len(recorded) - 1)


def frames(task: FilmTask) -> Iterator[np.ndarray]:
    """Images (HEIGHT, WIDTH, 3) uint8 of an episode."""
    trace = task.trace
    rendered_index, picture = -1, np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    with camera_shots(task) as shoot:
        for time_s, index in zip(frame_times(task), frame_indices(task), strict=True):
            if index != rendered_index:
                rendered_index, picture = index, shoot(int(index))
            fell_at_s = float(trace.time_s[-1]) if trace.fell and time_s > trace.time_s[-1] else None
            yield caption.with_caption(picture, float(time_s), trace.command[index], fell_at_s)


@contextmanager
def camera_shots(task: FilmTask) -> Iterator[Callable[[int], np.ndarray]]:
    """Yields a function that renders a sample of the trace; call it in order, since the camera follows."""
    robot, trace = load_robot(task.robot), task.trace
    height_m = robot.description.standing_height_m
    model = scene.scene_model(robot, task.plant, WIDTH, HEIGHT, task.ground)
    data, camera, options = mujoco.MjData(model), mujoco.MjvCamera(), mujoco.MjvOption()
    options.geomgroup[scene.HIDDEN_GROUPS :] = 0
    looked_at = trace.base_position[0].copy()
    size_m = scene.size_of(model, trace.qpos[0])
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:

        def shoot(index: int) -> np.ndarray:
            data.qpos[:] = trace.qpos[index]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            looked_at[:] += 0.15 * (trace.base_position[index] - looked_at)
            scene.follow(camera, looked_at, size_m, task.ground is None)
            renderer.update_scene(data, camera, options)
            for arrow in arrows(task, index, height_m):
                scene.add_arrow(renderer.scene, *arrow)
            return renderer.render()

        yield shoot


def arrows(task: FilmTask, index: int, height_m: float) -> list[Arrow]:
    """Arrows of commanded and true horizontal velocity above the robot, and of a push for a while.

    Args:
        task: trace and pushes to draw.
        index: sample of the trace.
        height_m: standing height of the robot.
    """
    trace = task.trace
    base = trace.base_position[index]
    to_world = heading_matrix(heading(trace.base_quaternion[index]))
    velocities = (
        (trace.command[index], colours.COMMAND, 0.7 * height_m),
        (trace.base_velocity[index], colours.VELOCITY, 0.7 * height_m + 0.05),
    )
    drawn = [
        Arrow(
            base + np.array([0.0, 0.0, above_m]),
            to_world @ [ARROW_S * forward, ARROW_S * leftward, 0.0],
            colour,
        )
        for (forward, leftward, _), colour, above_m in velocities
    ]
    for push in task.pushes:
        if 0.0 <= trace.time_s[index] - push.time_s <= PUSH_SHOWN_S:
            vector = np.array(push.delta_v_m_s) * ARROW_S
            drawn.append(Arrow(base - vector, vector, colours.PUSH))
    return drawn


def _encoder(path: Path) -> Generator[None, np.ndarray | None, None]:
    """Encodes frames passed to `send`; `close` ends the film. H.264 and yuv420p play in any browser."""
    encoder = imageio_ffmpeg.write_frames(
        str(path),
        (WIDTH, HEIGHT),
        fps=FRAME_RATE_HZ,
        codec="libx264",
        pix_fmt_out="yuv420p",
        quality=None,
        macro_block_size=16,
        output_params=["-crf", "27", "-preset", "medium", "-movflags", "+faststart", "-threads", "1"],
    )
    encoder.send(None)
    return encoder


def _jpeg(image: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, format="jpeg", quality=82)
    return buffer.getvalue()
