"""Renders the README's animations: a policy walks, turns and is pushed on the simulated robot.

python tools/make_picture.py go1-flat
python tools/make_picture.py g1-flat --robot g1 --push 0.8 --width 400 --out g1.webp
python tools/make_picture.py hexapod-flat --robot hexapod --push 1 --width 400 --out docs/images/hexapod.webp
python tools/make_picture.py go1-rough --ground stairs,step_m=0.2 --width 400 --out docs/images/stairs.webp
"""

import argparse
import os
import sys
from functools import partial
from pathlib import Path

# MuJoCo reads MUJOCO_GL when it is imported.
if sys.platform.startswith("linux"):
    os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np
from PIL import Image

from footfall.evaluate.report import films
from footfall.plant.episode import Episode, Push, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot
from footfall.terrain.declaration import load_ground

COURSE = (  # (start time in s, shares of the largest forward, leftward and yaw command)
    (0.0, (1.0, 0.0, 0.0)),
    (3.5, (0.5, 0.0, -1.0)),
    (5.0, (1.0, 0.0, 0.0)),
)
STRAIGHT_SHARE = 0.5  # share of the largest forward command, on ground that is not level
PUSH_AFTER_S = 2.0
DURATION_S = 6.0
FIRST_FRAME = 12  # index of the first frame that is kept: the robot starts to walk before it
QUALITY = 55  # of WebP, 0 to 100


def straight(fastest: np.ndarray, time_s: float) -> np.ndarray:
    """The command straight ahead, (3,), with the arguments of `command`."""
    return fastest * [STRAIGHT_SHARE, 0.0, 0.0]


def command(fastest: np.ndarray, time_s: float) -> np.ndarray:
    """The command, (3,), at a time after walking began; `fastest` (3,) is the robot's largest command."""
    return fastest * [shares for start_s, shares in COURSE if time_s >= start_s][-1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", nargs="?", default="go1-flat")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs/images/walking.webp")
    parser.add_argument("--push", type=float, default=2.0, help="m/s to the left")
    parser.add_argument("--width", type=int, default=films.WIDTH, help="of the picture, pixels")
    parser.add_argument("--ground", help="as in footfall deploy; the robot walks straight, without pushes")
    options = parser.parse_args()
    robot = load_robot(options.robot)
    policy = load_policy(options.policy, robot)
    ranges = robot.description.commands
    fastest = np.array([ranges.forward_m_s[1], ranges.leftward_m_s[1], ranges.yaw_rad_s[1]])
    ground = load_ground(options.ground) if options.ground else None
    pushes = () if ground else (Push(PUSH_AFTER_S, (0.0, options.push, 0.0)),)
    course = partial(straight if ground else command, fastest)
    trace = run_episode(robot, policy, Episode(course, DURATION_S, pushes=pushes, ground=ground))
    if trace.fell:
        sys.exit(f"{options.policy} fell: {trace.fall_reason}")
    film = films.FilmTask(options.robot, None, trace, pushes, DURATION_S, ground)
    size = options.width, round(options.width * films.HEIGHT / films.WIDTH)
    first, *others = [Image.fromarray(frame).resize(size) for frame in films.frames(film)][FIRST_FRAME:]
    frame_ms = round(1000 / films.FRAME_RATE_HZ)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    first.save(
        options.out, save_all=True, append_images=others, duration=frame_ms, loop=0, quality=QUALITY, method=6
    )
    print(f"wrote {options.out}: {1 + len(others)} frames, {options.out.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
