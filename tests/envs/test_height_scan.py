"""Height scans in training equal the simulated robot's at the same position, and have a rate of their own."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.envs.config import ObservationConfig, TerrainConfig
from footfall.envs.height_scan import Scanner
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.state import State
from footfall.plant.height_scan import SimulatedScanner
from footfall.policies.height_scan import HeightScan
from footfall.robots.description import Robot
from footfall.terrain.declaration import GroundConfig, make_ground
from footfall.train.config import load_preset

SCAN = HeightScan()
STAIRS = GroundConfig("stairs", settings={"step_m": 0.12, "start_m": 0.4})


@pytest.fixture(scope="module")
def env(go1: Robot) -> LocomotionEnv:
    terms = (ObservationConfig("gyro", history=2), ObservationConfig("height_scan", 2.0))
    stairs = TerrainConfig((STAIRS,), levels=2, start_levels=1)
    return LocomotionEnv(go1, replace(load_preset("smoke", go1).env, observation=terms, terrain=stairs))


@pytest.fixture(scope="module")
def begun(env: LocomotionEnv) -> tuple[State, dict[str, jax.Array]]:
    """The states of four episodes on stairs."""
    return jax.jit(jax.vmap(env.reset))(jnp.stack([jax.random.PRNGKey(seed) for seed in range(4)]))


def test_training_and_the_plant_have_the_same_scans(
    begun: tuple[State, dict[str, jax.Array]],
) -> None:
    ground, (states, observation) = make_ground(STAIRS, 0), begun
    for qpos, seen in zip(np.asarray(states.qpos, float), np.asarray(observation["state"]), strict=True):
        plant = SimulatedScanner(SCAN, HeightScanErrors(), ground, lambda q=qpos: (q[:3], q[3:7]), 0)
        observed = seen[-SCAN.size - 1 : -1] / 2.0
        same = np.abs(observed - np.clip(plant.newest(0).heights, -1.0, 0.5)) < 1e-4
        assert same.mean() > 0.97  # in single precision a point may be on the other side of an edge
        assert np.ptp(observed) > 0.1


def test_the_critic_sees_the_exact_scan(
    env: LocomotionEnv, go1: Robot, begun: tuple[State, dict[str, jax.Array]]
) -> None:
    errors = HeightScanErrors(noise_m=0.1, lost_share=1.0, lost_before_s=0.0)
    blinded = LocomotionEnv(go1, replace(env.config, height_scan_errors=errors))
    _, observation = jax.jit(blinded.reset)(jax.random.PRNGKey(0))
    exact = {name: each[0] for name, each in begun[1].items()}
    actor, frame = 2 * 3 + SCAN.size + 1, 3 + SCAN.size + 1
    assert not np.asarray(observation["state"])[6:].any()
    for each in (observation, exact):
        seen = np.asarray(each["privileged_state"])[actor + 3 : actor + frame]
        assert np.ptp(seen[:-1]) > 0.2
        assert seen[-1] == 2.0


def test_scans_are_late_at_their_rate(env: LocomotionEnv, begun: tuple[State, dict[str, jax.Array]]) -> None:
    """On a slope along x the first height shows the robot's position at the time of the scan."""
    late = Scanner(SCAN, HeightScanErrors(lag_s=(0.05, 0.05)), env.scene.base, env.period_s)
    state = jax.tree.map(lambda leaf: leaf[0], begun[0])
    level = state.qpos.at[3:7].set(jnp.array([1.0, 0.0, 0.0, 0.0]))
    u, seen_at = jnp.full(late.numbers, 0.5), []
    for step in range(12):
        here = state._replace(qpos=level.at[0].set(0.01 * step), steps=jnp.int32(step))
        state, heights = late.deliver(here, lambda position: position[..., 0], u, is_reset=step == 0)
        seen_at.append(float(heights[0] + here.qpos[2] - SCAN.points[0, 0]) / 0.01)
    taken = np.maximum(0, 2 * ((np.arange(12) - 2.5) // 2)).astype(int)
    np.testing.assert_allclose(seen_at, taken, atol=1e-3)
