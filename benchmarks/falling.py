"""Impact of a falling robot: with damping only, as in the loop, or with legs that fold while it falls.

    python benchmarks/falling.py trot --robot go1 --falls 6
    python benchmarks/falling.py tripod --robot hexapod --falls 4 --push 3 5

A randomised robot that walks is pushed over. From the mode FALLING on, the largest contact force on any part
except the feet is recorded, relative to the weight, and the largest torque, relative to the motor's peak.
Folding moves the legs to the lying pose with a share of the stiffness. All alternatives get the same pushes.
"""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import mujoco
import numpy as np

from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.mode_actions import ModeActions
from footfall.deploy.modes import Mode
from footfall.deploy.safety import State
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model

WATCHED_S, PUSHED_S, LASTS_S = 1.2, (1.0, 1.4), 2.5
SHARES = {"damped": None, "folds, stiffness 0.1": 0.1, "folds, stiffness 0.3": 0.3}


class Watch:
    """The largest impact and torque of a fall; `fell` if there was one."""

    def __init__(self, robot: Robot) -> None:
        self._peak = robot.motor.peak_torque
        self._feet = {name for foot in robot.description.feet for name in foot.geoms}
        self.fell, self.impact, self.torque = False, 0.0, 0.0

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.state.mode is not Mode.FALLING:
            return
        self.fell = True
        model, data, total, force = body.model, body.data, 0.0, np.zeros(6)
        for index in range(data.ncon):
            geoms = data.contact[index].geom
            names = {model.geom(geom).name for geom in geoms}
            if 0 in model.geom_bodyid[geoms] and not names & self._feet:
                mujoco.mj_contactForce(model, data, index, force)
                total += force[0]
        self.impact = max(self.impact, total / (9.81 * model.body_mass.sum()))
        self.torque = max(self.torque, float((np.abs(body.truth().motor_torque) / self._peak).max()))


@contextmanager
def folding(robot: Robot, share: float | None, kd: float) -> Iterator[None]:
    """A loop that moves to the lying pose in FALLING instead of damping only; None changes nothing."""
    original, zero = ModeActions.frames, np.zeros(len(robot.joint_names))
    pose = robot.lying_pose if robot.lying_pose is not None else robot.default_pose

    def frames_that_fold(self: ModeActions, state: State, now_us: int) -> object:
        if state.mode is not Mode.FALLING or share is None:
            return original(self, state, now_us)
        return self._joints.command(JointCommand(pose, zero, share * robot.kp, zero + kd, zero))

    ModeActions.frames = frames_that_fold  # type: ignore[method-assign,assignment]
    try:
        yield
    finally:
        ModeActions.frames = original  # type: ignore[method-assign]


def fall(robot: Robot, policy: str, seed: int, push_m_s: tuple[float, float], share: float | None) -> Watch:
    """One push, and the fall if the robot falls."""
    rng, watch = np.random.default_rng(seed), Watch(robot)
    angle, speed, at_s = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(*push_m_s), rng.uniform(*PUSHED_S)
    config = deploy_config(robot)
    bodies = plant_model(robot).nbody - 1
    command = np.array([0.5 * robot.description.commands.forward_m_s[1], 0.0, 0.0])
    episode = Episode(
        command_source=lambda _: command,
        duration_s=LASTS_S,
        seed=seed,
        sample=draw(randomisation_of(robot), rng.random, len(robot.joint_names), bodies),
        noise=load_scenarios(robot).noise,
        pushes=(Push(at_s, (speed * np.cos(angle), speed * np.sin(angle), 0.0)),),
        record=False,
        config=replace(config, safety=replace(config.safety, damping_s=WATCHED_S)),
    )
    with folding(robot, share, config.safety.damping_kd):
        run_episode(robot, load_policy(policy, robot), episode, watch)
    return watch


def main() -> None:
    """Measure, and print means and medians over the seeds in which every alternative falls."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("policy")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--falls", type=int, default=6)
    parser.add_argument("--push", type=float, nargs=2, default=(2.5, 4.5), help="range, m/s")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    robot, seed = load_robot(options.robot), options.seed
    rows: list[list[tuple[float, float]]] = []
    while len(rows) < options.falls:
        found = [fall(robot, options.policy, seed, options.push, share) for share in SHARES.values()]
        seed += 1
        if all(each.fell for each in found):
            rows.append([(each.impact, each.torque) for each in found])
            print(f"{len(rows)}: " + ", ".join(f"{impact:.1f}" for impact, _ in rows[-1]), flush=True)
    for name, values in zip(SHARES, np.array(rows).transpose(1, 2, 0), strict=True):
        impact, torque = values
        median = np.median(impact)
        print(f"{name:22} impact {impact.mean():5.1f} (median {median:5.1f}), torque {torque.mean():.2f}")


if __name__ == "__main__":
    main()
