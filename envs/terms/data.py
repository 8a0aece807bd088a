"""Inputs of terms: constants of the robot, and the data of one control step."""

from functools import cached_property
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.tree_util import Partial

from footfall.common.arrays import single
from footfall.envs.base import Base
from footfall.envs.body_points import BodyPoints
from footfall.envs.feet import Feet
from footfall.envs.ground import ground_height
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses


class Scene:
    """Constants of one robot in its training model. Terms read them; nothing changes them."""

    def __init__(self, model: mujoco.MjModel, robot: Robot, feet: Feet, period_s: float) -> None:
        self.robot, self.feet, self.period_s = robot, feet, period_s
        self.base = Base(model, robot)
        self.standing_height = robot.description.standing_height_m
        positions, dofs = joint_addresses(model, robot)
        self.positions, self.dofs = positions, dofs  # of joints in qpos, qvel
        self.bodies, self.nv = model.nbody - 1, model.nv  # number of bodies without the world
        self.default_pose = single(robot.default_pose)
        self.soft_lower, self.soft_upper = map(single, robot.soft_limits)
        self.peak_torque = single(robot.motor.peak_torque)
        qpos = np.array(model.qpos0, dtype=np.float32)
        qpos[positions] = robot.default_pose
        base_position = self.base.position(qpos)  # a view
        base_position[2] = ground_height(base_position) + self.standing_height
        self.standing = qpos  # (nq,) qpos in the default pose, feet on the ground

    @cached_property
    def body(self) -> BodyPoints:
        """Points on trunk and limbs, computed when a term reads them."""
        return BodyPoints(self.robot)


class StepData(NamedTuple):
    """The robot after one control step. Vectors in the body frame unless the comment says otherwise."""

    scene: Scene
    command: jax.Array  # (3,) forward m/s, leftward m/s, yaw rad/s
    moving: jax.Array  # () 1.0 if the command asks to move
    linear_velocity: jax.Array  # (3,) m/s
    angular_velocity: jax.Array  # (3,) rad/s
    gravity: jax.Array  # (3,) unit vector
    height: jax.Array  # () m, base above ground
    qpos: jax.Array  # (nq,) of the training model
    joint_position: jax.Array  # (n,) rad
    joint_velocity: jax.Array  # (n,) rad/s
    torque: jax.Array  # (n,) N m, motor torque at the last physics step
    actions: jax.Array  # (3, n) newest first
    foot_position: jax.Array  # (points, 3) m, world frame, centres of the feet's spheres, foot after foot
    contact: jax.Array  # (feet,) 1.0 in contact
    clearance: jax.Array  # (feet,) m above ground
    foot_speed: jax.Array  # (feet,) m/s, horizontal
    foot_tilt: jax.Array  # (feet,) m, height of a sole's highest point above its lowest; 0 for a sphere
    swing: jax.Array  # (feet,) planned swing, 0 in stance, rising to 1 at mid-swing
    fell: jax.Array  # () 1.0 if a termination term ended the episode
    base_position: jax.Array  # (3,) m, of the base, world frame
    forward: jax.Array  # (2,) horizontal unit vector along the base's heading, world frame
    ground: Partial  # from positions (..., 2) in the world to the ground's height, m, (...)

    @property
    def period_s(self) -> float:
        """Length of a control step, s."""
        return self.scene.period_s

    @property
    def depth(self) -> jax.Array:
        """How deep each point of `Scene.body` is in the ground, m, (points,); negative above it."""
        points = self.scene.body.points(self.qpos)
        return self.ground(points[:, :2]) + self.scene.body.radius - points[:, 2]


def level_ground(position: jax.Array) -> jax.Array:
    """Height of level ground at positions (..., 2), m, (...)."""
    return jnp.zeros_like(position[..., 0])


def example_data(scene: Scene) -> StepData:
    """Data of a robot that stands still, on which terms are checked."""
    n, feet = len(scene.robot.joint_names), scene.feet.count
    zeros: dict[str, Any] = {name: jnp.zeros(feet) for name in ("contact", "clearance", "foot_speed")}
    return StepData(
        scene=scene,
        command=jnp.zeros(3),
        moving=jnp.float32(0.0),
        linear_velocity=jnp.zeros(3),
        angular_velocity=jnp.zeros(3),
        gravity=jnp.array([0.0, 0.0, -1.0]),
        height=jnp.float32(scene.standing_height),
        qpos=jnp.asarray(scene.standing),
        joint_position=jnp.asarray(scene.default_pose),
        joint_velocity=jnp.zeros(n),
        torque=jnp.zeros(n),
        actions=jnp.zeros((3, n)),
        foot_position=jnp.zeros((scene.feet.point_count, 3)),
        foot_tilt=jnp.zeros(feet),
        swing=jnp.zeros(feet),
        fell=jnp.float32(0.0),
        base_position=jnp.array([0.0, 0.0, scene.standing_height]),
        forward=jnp.array([1.0, 0.0]),
        ground=Partial(level_ground),
        **zeros,
    )
