"""Renders the README's moving picture: a policy walks, turns and is pushed on the simulated robot.

Usage: python docs/make_picture.py [POLICY] [--robot go1] [--out docs/images/walking.webp]
"""

import argparse
import os
import sys
from pathlib import Path

# MuJoCo settles on a way to render when it is imported.
if sys.platform.startswith("linux"):
    os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np
from PIL import Image

from footfall.evaluate.report import films
from footfall.plant.episode import Episode, Push, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

COURSE = (  # from this time on, s: forward m/s, leftward m/s, yaw rad/s
    (0.0, (1.0, 0.0, 0.0)),
    (3.5, (0.5, 0.0, -1.0)),
    (5.0, (1.0, 0.0, 0.0)),
)
PUSH = Push(2.0, (0.0, 2.0, 0.0))
DURATION_S = 6.0
BEGIN = 12  # frames left out, in which it sets off
QUALITY = 55  # of WebP, 0 to 100


def command(time_s: float) -> np.ndarray:
    """What is asked for so long after walking began, (3,)."""
    return np.array([vector for start_s, vector in COURSE if time_s >= start_s][-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", nargs="?", default="go1-flat")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images" / "walking.webp")
    options = parser.parse_args()
    robot = load_robot(options.robot)
    trace = run_episode(
        robot, load_policy(options.policy, robot), Episode(command, DURATION_S, pushes=(PUSH,))
    )
    if trace.fell:
        sys.exit(f"{options.policy} fell: {trace.fall_reason}")
    film = films.FilmTask(options.robot, None, trace, (PUSH,), DURATION_S)
    first, *others = [Image.fromarray(frame) for frame in films.frames(film)][BEGIN:]
    frame_ms = round(1000 / films.FRAME_RATE_HZ)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    first.save(
        options.out, save_all=True, append_images=others, duration=frame_ms, loop=0, quality=QUALITY, method=6
    )
    print(f"wrote {options.out}: {1 + len(others)} frames, {options.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
