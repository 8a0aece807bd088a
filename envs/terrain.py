"""The ground of episodes: flat, or pieces by kind and level of difficulty, and each robot's current piece.

Every episode has a piece of its own around the world's origin. Once a control step the physics gets, for each
foot point, the plane below it and the nearest edge of a step up.
"""

from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jax.tree_util import Partial

from footfall.common.errors import UserError
from footfall.common.rotations import heading, rotation_matrix
from footfall.envs.config import EnvConfig, TerrainConfig
from footfall.envs.ground import height_above_ground, in_contact
from footfall.envs.physics.engines import Engine
from footfall.envs.physics.interface import GROUND, Fields, Trace
from footfall.envs.state import State
from footfall.envs.terms.data import Scene, StepData
from footfall.robots.feet import foot_geoms
from footfall.terrain.declaration import pieces
from footfall.terrain.ground import UNREACHABLE_M, Ground, edge_at, height_at, tangent_at

KEY = "terrain"  # in `State.terms`
MIN_PATH_M = 1.0  # the level does not change after a shorter commanded path
TINY = 1e-9


class Terrain(Protocol):
    """The ground of an environment. All functions are pure."""

    def begin(self, state: State, key: jax.Array, previous: State | None) -> State:
        """The state of a new episode with its robot put on the ground.

        Args:
            state: state of a robot in its first pose on level ground.
            key: random key of JAX's random numbers.
            previous: the last state of this robot's previous episode; None for the first one.
        """

    def fields(self, state: State) -> Fields:
        """The physics' fields of the ground for the next control step."""

    def after_physics(self, state: State, trace: Trace) -> State:
        """The state after the physics of a control step."""

    def after_step(self, state: State, data: StepData) -> State:
        """The state at the end of a control step."""

    def metrics(self, state: State) -> dict[str, jax.Array]:
        """Metrics of the ground for a training's journal."""

    def with_feet(self, state: State, data: StepData) -> StepData:
        """The data with contact, clearance and tilt of the feet, from their positions."""

    def with_base(self, state: State, data: StepData) -> StepData:
        """The data with the base's position and its height above the ground."""


class LevelGround:
    """The floor at height 0."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def begin(self, state: State, key: jax.Array, previous: State | None) -> State:
        return state

    def fields(self, state: State) -> Fields:
        return {}

    def after_physics(self, state: State, trace: Trace) -> State:
        return state

    def after_step(self, state: State, data: StepData) -> State:
        return state

    def metrics(self, state: State) -> dict[str, jax.Array]:
        return {}

    def with_feet(self, state: State, data: StepData) -> StepData:
        feet = self._scene.feet
        clearance = feet.clearance(data.foot_position)
        tilt = feet.tilt(data.foot_position)
        return data._replace(contact=in_contact(clearance), clearance=clearance, foot_tilt=tilt)

    def with_base(self, state: State, data: StepData) -> StepData:
        base_position = self._scene.base.position(state.qpos)
        return data._replace(height=height_above_ground(base_position), base_position=base_position)


class Progress(NamedTuple):
    """Piece and progress of an episode's robot."""

    piece: jax.Array  # () index of the piece
    feet: jax.Array  # (points, 3) m, world, the feet's points after the last physics step
    ahead: jax.Array  # (points, 3) m, the same extrapolated to the middle of the next control step
    along: jax.Array  # () m, path along the commanded direction
    commanded: jax.Array  # () m, commanded path
    fell: jax.Array  # () 1.0 if a termination term ended the episode


class Pieces:
    """Pieces of ground at rising levels of difficulty; holds constants only."""

    def __init__(
        self, config: EnvConfig, terrain: TerrainConfig, model: mujoco.MjModel, scene: Scene
    ) -> None:
        """Raises UserError if a ground has an unknown parameter or a wrong value."""
        self._config, self._scene = terrain, scene
        built = pieces(terrain.grounds, terrain.levels, terrain.seed, "env.terrain.grounds")
        self._has_edges = bool(built.stepped.any())
        self._ground = Ground(
            jnp.asarray(built.heights, jnp.float32), jnp.asarray(built.stepped), built.cell_m
        )
        points = np.concatenate(foot_geoms(model, scene.robot.description))
        self._radius = jnp.asarray(model.geom_size[points, 0], dtype=jnp.float32)
        data = mujoco.MjData(model)
        data.qpos[:] = scene.standing
        mujoco.mj_kinematics(model, data)
        positions = data.geom_xpos[points] - scene.base.position(scene.standing)
        self._standing_points = jnp.asarray(positions, dtype=jnp.float32)  # (points, 3) m, from the base
        self._period_s, self._timestep_s = scene.period_s, config.timestep_s

    def begin(self, state: State, key: jax.Array, previous: State | None) -> State:
        u = jax.random.uniform(key, (4,))
        piece = self._first(u[:2]) if previous is None else self._next(_progress(previous), u[0])
        base, offset = self._scene.base, (2.0 * u[2:] - 1.0) * self._config.spread_m
        rotation = rotation_matrix(base.quaternion(state.qpos))
        feet = (base.position(state.qpos) + self._standing_points @ rotation.T).at[:, :2].add(offset)
        lift = jnp.max(height_at(self._ground, feet, piece))
        feet, zero = feet.at[:, 2].add(lift), jnp.float32(0.0)
        state = state._replace(qpos=base.shifted(state.qpos, jnp.append(offset, lift)))
        return _with_progress(state, Progress(piece, feet, feet, zero, zero, zero))

    def _first(self, u: jax.Array) -> jax.Array:
        """The piece of a first episode, at one of the lowest levels, from two uniform numbers."""
        kind, level = u * jnp.array([len(self._config.grounds), self._config.start_levels])
        return jnp.int32(kind) * self._config.levels + jnp.int32(level)

    def _next(self, progress: Progress, u: jax.Array) -> jax.Array:
        """The piece of the next episode: a level up, down or the same; past the top, a random level."""
        config, levels = self._config, self._config.levels
        kind, level = progress.piece // levels, progress.piece % levels
        share = progress.along / jnp.maximum(progress.commanded, TINY)
        path_is_long_enough = progress.commanded > MIN_PATH_M
        fell = progress.fell > 0.0
        level += jnp.int32(path_is_long_enough & (share >= config.up_share) & ~fell)
        level -= jnp.int32((path_is_long_enough & (share < config.down_share)) | fell)
        level = jnp.where(level >= levels, jnp.int32(u * levels), jnp.maximum(level, 0))
        return kind * levels + level

    def fields(self, state: State) -> Fields:
        progress = _progress(state)
        plane, edge = self._near(progress.ahead, progress.piece)
        return {GROUND: jnp.concatenate([plane, edge], axis=1) if self._has_edges else plane}

    def after_physics(self, state: State, trace: Trace) -> State:
        feet = trace.foot_position[-1]
        speed = (feet - trace.foot_position[-2]) / self._timestep_s
        ahead = feet + 0.5 * self._period_s * speed
        return _with_progress(state, _progress(state)._replace(feet=feet, ahead=ahead))

    def after_step(self, state: State, data: StepData) -> State:
        progress, command = _progress(state), data.command[:2]
        speed = jnp.linalg.norm(command)
        along = jnp.sum(command * data.linear_velocity[:2]) / jnp.maximum(speed, TINY)
        return _with_progress(
            state,
            progress._replace(
                along=progress.along + along * self._period_s,
                commanded=progress.commanded + speed * self._period_s,
                fell=data.fell,
            ),
        )

    def metrics(self, state: State) -> dict[str, jax.Array]:
        return {"terrain/level": jnp.float32(_progress(state).piece % self._config.levels)}

    def with_feet(self, state: State, data: StepData) -> StepData:
        progress, feet = _progress(state), self._scene.feet
        below = height_at(self._ground, progress.feet, progress.piece)
        return data._replace(
            contact=in_contact(feet.min_over_points(self._distance(progress))),
            clearance=feet.clearance(progress.feet, below),
            foot_tilt=feet.tilt(progress.feet, below),
        )

    def with_base(self, state: State, data: StepData) -> StepData:
        progress, base = _progress(state), self._scene.base
        base_position = base.position(state.qpos)
        yaw = heading(base.quaternion(state.qpos))
        return data._replace(
            height=base_position[2] - jnp.mean(height_at(self._ground, progress.feet, progress.piece)),
            base_position=base_position,
            forward=jnp.stack([jnp.cos(yaw), jnp.sin(yaw)]),
            ground=Partial(_height_on, self._ground, progress.piece),
        )

    def _distance(self, progress: Progress) -> jax.Array:
        """Distance of each foot point's sphere from the ground, m, (points,); below 0 in contact."""
        feet = progress.feet
        plane, edge = self._near(feet, progress.piece)
        to_plane = jnp.sum(plane[:, :3] * feet, axis=1) - plane[:, 3]
        # Distance from the edge's vertical face, and height above the step: negative inside the step.
        from_face = jnp.sum(edge[:, :2] * feet[:, :2], axis=1) - edge[:, 2]
        above = feet[:, 2] - edge[:, 3]
        outside = jnp.hypot(jnp.maximum(from_face, 0.0), jnp.maximum(above, 0.0))
        to_step = jnp.where(outside > 0.0, outside, jnp.maximum(from_face, above))
        return jnp.where(from_face > 0.0, jnp.minimum(to_plane, to_step), to_step) - self._radius

    def _near(self, points: jax.Array, piece: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Plane below points (points, 3), and edge near them, (points, 4) each, as in `interface.GROUND`."""
        height, slope = tangent_at(self._ground, points, piece)
        if self._has_edges:
            nearest = edge_at(self._ground, points, piece)
            height = jnp.where(self._ground.stepped[piece], nearest.low, height)
            edge = jnp.column_stack([nearest.normal, nearest.offset, nearest.high])
        else:
            edge = jnp.tile(jnp.array([1.0, 0.0, UNREACHABLE_M, UNREACHABLE_M]), (len(points), 1))
        normal = jnp.column_stack([-slope, jnp.ones(len(points))])
        normal = normal / jnp.linalg.norm(normal, axis=1, keepdims=True)
        on_ground = jnp.column_stack([points[:, :2], height])
        return jnp.column_stack([normal, jnp.sum(normal * on_ground, axis=1)]), edge


def make_terrain(config: EnvConfig, engine: Engine, model: mujoco.MjModel, scene: Scene) -> Terrain:
    """The ground of a configuration.

    Raises:
        UserError: a ground's settings are wrong, or this physics supports flat ground only.
    """
    if config.terrain is None:
        return LevelGround(scene)
    if engine.name != "generated":
        raise UserError(f"env.terrain needs physics 'generated', not '{engine.name}'. {engine.note}".strip())
    return Pieces(config, config.terrain, model, scene)


def _height_on(ground: Ground, piece: jax.Array, position: jax.Array) -> jax.Array:
    return height_at(ground, position, piece)


def _progress(state: State) -> Progress:
    progress: Progress = state.terms[KEY][KEY]
    return progress


def _with_progress(state: State, progress: Progress) -> State:
    terms: dict[str, Any] = state.terms | {KEY: {KEY: progress}}
    return state._replace(terms=terms)
