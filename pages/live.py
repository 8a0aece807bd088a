"""The 3-D page of a live run: it reads the run's feed and sends no commands."""

import signal
import time
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.pages.layers import offer_layers
from footfall.pages.moment import Moment
from footfall.pages.page import serving
from footfall.pages.run_feed import RunFeed, moment
from footfall.pages.view import View
from footfall.robots.balance import BalanceModel
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, plant_model
from footfall.robots.readings import Sensed

LAST = 1e6  # order of the curves: at the end
FRAME_S = 0.033
SMOOTHING = 0.1  # weight of the newest velocity in the shown one, per frame


class Pose:
    """Poses a robot's model as in a moment, with the feet on level ground."""

    def __init__(self, robot: Robot) -> None:
        self.model = plant_model(robot)
        self.data = mujoco.MjData(self.model)
        self._balance = BalanceModel(robot)
        self._joints, _ = joint_addresses(self.model, robot)
        base = self.model.body(robot.description.base)
        self._base = int(self.model.jnt_qposadr[base.jntadr[0]])

    def take(self, seen: Moment) -> Moment:
        """Pose the bodies; returns the moment with its height above the ground."""
        balance = self._balance.at(seen.position, seen.quaternion, seen.velocity, seen.sensed, seen.contact)
        position = seen.position - (0.0, 0.0, balance.capture[2])
        qpos, base = self.data.qpos, self._base
        qpos[base : base + 3], qpos[base + 3 : base + 7] = position, seen.quaternion
        qpos[self._joints] = seen.sensed.joint_position
        mujoco.mj_kinematics(self.model, self.data)
        return seen._replace(position=position)


def show_run(robot: Robot, path: Path, host: str, port: int) -> None:
    """Serve the page of a run until its process has ended.

    Args:
        robot: the robot.
        path: socket of the run's feed.
        host, port: where to listen.

    Raises:
        UserError: viser is missing, or the address is not available.
    """
    with serving(host, port, f"footfall: {robot.name}") as server:
        text = server.gui.add_markdown("**waiting for the run**")
        follow = server.gui.add_checkbox("Follow", True)
        pose, feed = Pose(robot), RunFeed(path)
        view = View(server, robot, pose.model, server.gui.add_folder("Curves", order=LAST))
        offer_layers(server.gui, view.layers)
        velocity = np.zeros(3)
        pose.take(_standing(robot))
        view.stand(pose.data)
        while not feed.over:
            time.sleep(FRAME_S)
            seen = moment(feed, len(robot.description.feet))
            if seen is None:
                continue
            velocity = velocity + SMOOTHING * (seen.velocity - velocity)
            view.show(pose.data, pose.take(seen), velocity, follow.value)
            if text.content != (now := _status(feed, seen, velocity)):
                text.content = now
        text.content = f"{text.content}\n\n**the run has ended**"
        signal.pause()  # until the process of the run ends this one


def _standing(robot: Robot) -> Moment:
    """A robot at rest in its default pose."""
    still, joints = np.zeros(3), np.zeros(len(robot.joint_names))
    level, support = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, GRAVITY_M_S2])
    sensed = Sensed(still, support, level, robot.default_pose, joints, joints)
    return Moment(0.0, still, level, still, still, sensed, np.zeros(len(robot.description.feet)))


def _status(feed: RunFeed, seen: Moment, velocity: np.ndarray) -> str:
    """State, command and velocity as a table."""
    state = feed.newest("/state")
    moving = (*velocity[:2], seen.sensed.gyro[2])
    units = ("m/s", "m/s", "rad/s")
    rows = [
        ("Policy", feed.fact("policy")),
        ("State", "starting" if state is None else state.data.lower()),
        *(
            (name, f"{now:+.1f} of {requested:+.2f} {unit}")
            for name, now, requested, unit in zip(
                ("Forward", "Left", "Yaw"), moving, seen.command, units, strict=True
            )
        ),
    ]
    return "| | |\n| --- | --- |\n" + "\n".join(f"| {name} | {text} |" for name, text in rows)
