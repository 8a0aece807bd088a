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
from footfall.envs.config import EnvConfig, TerrainConfig
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
ROBOTS = 24


def terrain(kinds: list[dict[str, Any]], **changes: Any) -> TerrainConfig:
    return structure(
        {"grounds": kinds, "levels": LEVELS, "start_levels": LEVELS, **changes}, TerrainConfig, "env.terrain"
    )


def config_of(robot: Robot, **changes: Any) -> EnvConfig:
    return replace(load_preset("smoke", robot).env, randomisation=Randomisation(), **changes)


@pytest.fixture(scope="module")
def env(go1: Robot) -> Any:
    return make_environment(go1, config_of(go1, terrain=terrain(KINDS, exact_friction=True)))


@pytest.fixture(scope="module")
def begun(env: Any) -> State:
    state, _ = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(2), ROBOTS * len(KINDS)))
    return state


def walked(state: State) -> Any:
    return state.terms["terrain"]["terrain"]


@pytest.mark.parametrize("kind", [0, 1], ids=["stairs", "slope"])
def test_a_standing_robot_rests_as_on_mujocos_ground(env: Any, begun: State, go1: Robot, kind: int) -> None:
    """With constant joint targets, the robots' positions differ by millimetres after half a second."""
    hardest = np.flatnonzero(np.asarray(walked(begun).piece) == kind * LEVELS + LEVELS - 1)[:6]
    state = jax.tree.map(lambda x: x[hardest], jax.device_get(begun))
    spec = training_spec(go1, env.timestep_s, exact_friction=True)
    floor = spec.geom("floor")
    like_floor = {
        name: getattr(floor, name) for name in ("condim", "solmix", "friction", "contype", "conaffinity")
    }
    declared = structure(KINDS[kind], type(env.config.terrain.grounds[0]), "ground")
    replace_ground(spec, make_ground(at_difficulty(declared, 1.0), env.config.terrain.seed + LEVELS - 1))
    for geom in spec.worldbody.geoms:
        for name, value in like_floor.items():
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
    difference = np.abs(np.asarray(state.qpos - other.qpos)).max(axis=1)
    assert np.isfinite(np.asarray(state.qpos)).all()
    # MuJoCo's height fields hold a foot by several contacts.
    assert np.median(difference) < (0.005 if KINDS[kind]["shape"] in ("stairs", "blocks") else 0.02), (
        difference
    )


def test_success_leads_to_harder_ground(env: Any, begun: State) -> None:
    restart = jax.jit(jax.vmap(env.restart))

    def next_levels(level: int = 0, **progress: float) -> np.ndarray:
        """Levels of the episodes after these episodes of a level."""
        now = walked(begun)._replace(
            piece=jnp.full(len(begun.level), 2 + level),
            **{k: jnp.full(len(begun.level), v) for k, v in progress.items()},
        )
        after, _ = restart(begun._replace(terms=begun.terms | {"terrain": {"terrain": now}}))
        pieces = np.asarray(walked(after).piece)
        assert (pieces // LEVELS == 1).all()  # of the same kind
        return pieces % LEVELS

    assert (next_levels(along=4.5, commanded=5.0, fell=0.0) == 1).all()
    for progress in (
        {"along": 3.0, "commanded": 5.0, "fell": 0.0},
        {"along": 4.5, "commanded": 5.0, "fell": 1.0},
        {"along": 0.4, "commanded": 0.4, "fell": 0.0},
    ):
        assert (next_levels(**progress) == 0).all(), progress
    assert (next_levels(1, along=4.5, commanded=5.0, fell=1.0) == 0).all()


def test_untrainable_ground_is_refused(go1: Robot) -> None:
    with pytest.raises(UserError, match=r"env\.terrain .*'generated'"):
        make_environment(go1, config_of(go1, terrain=terrain(KINDS), physics="mjx"))
    refused = {
        "'hill'": {"kinds": [{"shape": "hill"}]},
        "start_levels": {"kinds": KINDS, "start_levels": 5},
        "size_m": {"kinds": [*KINDS, {"shape": "level", "size_m": 5.0}]},
    }
    for word, given in refused.items():
        with pytest.raises(UserError, match=word):
            terrain(**given)
    with pytest.raises(UserError, match=r"env.terrain.grounds\[0\].step_m"):
        make_environment(go1, config_of(go1, terrain=terrain([{"shape": "stairs", "step_m": [0.0, 5.0]}])))
