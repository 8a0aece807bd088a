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
from footfall.pages.run_feed import RunFeed, newest_moment
from footfall.pages.view import View
from footfall.robots.balance import BalanceModel
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, plant_model
from footfall.robots.readings import Sensed

CURVES_ORDER = 1e6  # order of the curves: at the end
FRAME_S = 0.033
SMOOTHING = 0.1  # weight of the newest velocity in the shown one, per frame


class PosedModel:
    """A robot's model, posed as in a moment, with the feet on level ground."""

    def __init__(self, robot: Robot) -> None:
        self.model = plant_model(robot)
        self.data = mujoco.MjData(self.model)
        self._balance = BalanceModel(robot)
        self._joints, _ = joint_addresses(self.model, robot)
        base = self.model.body(robot.description.base)
        self._base = int(self.model.jnt_qposadr[base.jntadr[0]])

    def set_moment(self, moment: Moment) -> Moment:
        """Pose the bodies; returns the moment with its height above the ground."""
        balance = self._balance.at(
            moment.position, moment.quaternion, moment.velocity, moment.sensed, moment.contact
        )
        position = moment.position - (0.0, 0.0, balance.capture[2])
        qpos, base = self.data.qpos, self._base
        qpos[base : base + 3], qpos[base + 3 : base + 7] = position, moment.quaternion
        qpos[self._joints] = moment.sensed.joint_position
        mujoco.mj_kinematics(self.model, self.data)
        return moment._replace(position=position)


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
        posed, feed = PosedModel(robot), RunFeed(path)
        view = View(server, robot, posed.model, server.gui.add_folder("Curves", order=CURVES_ORDER))
        offer_layers(server.gui, view.layers)
        velocity = np.zeros(3)
        posed.set_moment(_standing(robot))
        view.stand(posed.data)
        while not feed.ended:
            time.sleep(FRAME_S)
            moment = newest_moment(feed, len(robot.description.feet))
            if moment is None:
                continue
            velocity = velocity + SMOOTHING * (moment.velocity - velocity)
            view.show(posed.data, posed.set_moment(moment), velocity, follow.value)
            if text.content != (table := _status(feed, moment, velocity)):
                text.content = table
        text.content = f"{text.content}\n\n**the run has ended**"
        signal.pause()  # until the process of the run ends this one


def _standing(robot: Robot) -> Moment:
    """A robot at rest in its default pose."""
    still, joints = np.zeros(3), np.zeros(len(robot.joint_names))
    level, support = np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, GRAVITY_M_S2])
    sensed = Sensed(still, support, level, robot.default_pose, joints, joints)
    return Moment(0.0, still, level, still, still, sensed, np.zeros(len(robot.description.feet)))


def _status(feed: RunFeed, moment: Moment, velocity: np.ndarray) -> str:
    """State, command and velocity as a table."""
    state = feed.newest("/state")
    velocities = (*velocity[:2], moment.sensed.gyro[2])
    units = ("m/s", "m/s", "rad/s")
    rows = [
        ("Policy", feed.fact("policy")),
        ("State", "starting" if state is None else state.data.lower()),
        *(
            (name, f"{measured:+.1f} of {commanded:+.2f} {unit}")
            for name, measured, commanded, unit in zip(
                ("Forward", "Left", "Yaw"), velocities, moment.command, units, strict=True
            )
        ),
    ]
    return "| | |\n| --- | --- |\n" + "\n".join(f"| {name} | {text} |" for name, text in rows)
