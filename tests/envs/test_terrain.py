"""Training on ground that is not level: robots rest on it as in MuJoCo C, and levels follow their success."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.config import structure
from footfall.common.errors import UserError
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.config import TerrainConfig
from footfall.envs.make import make_environment
from footfall.envs.physics.c import c_physics
from footfall.envs.physics.interface import Motion
from footfall.envs.state import State
from footfall.plant.ground import replace_ground
from footfall.robots.description import Robot
from footfall.robots.model import training_spec
from footfall.terrain.declaration import at_difficulty, make_ground
from footfall.train.config import load_preset

KINDS: list[dict[str, Any]] = [
    {"shape": "stairs", "step_m": [0.02, 0.14]},
    {"shape": "slope", "angle_deg": [0.0, 20.0]},
    {"shape": "blocks", "block_m": [0.0, 0.08]},
    {"shape": "rough", "roughness_m": [0.0, 0.05]},
]
LEVELS = 2


def terrain(kinds: list[dict[str, Any]], **changes: Any) -> TerrainConfig:
    fields = {"grounds": kinds, "levels": LEVELS, "start_levels": LEVELS, **changes}
    return structure(fields, TerrainConfig, "env.terrain")


def on_terrain(robot: Robot, ground: TerrainConfig, **changes: Any) -> Any:
    config = load_preset("smoke", robot).env
    return make_environment(robot, replace(config, randomisation=Randomisation(), terrain=ground, **changes))


@pytest.fixture(scope="module")
def env(go1: Robot) -> Any:
    return on_terrain(go1, terrain(KINDS, exact_friction=True))


@pytest.fixture(scope="module")
def begun(env: Any) -> State:
    return jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(2), 24 * len(KINDS)))[0]


def walked(state: State) -> Any:
    return state.terms["terrain"]["terrain"]


@pytest.mark.parametrize(("kind", "limit_m"), [(0, 0.005), (1, 0.02)], ids=["stairs", "slope"])
def test_a_standing_robot_rests_as_on_mujocos_ground(
    env: Any, begun: State, go1: Robot, kind: int, limit_m: float
) -> None:
    """With constant joint targets, the robots' positions differ by millimetres after half a second."""
    hardest = np.flatnonzero(np.asarray(walked(begun).piece) == kind * LEVELS + LEVELS - 1)[:6]
    state = jax.tree.map(lambda x: x[hardest], jax.device_get(begun))
    spec = training_spec(go1, env.timestep_s, exact_friction=True)
    like_floor = ("condim", "solmix", "friction", "contype", "conaffinity")
    floor = {name: getattr(spec.geom("floor"), name) for name in like_floor}
    declared = structure(KINDS[kind], type(env.config.terrain.grounds[0]), "ground")
    replace_ground(spec, make_ground(at_difficulty(declared, 1.0), env.config.terrain.seed + LEVELS - 1))
    for geom in spec.worldbody.geoms:
        for name, value in floor.items():
            setattr(geom, name, value)
    others = jax.vmap(c_physics(spec.compile(), go1))

    @jax.jit
    def both(state: State, other: Motion) -> tuple[State, Motion]:
        def drive(state: State) -> Any:
            targets = env.actuation.targets(state.goals, state.target, state.sample)
            return env.actuation.drive(targets, state.sample)

        after, trace = jax.vmap(env.simulate)(state)
        other, _ = others(other, jax.vmap(drive)(state), state.fields)
        return jax.vmap(env.terrain.after_physics)(after, trace), other

    other = Motion(state.qpos, state.qvel, state.qacc_warmstart)
    for _ in range(25):
        state, other = both(state, other)
    assert np.isfinite(np.asarray(state.qpos)).all()
    # MuJoCo's height fields hold a foot by several contacts.
    assert np.median(np.abs(np.asarray(state.qpos - other.qpos)).max(axis=1)) < limit_m


def test_success_leads_to_harder_ground(env: Any, begun: State) -> None:
    restart = jax.jit(jax.vmap(env.restart))

    for level, along, commanded, fell, next_level in (
        (0, 4.5, 5.0, 0.0, 1), (0, 3.0, 5.0, 0.0, 0), (0, 4.5, 5.0, 1.0, 0), (0, 0.4, 0.4, 0.0, 0),
        (1, 4.5, 5.0, 1.0, 0),
    ):  # fmt: skip
        now = {"piece": 2 + level, "along": along, "commanded": commanded, "fell": fell}
        ground = walked(begun)._replace(**{k: jnp.full(len(begun.level), v) for k, v in now.items()})
        after, _ = restart(begun._replace(terms=begun.terms | {"terrain": {"terrain": ground}}))
        pieces = np.asarray(walked(after).piece)
        assert (pieces // LEVELS == 1).all()  # of the same kind
        assert (pieces % LEVELS == next_level).all(), now


def test_untrainable_ground_is_refused(go1: Robot) -> None:
    with pytest.raises(UserError, match=r"env\.terrain .*'generated'"):
        on_terrain(go1, terrain(KINDS), physics="mjx")
    with pytest.raises(UserError, match=r"env.terrain.grounds\[0\].step_m"):
        on_terrain(go1, terrain([{"shape": "stairs", "step_m": [0.0, 5.0]}]))
    for word, kinds, changes in (
        ("'hill'", [{"shape": "hill"}], {}), ("start_levels", KINDS, {"start_levels": 5}),
        ("size_m", [*KINDS, {"shape": "level", "size_m": 5.0}], {}),
    ):  # fmt: skip
        with pytest.raises(UserError, match=word):
            terrain(kinds, **changes)
