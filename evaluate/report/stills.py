"""One picture of several walks: a row of stills for each, from beginning to end."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from footfall.evaluate.report.films import FilmTask, camera_shots, render_in_processes
from footfall.plant.trace import Trace

STILL_COUNT = 5
SHRINK_FACTOR = 2  # factor by which a film's frames are shrunk
TEXT_HEIGHT, MARGIN = 15, 4  # pixels
GOOD, BAD, GROUND = (20, 30, 40), (170, 30, 20), (255, 255, 255)


@dataclass(frozen=True)
class Walk:
    """A row of the picture."""

    name: str
    trouble: str  # reason of a fall or stop; empty if there was none
    trace: Trace


def draw_walks(robot: Path, walks: Sequence[Walk], path: Path) -> str:
    """Write a JPEG of walks; returns an error, or an empty text on success.

    Args:
        robot: folder of the robot that walked.
        walks: those without samples are left out.
        path: path of the JPEG.
    """
    walked = [walk for walk in walks if len(walk.trace.time_s)]
    if not walked:
        return "no controller took a step"
    tasks = [FilmTask(str(robot), None, walk.trace, (), float(walk.trace.time_s[-1])) for walk in walked]
    outcomes = render_in_processes(stills, tasks)
    rows = [
        _row(walk, row.value) for walk, row in zip(walked, outcomes, strict=True) if row.value is not None
    ]
    if not rows:
        return outcomes[0].error
    try:
        Image.fromarray(np.concatenate(rows)).save(path, format="jpeg", quality=85)
    except OSError as error:
        return f"cannot write {path}: {error.strerror or error}"
    return ""


def stills(task: FilmTask) -> np.ndarray:
    """Stills of an episode side by side, (height, width, 3) uint8. Runs in a worker, as `films.film`."""
    last = len(task.trace.time_s) - 1
    indices = np.linspace(0, last, STILL_COUNT).astype(int)
    with camera_shots(task) as shoot:
        shots = {index: shoot(index) for index in range(last + 1) if index in indices}
    return np.concatenate(
        [shots[index][::SHRINK_FACTOR, ::SHRINK_FACTOR] for index in indices.tolist()], axis=1
    )


def _row(walk: Walk, row: np.ndarray) -> np.ndarray:
    """A row with its name above it."""
    band = Image.new("RGB", (row.shape[1], TEXT_HEIGHT + 2 * MARGIN), GROUND)
    text = f"{walk.name}: {walk.trouble}" if walk.trouble else walk.name
    font = ImageFont.load_default(TEXT_HEIGHT)
    ImageDraw.Draw(band).text((MARGIN, MARGIN), text, BAD if walk.trouble else GOOD, font)
    return np.concatenate([np.asarray(band), row])
