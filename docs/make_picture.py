"""Renders the README's picture: one walk, exposed several times.

Usage: python docs/make_picture.py [POLICY] [--robot go1] [--out docs/images/walking.png]
"""

import argparse
import os
import sys
from pathlib import Path

# MuJoCo settles on a way to render when it is imported.
if sys.platform.startswith("linux"):
    os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import numpy as np
from matplotlib import image

from footfall.evaluate.report.scene import scene_model
from footfall.plant.episode import Episode, run_episode
from footfall.plant.trace import Trace
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

WIDTH, HEIGHT = 1600, 500
OVERSAMPLING = 2  # edges are smoothed by averaging
EXPOSURES = 4
SPEED_M_S = 0.8
WALK_S = 6.0
SPACING_HEIGHTS = 2.6  # between exposures, in standing heights


def walk(robot: Robot, policy: str) -> Trace:
    """Straight ahead, on the simulated robot."""
    command = np.array([SPEED_M_S, 0.0, 0.0])
    trace = run_episode(robot, load_policy(policy, robot), Episode(lambda _: command, WALK_S))
    if trace.fell:
        sys.exit(f"{policy} fell: {trace.fall_reason}")
    return trace


def exposures(robot: Robot, trace: Trace) -> np.ndarray:
    """Samples at which the robot has come the same way further each time, the last one at the end."""
    way = trace.base_position[:, 0]
    spacing = SPACING_HEIGHTS * robot.description.standing_height_m
    wanted = way[-1] - spacing * np.arange(EXPOSURES)[::-1]
    return np.searchsorted(way, wanted).clip(max=len(way) - 1)


def picture(robot: Robot, trace: Trace) -> np.ndarray:
    """All exposures in one scene, (HEIGHT, WIDTH, 3) uint8."""
    model = scene_model(robot, None, WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING)
    model.vis.quality.shadowsize = 4096
    data, camera, options = mujoco.MjData(model), mujoco.MjvCamera(), mujoco.MjvOption()
    options.geomgroup[3:] = 0  # collision geometry, by custom
    indices = exposures(robot, trace)
    middle = trace.base_position[indices].mean(axis=0)
    height = robot.description.standing_height_m
    camera.lookat[:] = middle[0], middle[1], 0.6 * height
    camera.distance = SPACING_HEIGHTS * height * (EXPOSURES - 1) * 0.72
    camera.azimuth, camera.elevation = 104.0, -12.0
    with mujoco.Renderer(model, HEIGHT * OVERSAMPLING, WIDTH * OVERSAMPLING, max_geom=4000) as renderer:
        for number, index in enumerate(indices[::-1]):
            data.qpos[:] = trace.qpos[index]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_camlight(model, data)
            if number == 0:
                renderer.update_scene(data, camera, options)
                continue
            moving = mujoco.mjtCatBit.mjCAT_DYNAMIC
            mujoco.mjv_addGeoms(model, data, options, mujoco.MjvPerturb(), moving, renderer.scene)
        large = renderer.render().astype(float)
    blocks = large.reshape(HEIGHT, OVERSAMPLING, WIDTH, OVERSAMPLING, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", nargs="?", default="go1-flat")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "images" / "walking.png")
    options = parser.parse_args()
    robot = load_robot(options.robot)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    image.imsave(options.out, picture(robot, walk(robot, options.policy)))
    print(f"wrote {options.out}")


if __name__ == "__main__":
    main()
