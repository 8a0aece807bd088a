"""The ground of episodes: flat, or pieces by kind and level of difficulty, and each robot's current piece.

Every episode has a piece of its own around the world's origin. Once a control step the physics gets, for each
foot point, the plane below it and the nearest edge of a higher level.
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

    def begin(self, state: State, key: jax.Array, before: State | None) -> State:
        """The state of a new episode with its robot put on the ground.

        Args:
            state: state of a robot in its first pose on level ground.
            key: random key of JAX's random numbers.
            before: the last state of this robot's previous episode; None for the first one.
        """

    def fields(self, state: State) -> Fields:
        """The physics' fields of the ground for the next control step."""

    def moved(self, state: State, trace: Trace) -> State:
        """The state after the physics of a control step."""

    def scored(self, state: State, data: StepData) -> State:
        """The state at the end of a control step."""

    def metrics(self, state: State) -> dict[str, jax.Array]:
        """Metrics of the ground for a training's journal."""

    def feet(self, state: State, data: StepData) -> StepData:
        """The data with contact, clearance and tilt of the feet, from their positions."""

    def base(self, state: State, data: StepData) -> StepData:
        """The data with the base's position and its height above the ground."""


class LevelGround:
    """The floor at height 0."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene

    def begin(self, state: State, key: jax.Array, before: State | None) -> State:
        return state

    def fields(self, state: State) -> Fields:
        return {}

    def moved(self, state: State, trace: Trace) -> State:
        return state

    def scored(self, state: State, data: StepData) -> State:
        return state

    def metrics(self, state: State) -> dict[str, jax.Array]:
        return {}

    def feet(self, state: State, data: StepData) -> StepData:
        feet = self._scene.feet
        clearance = feet.clearance(data.foot_position)
        tilt = feet.tilt(data.foot_position)
        return data._replace(contact=in_contact(clearance), clearance=clearance, foot_tilt=tilt)

    def base(self, state: State, data: StepData) -> StepData:
        base_position = self._scene.base.position(state.qpos)
        return data._replace(height=height_above_ground(base_position), base_position=base_position)


class Walked(NamedTuple):
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
        made = pieces(terrain.grounds, terrain.levels, terrain.seed, "env.terrain.grounds")
        self._has_edges = bool(made.stepped.any())
        self._ground = Ground(jnp.asarray(made.heights, jnp.float32), jnp.asarray(made.stepped), made.cell_m)
        points = np.concatenate(foot_geoms(model, scene.robot.description))
        self._radius = jnp.asarray(model.geom_size[points, 0], dtype=jnp.float32)
        data = mujoco.MjData(model)
        data.qpos[:] = scene.standing
        mujoco.mj_kinematics(model, data)
        positions = data.geom_xpos[points] - scene.base.position(scene.standing)
        self._standing = jnp.asarray(positions, dtype=jnp.float32)  # (points, 3) m, from the base
        self._period_s, self._timestep_s = scene.period_s, config.timestep_s

    def begin(self, state: State, key: jax.Array, before: State | None) -> State:
        u = jax.random.uniform(key, (4,))
        piece = self._first(u[:2]) if before is None else self._next(_walked(before), u[0])
        base, spread = self._scene.base, (2.0 * u[2:] - 1.0) * self._config.spread_m
        turn = rotation_matrix(base.quaternion(state.qpos))
        feet = (base.position(state.qpos) + self._standing @ turn.T).at[:, :2].add(spread)
        lift = jnp.max(height_at(self._ground, feet, piece))
        feet, nothing = feet.at[:, 2].add(lift), jnp.float32(0.0)
        state = state._replace(qpos=base.shifted(state.qpos, jnp.append(spread, lift)))
        return _with(state, Walked(piece, feet, feet, nothing, nothing, nothing))

    def _first(self, u: jax.Array) -> jax.Array:
        """The piece of a first episode, at one of the lowest levels, from two uniform numbers."""
        kind, level = u * jnp.array([len(self._config.grounds), self._config.start_levels])
        return jnp.int32(kind) * self._config.levels + jnp.int32(level)

    def _next(self, walked: Walked, u: jax.Array) -> jax.Array:
        """The piece of the next episode: a level up, down or the same; past the top, a random level."""
        config, levels = self._config, self._config.levels
        kind, level = walked.piece // levels, walked.piece % levels
        share, known = walked.along / jnp.maximum(walked.commanded, TINY), walked.commanded > MIN_PATH_M
        fell = walked.fell > 0.0
        level += jnp.int32(known & (share >= config.up_share) & ~fell)
        level -= jnp.int32((known & (share < config.down_share)) | fell)
        level = jnp.where(level >= levels, jnp.int32(u * levels), jnp.maximum(level, 0))
        return kind * levels + level

    def fields(self, state: State) -> Fields:
        walked = _walked(state)
        plane, level = self._near(walked.ahead, walked.piece)
        return {GROUND: jnp.concatenate([plane, level], axis=1) if self._has_edges else plane}

    def moved(self, state: State, trace: Trace) -> State:
        feet = trace.foot_position[-1]
        speed = (feet - trace.foot_position[-2]) / self._timestep_s
        ahead = feet + 0.5 * self._period_s * speed
        return _with(state, _walked(state)._replace(feet=feet, ahead=ahead))

    def scored(self, state: State, data: StepData) -> State:
        walked, command = _walked(state), data.command[:2]
        speed = jnp.linalg.norm(command)
        along = jnp.sum(command * data.linear_velocity[:2]) / jnp.maximum(speed, TINY)
        return _with(
            state,
            walked._replace(
                along=walked.along + along * self._period_s,
                commanded=walked.commanded + speed * self._period_s,
                fell=data.fell,
            ),
        )

    def metrics(self, state: State) -> dict[str, jax.Array]:
        return {"terrain/level": jnp.float32(_walked(state).piece % self._config.levels)}

    def feet(self, state: State, data: StepData) -> StepData:
        walked, feet = _walked(state), self._scene.feet
        below = height_at(self._ground, walked.feet, walked.piece)
        return data._replace(
            contact=in_contact(feet.nearest(self._distance(walked))),
            clearance=feet.clearance(walked.feet, below),
            foot_tilt=feet.tilt(walked.feet, below),
        )

    def base(self, state: State, data: StepData) -> StepData:
        walked, base = _walked(state), self._scene.base
        base_position = base.position(state.qpos)
        yaw = heading(base.quaternion(state.qpos))
        return data._replace(
            height=base_position[2] - jnp.mean(height_at(self._ground, walked.feet, walked.piece)),
            base_position=base_position,
            forward=jnp.stack([jnp.cos(yaw), jnp.sin(yaw)]),
            ground=Partial(_height_on, self._ground, walked.piece),
        )

    def _distance(self, walked: Walked) -> jax.Array:
        """Distance of each foot point's sphere from the ground, m, (points,); below 0 in contact."""
        feet = walked.feet
        plane, level = self._near(feet, walked.piece)
        to_plane = jnp.sum(plane[:, :3] * feet, axis=1) - plane[:, 3]
        away = jnp.sum(level[:, :2] * feet[:, :2], axis=1) - level[:, 2]
        above = feet[:, 2] - level[:, 3]
        outside = jnp.hypot(jnp.maximum(away, 0.0), jnp.maximum(above, 0.0))
        to_level = jnp.where(outside > 0.0, outside, jnp.maximum(away, above))
        return jnp.where(away > 0.0, jnp.minimum(to_plane, to_level), to_level) - self._radius

    def _near(self, points: jax.Array, piece: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Plane below points (points, 3), and edge near them, (points, 4) each, as in `interface.GROUND`."""
        height, slope = tangent_at(self._ground, points, piece)
        if self._has_edges:
            edge = edge_at(self._ground, points, piece)
            height = jnp.where(self._ground.stepped[piece], edge.low, height)
            level = jnp.column_stack([edge.away, edge.offset, edge.high])
        else:
            level = jnp.tile(jnp.array([1.0, 0.0, UNREACHABLE_M, UNREACHABLE_M]), (len(points), 1))
        normal = jnp.column_stack([-slope, jnp.ones(len(points))])
        normal = normal / jnp.linalg.norm(normal, axis=1, keepdims=True)
        below = jnp.column_stack([points[:, :2], height])
        return jnp.column_stack([normal, jnp.sum(normal * below, axis=1)]), level


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


def _walked(state: State) -> Walked:
    walked: Walked = state.terms[KEY][KEY]
    return walked


def _with(state: State, walked: Walked) -> State:
    kept: dict[str, Any] = state.terms | {KEY: {KEY: walked}}
    return state._replace(terms=kept)
