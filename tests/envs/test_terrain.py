"""Training on ground that is not level: contact as in MuJoCo C, levels that follow success, height scans.

Height scans equal the simulated robot's at the same position, and have a rate of their own.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import FEW_TERMS, SMOKE

from footfall.common.config import structure
from footfall.common.errors import UserError
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.envs.config import ObservationConfig, TerrainConfig
from footfall.envs.height_scan import Scanner
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.make import make_environment
from footfall.envs.physics.c import c_physics
from footfall.envs.physics.interface import Motion
from footfall.envs.state import State
from footfall.plant.ground import replace_ground
from footfall.plant.height_scan import SimulatedScanner
from footfall.policies.height_scan import HeightScan
from footfall.robots.description import Robot
from footfall.robots.model import training_spec
from footfall.terrain.declaration import GroundConfig, at_difficulty, make_ground

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
    return make_environment(robot, replace(SMOKE, **FEW_TERMS | changes, terrain=ground))


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


SCAN = HeightScan()
STAIRS = GroundConfig("stairs", settings={"step_m": 0.12, "start_m": 0.4})
Scanned = tuple[State, dict[str, jax.Array]]


@pytest.fixture(scope="module")
def scanning(go1: Robot) -> LocomotionEnv:
    terms = (ObservationConfig("gyro", history=2), ObservationConfig("height_scan", 2.0))
    stairs = TerrainConfig((STAIRS,), levels=2, start_levels=1)
    return LocomotionEnv(go1, replace(SMOKE, **FEW_TERMS | {"observation": terms, "terrain": stairs}))


@pytest.fixture(scope="module")
def scanned(scanning: LocomotionEnv) -> Scanned:
    """The states of four episodes on stairs."""
    return jax.jit(jax.vmap(scanning.reset))(jnp.stack([jax.random.PRNGKey(seed) for seed in range(4)]))


def test_training_and_the_plant_have_the_same_scans(scanned: Scanned) -> None:
    ground, (states, observation) = make_ground(STAIRS, 0), scanned
    for qpos, seen in zip(np.asarray(states.qpos, float), np.asarray(observation["state"]), strict=True):
        plant = SimulatedScanner(SCAN, HeightScanErrors(), ground, lambda q=qpos: (q[:3], q[3:7]), 0)
        observed = seen[-SCAN.size - 1 : -1] / 2.0
        same = np.abs(observed - np.clip(plant.newest(0).heights, -1.0, 0.5)) < 1e-4
        assert same.mean() > 0.97  # in single precision a point may be on the other side of an edge
        assert np.ptp(observed) > 0.1


def test_the_critic_sees_the_exact_scan(scanning: LocomotionEnv, go1: Robot, scanned: Scanned) -> None:
    errors = HeightScanErrors(noise_m=0.1, lost_share=1.0, lost_before_s=0.0)
    blinded = LocomotionEnv(go1, replace(scanning.config, height_scan_errors=errors))
    _, observation = jax.jit(blinded.reset)(jax.random.PRNGKey(0))
    exact = {name: each[0] for name, each in scanned[1].items()}
    actor, frame = 2 * 3 + SCAN.size + 1, 3 + SCAN.size + 1
    assert not np.asarray(observation["state"])[6:].any()
    for each in (observation, exact):
        seen = np.asarray(each["privileged_state"])[actor + 3 : actor + frame]
        assert np.ptp(seen[:-1]) > 0.2
        assert seen[-1] == 2.0


def test_scans_are_late_at_their_rate(scanning: LocomotionEnv, scanned: Scanned) -> None:
    """On a slope along x the first height shows the robot's position at the time of the scan."""
    late = Scanner(SCAN, HeightScanErrors(lag_s=(0.05, 0.05)), scanning.scene.base, scanning.period_s)
    state = jax.tree.map(lambda leaf: leaf[0], scanned[0])
    level = state.qpos.at[3:7].set(jnp.array([1.0, 0.0, 0.0, 0.0]))
    u, seen_at = jnp.full(late.numbers, 0.5), []

    @partial(jax.jit, static_argnums=1)
    def deliver(state: State, is_reset: bool) -> tuple[State, jax.Array]:
        return late.deliver(state, lambda position: position[..., 0], u, is_reset=is_reset)

    for step in range(12):
        here = state._replace(qpos=level.at[0].set(0.01 * step), steps=jnp.int32(step))
        state, heights = deliver(here, step == 0)
        seen_at.append(float(heights[0] + here.qpos[2] - SCAN.points[0, 0]) / 0.01)
    taken = np.maximum(0, 2 * ((np.arange(12) - 2.5) // 2)).astype(int)
    np.testing.assert_allclose(seen_at, taken, atol=1e-3)
