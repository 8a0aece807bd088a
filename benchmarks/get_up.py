"""Success, time and energy of a get-up policy after random drops of the simulated robot.

    python benchmarks/get_up.py POLICY --robot go1 --drops 1000 --workers 2 [--slope-deg 15] [--json FILE]

Each drop: a randomised robot is pushed over. While the loop damps it, it is dropped from 0.3 m in any
attitude, with any joint positions inside its limits, and lies for 1.5 s. Then it gets up, as with
`deploy --recover`. It stands as soon as three conditions hold for half a second: its base is within 0.2 rad
of upright, the base's height is within 15 % of the standing height, and no joint is faster than 1 rad/s.
Times begin with RECOVERING; only the first try is measured.

With `--tip` the robot is laid on its side in the air instead, for robots that no push tips over.

With `--slope-deg` the ground slopes from the drop on, by up to this angle in any direction. A robot then
counts as upright by gravity or by the slope, and its height is measured above the slope.
"""

import argparse
import json
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.rotations import random_rotation, rotation_matrix, tilt
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.recovery import GetUp
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import joint_addresses, plant_model

DROP_M, LIE_S, DAMPING_SHARE = 0.3, 1.5, 0.02
PUSH_M_S, EPISODE_S = 9.0, 20.0
ON_ITS_SIDE = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
UPRIGHT_RAD, HEIGHT_SHARE, SLOW_RAD_S, HOLD_S = 0.2, 0.15, 1.0, 0.5
AFTER_S = 1.0  # of standing, recorded after the robot is up


@dataclass
class Result:
    """One drop."""

    seed: int
    slope_rad: float = 0.0  # of the ground
    tilt_rad: float | None = None  # of the base as it lay; None if the loop damped it for another reason
    stood_s: float | None = None  # time from the start of RECOVERING until the robot stands
    ended: str = ""  # the mode after RECOVERING
    ended_s: float | None = None  # time from the start of RECOVERING to the start of that mode
    fault: str = ""  # why RECOVERING ended, unless the robot stood
    energy_j: float = 0.0  # electrical, until it stood
    torque_share: float = 0.0  # greatest, of a motor's peak torque
    impact_share: float = 0.0  # largest normal force on any part except the feet, relative to the weight
    speed_rad_s: float = 0.0  # greatest, of a joint


class Drop:
    """Drops a robot that fell, and watches it get up."""

    def __init__(self, robot: Robot, seed: int, slope_rad: float, tips: bool) -> None:
        self._robot, self._rng, self.result = robot, np.random.default_rng(seed), Result(seed)
        self._steepest_rad, self._up = slope_rad, np.array([0.0, 0.0, 1.0])  # normal of the ground
        self._tips, self._tipped = tips, False
        # Times by the simulation's clock: start and end of RECOVERING, since when upright, previous tick.
        self._began_s: float | None = None
        self._ended_s: float | None = None
        self._upright_s: float | None = None
        self._last_s = 0.0

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Watch a tick of the loop."""
        mode, now_s, found = loop.state.mode, 1e-6 * body.time_us, self.result
        if found.tilt_rad is None:
            if mode is Mode.FALLING:
                self._drop(body)
            elif mode is Mode.WALKING and self._tips and not self._tipped:
                self._tipped = True
                self._tip(body)
            return
        if self._began_s is None:
            if mode is Mode.RECOVERING:
                self._began_s = self._last_s = now_s
                body.take_power()
            return
        if self._ended_s is None and mode is not Mode.RECOVERING:
            self._ended_s, found.ended, found.ended_s = now_s, str(mode), now_s - self._began_s
            found.fault = "" if mode is Mode.STANDING else loop.state.faults[-1]
        if self._ended_s is not None and (mode is not Mode.STANDING or now_s - self._ended_s > AFTER_S):
            loop.finish(skip_lie_down=True)
            return
        self._watch(body, now_s)

    def _watch(self, body: SimulatedRobot, now_s: float) -> None:
        truth, found, motor = body.truth(), self.result, self._robot.motor
        torque_share = float(np.max(np.abs(truth.motor_torque) / motor.peak_torque))
        found.torque_share = max(found.torque_share, torque_share)
        fastest = float(np.abs(truth.joint_velocity).max())
        found.speed_rad_s = max(found.speed_rad_s, fastest)
        found.impact_share = max(found.impact_share, self._impact(body))
        if found.stood_s is None:
            found.energy_j += max(body.take_power().electrical, 0.0) * (now_s - self._last_s)
        self._last_s = now_s
        height = self._up @ truth.base_position / self._robot.description.standing_height_m
        tilt_rad = min(self._tilt(truth.base_quaternion), tilt(truth.base_quaternion))
        is_up = tilt_rad < UPRIGHT_RAD and abs(height - 1.0) < HEIGHT_SHARE
        if not (is_up and fastest < SLOW_RAD_S):
            if found.stood_s is None:
                self._upright_s = None
        elif self._upright_s is None:
            self._upright_s = now_s
        elif now_s - self._upright_s >= HOLD_S and found.stood_s is None and self._began_s is not None:
            found.stood_s = self._upright_s - self._began_s

    def _tip(self, body: SimulatedRobot) -> None:
        """Lay the robot on its side, at rest, above the ground."""
        model, data = body.model, body.data
        data.qpos[2], data.qpos[3:7] = self._robot.description.standing_height_m + DROP_M, ON_ITS_SIDE
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)

    def _drop(self, body: SimulatedRobot) -> None:
        model, data, rng = body.model, body.data, self._rng
        positions, dofs = joint_addresses(model, self._robot)
        lower, upper = self._robot.soft_limits
        mujoco.mj_resetData(model, data)
        data.qpos[2], data.qpos[3:7] = 2.0, random_rotation(rng.random(3))
        data.qpos[positions] = rng.uniform(lower, upper)
        self._slope(model)
        mujoco.mj_forward(model, data)
        shapes, up = model.geom_contype | model.geom_conaffinity, self._up
        lowest = min(
            up @ data.geom_xpos[g] - np.abs(up @ data.geom_xmat[g].reshape(3, 3)) @ model.geom_aabb[g, 3:]
            for g in np.flatnonzero(shapes & (model.geom_bodyid > 0))
        )
        data.qpos[:3] += (DROP_M - lowest) * up
        for _ in range(round(LIE_S / model.opt.timestep)):
            data.qfrc_applied[dofs] = -DAMPING_SHARE * self._robot.motor.peak_torque * data.qvel[dofs]
            mujoco.mj_step(model, data)
        self.result.tilt_rad = self._tilt(data.qpos[3:7])

    def _slope(self, model: mujoco.MjModel) -> None:
        """Let the floor slope about the world's origin."""
        slope_rad, azimuth = self._steepest_rad * self._rng.random(), 2.0 * np.pi * self._rng.random()
        half, axis = 0.5 * slope_rad, (np.cos(azimuth), np.sin(azimuth))
        quaternion = np.array([np.cos(half), np.sin(half) * axis[0], np.sin(half) * axis[1], 0.0])
        floors = (model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE) & (model.geom_bodyid == 0)
        model.geom_quat[floors] = quaternion
        model.geom_sameframe[floors] = 0  # the compiled model marks the floor as level
        self._up, self.result.slope_rad = rotation_matrix(quaternion)[:, 2], slope_rad

    def _tilt(self, quaternion: np.ndarray) -> float:
        """Angle between the base's z axis and the ground's normal, rad."""
        return float(np.arccos(np.clip(self._up @ rotation_matrix(quaternion)[:, 2], -1.0, 1.0)))

    def _impact(self, body: SimulatedRobot) -> float:
        model, data, total, force = body.model, body.data, 0.0, np.zeros(6)
        for k in range(data.ncon):
            geoms = data.contact[k].geom
            names = {model.geom(g).name for g in geoms}
            if 0 in model.geom_bodyid[geoms] and not names & _feet(self._robot):
                mujoco.mj_contactForce(model, data, k, force)
                total += force[0]
        return float(total / (9.81 * model.body_mass.sum()))


@lru_cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def _feet(robot: Robot) -> set[str]:
    return {name for foot in robot.description.feet for name in foot.geoms}


def run_drop(robot_name: str, policy: str, slope_rad: float, tips: bool, seed: int) -> Result:
    """Drop once."""
    robot, rng = _robot(robot_name), np.random.default_rng([seed, 1])
    drop, angle = Drop(robot, seed, slope_rad, tips), rng.uniform(0.0, 2.0 * np.pi)
    push = Push(0.3, (PUSH_M_S * np.cos(angle), PUSH_M_S * np.sin(angle), 1.0))
    bodies = plant_model(robot).nbody - 1
    episode = Episode(
        lambda _: np.zeros(3),
        EPISODE_S,
        seed=seed,
        sample=draw(randomisation_of(robot), rng.random, len(robot.joint_names), bodies),
        pushes=() if tips else (push,),
        get_up=GetUp(load_policy(policy, robot)),
        record=False,
    )
    run_episode(robot, load_policy("stand", robot), episode, drop)
    return drop.result


def main() -> None:
    """Drop and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("policy", help="name or path of the get-up policy")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--drops", type=int, default=100)
    parser.add_argument("--slope-deg", type=float, default=0.0, help="steepest slope of the ground")
    parser.add_argument("--tip", action="store_true", help="tip the robot over instead of pushing it")
    parser.add_argument("--within", type=float, default=4.0, help="longest time of a success, s")
    parser.add_argument("--seed", type=int, default=4711)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path, help="file for the results of each drop")
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.drops)
    with ProcessPoolExecutor(options.workers) as pool:
        drop = partial(run_drop, options.robot, options.policy, np.radians(options.slope_deg), options.tip)
        tried = list(pool.map(drop, seeds, chunksize=4))
    found = [r for r in tried if r.tilt_rad is not None]
    drops = len(found)
    print(f"{len(tried) - drops} of {len(tried)} ended before they were dropped")
    if not found:
        return
    times = np.array([np.inf if r.stood_s is None else r.stood_s for r in found])
    up = times <= options.within
    print(f"{options.policy}: {up.sum()} of {drops} stand within {options.within:g} s")
    for name, low, high in (("upright", 0.0, 0.8), ("on a side", 0.8, 2.3), ("on the back", 2.3, 3.2)):
        in_range = np.array([low <= (r.tilt_rad or 0.0) < high for r in found], dtype=bool)
        print(f"  {name}: {(up & in_range).sum()} of {in_range.sum()}")
    print("after RECOVERING:", dict(Counter(r.ended or "nothing" for r in found)))
    for fault, count in Counter(r.fault for r in found if r.fault).most_common():
        print(f"  {count}: {fault}")
    handed_over = sum(r.ended == Mode.STANDING and (r.ended_s or 0.0) <= options.within for r in found)
    print(f"STANDING, by the supervisor, within {options.within:g} s: {handed_over} of {drops}")
    quantiles = np.quantile(times[up], [0.5, 0.9, 1.0]) if up.any() else []
    print("time, s, median, 90 %, longest:", np.round(quantiles, 2))
    for name in ("energy_j", "torque_share", "impact_share", "speed_rad_s"):
        low, high = np.quantile([getattr(r, name) for r in found], [0.5, 0.9])
        print(f"{name}: median {low:.2f}, 90 % {high:.2f}")
    if options.json:
        options.json.write_text(json.dumps([vars(r) for r in tried]))


if __name__ == "__main__":
    main()
