"""Would a robot fall better if it folded its legs between the alarm and the ground?

    python benchmarks/falling.py --robot go1 --kicks 80
    python benchmarks/falling.py --robot g1 --policy g1-flat --kicks 26 --turn 6.5,10 --shove 1.6

A walking robot with sensor noise is turned and shoved at once; many fall. For a second from the alarm on, a
robot is damped as the loop does it, damped less, or pulled into its lying pose (without one: a crouch) by
soft joints. All ways meet the same falls. Peaks are those of that second, at each step of the physics.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from unittest import mock

import mujoco
import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.config import deploy_config
from footfall.deploy.frames import Frames
from footfall.deploy.loop import ControlLoop
from footfall.deploy.mode_actions import ModeActions
from footfall.deploy.modes import Mode
from footfall.domain_rand.noise import Noise
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot, load_robot

NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)
WATCHED_S = 1.0
CROUCH_RAD = {"knee": 1.2, "hip_pitch": -0.9, "ankle_pitch": -0.3}  # from the default pose, of a biped
SOFT = (0.1, 0.5), (0.25, 1.0), (0.5, 2.0)  # shares of the robot's stiffness and damping

Frame = Callable[[ModeActions, Mode, float], Frames]
USUAL: Frame = ModeActions.frames


@dataclass
class Peaks:
    """Largest values since the alarm."""

    motor_share: float = 0.0  # of a motor's torque, of its peak torque
    joint_nm: float = 0.0  # torque of stops, friction and contacts at a joint
    acceleration_g: float = 0.0  # of the base
    base_n: float = 0.0  # the ground's force on the base
    ground_n: float = 0.0  # on the whole robot


class Fall:
    """Makes a walking robot fall, and measures how."""

    def __init__(self, robot: Robot, kick: np.ndarray, at_s: float) -> None:
        self._robot, self._kick, self._at_s = robot, kick, at_s
        self._hooked = self._kicked = False
        self._alarm_us = 0
        self.peaks: Peaks | None = None

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        if not self._hooked:
            self._hooked = True
            self._hook(body)
        if loop.walking and loop.walking_s >= self._at_s and not self._kicked:
            self._kicked = True
            body.data.qvel[:6] += self._kick
        if loop.state.mode is Mode.FALLING and self.peaks is None:
            self.peaks = Peaks()

    def _hook(self, body: SimulatedRobot) -> None:
        """Measure after each step of the physics."""
        engine = body._engine
        step = engine.step

        def measured() -> None:
            step()
            if self.peaks is not None:
                self._measure(self.peaks, body)

        engine.step = measured  # type: ignore[method-assign]

    def _measure(self, peaks: Peaks, body: SimulatedRobot) -> None:
        model, data, joints = body.model, body.data, body._layout.qvel
        force, total, on_base = np.zeros(6), 0.0, 0.0
        base = model.jnt_bodyid[0]
        for index, contact in enumerate(data.contact):
            bodies = model.geom_bodyid[contact.geom]
            if 0 in bodies:
                mujoco.mj_contactForce(model, data, index, force)
                total += float(np.linalg.norm(force[:3]))
                on_base += float(np.linalg.norm(force[:3])) * (base in bodies)
        share = np.abs(body.truth().motor_torque) / self._robot.motor.peak_torque
        found = (
            float(share.max()),
            float(np.abs(data.qfrc_constraint[joints]).max()),
            float(np.linalg.norm(data.qacc[:3])) / GRAVITY_M_S2,
            on_base,
            total,
        )
        for name, value in zip(vars(peaks), found, strict=True):
            setattr(peaks, name, max(getattr(peaks, name), value))


def damped_with(kd: float) -> Frame:
    """Damping with another constant, N m s/rad."""

    def frames(actions: ModeActions, mode: Mode, time_s: float) -> Frames:
        return actions._joints.damping(kd) if mode is Mode.FALLING else USUAL(actions, mode, time_s)

    return frames


def folded(robot: Robot, stiffness: float, damping: float) -> Frame:
    """Soft joints pull the legs towards the lying pose, or into a crouch."""
    zeros, pose = np.zeros(len(robot.joint_names)), robot.lying_pose
    if pose is None:
        bends = [[by for part, by in CROUCH_RAD.items() if part in name] for name in robot.joint_names]
        pose = robot.default_pose + np.array([sum(each) for each in bends])
    command = JointCommand(pose, zeros, stiffness * robot.kp, damping * robot.kd, zeros)

    def frames(actions: ModeActions, mode: Mode, time_s: float) -> Frames:
        return actions._joints.command(command) if mode is Mode.FALLING else USUAL(actions, mode, time_s)

    return frames


def peaks_of(robot: Robot, policy: str, seed: int, options: argparse.Namespace, way: Frame) -> Peaks | None:
    """The peaks of one fall; None if the robot stays up."""
    rng = np.random.default_rng(seed)
    turn, low_high = rng.normal(size=2), options.turn
    turn *= rng.uniform(*low_high) / np.linalg.norm(turn)
    kick = np.array([*rng.normal(0.0, options.shove, 2), 0.0, *turn, 0.0])
    fall = Fall(robot, kick, rng.uniform(0.5, 1.5))
    config = deploy_config(robot)
    config = replace(config, safety=replace(config.safety, damping_s=WATCHED_S))
    episode = Episode(
        lambda _: np.array([0.5, 0.0, 0.0]), 3.0, seed, noise=NOISE, record=False, config=config
    )
    with mock.patch.object(ModeActions, "frames", way):
        run_episode(robot, load_policy(policy, robot), episode, fall)
    return fall.peaks


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="go1-flat")
    parser.add_argument("--kicks", type=int, default=80)
    parser.add_argument("--turn", type=lambda text: tuple(map(float, text.split(","))), default=(11.0, 17.0))
    parser.add_argument("--shove", type=float, default=1.0, help="standard deviation, m/s")
    options = parser.parse_args()
    robot = load_robot(options.robot)
    kd = deploy_config(robot).safety.damping_kd
    ways = {f"damped, {kd:g} N m s/rad": USUAL, f"damped, {kd / 6:g}": damped_with(kd / 6)}
    ways |= {f"folded, {kp:g} kp, {kd:g} kd": folded(robot, kp, kd) for kp, kd in SOFT}
    falling = range(options.kicks)
    first: np.ndarray | None = None
    for name, way in ways.items():
        found = {seed: peaks_of(robot, options.policy, seed, options, way) for seed in falling}
        falling = [seed for seed, peaks in found.items() if peaks is not None]  # type: ignore[assignment]
        rows = np.array([list(vars(peaks).values()) for peaks in found.values() if peaks is not None])
        if first is None:
            first = rows
            print(f"{len(rows)} falls of {options.kicks}; median, maximum (share of falls with a lower peak)")
        cells = zip(vars(Peaks()), np.median(rows, 0), rows.max(0), (rows < first).mean(0), strict=True)
        print(
            f"{name:24s}", *(f"{key} {mid:.3g}, {top:.3g} ({better:.0%})" for key, mid, top, better in cells)
        )


if __name__ == "__main__":
    main()
