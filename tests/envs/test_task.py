"""Tasks made of terms: terms are found by the entries of a configuration, and may be a user's own."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import FEW_IN_C, ROBOT, SMOKE_IN_C
from refused import refusal_of

from footfall.envs.batch import step_batch
from footfall.envs.config import (
    CurriculumConfig,
    EventConfig,
    NamedTermConfig,
    ObservationConfig,
    RewardConfig,
)
from footfall.envs.make import make_environment, program_key
from footfall.envs.workarounds.program_cache import fingerprint

OWN = '''
from dataclasses import dataclass, replace
from typing import Annotated

import jax.numpy as jnp

from footfall.common.terms import Between
from footfall.domain_rand.distributions import Distribution
from footfall.envs.config import RewardConfig
from footfall.envs.terms.critic import critic_term
from footfall.envs.terms.events import event_term
from footfall.envs.locomotion import LocomotionEnv
from footfall.policies.observation import observation_term
from footfall.robots import kinds

@dataclass(frozen=True)
class AirTime:
    """Seconds for which each landing foot was in the air, minus a minimum."""

    min_s: Annotated[float, Between(0.0, 1.0)] = 0.1

    def init(self, data):
        return jnp.zeros_like(data.contact)

    def step(self, air_s, data):
        reward = jnp.sum(data.contact * (air_s - self.min_s))
        return (air_s + data.period_s) * (1.0 - data.contact), reward

def knees(data, *, share: float = 1.0):
    return share * jnp.sum(data.joint_position[2::3])

def crooked(data):
    return data.joint_position

def broken(data):
    return data.no_such_field

@observation_term(kinds.JOINTS)
def squares(inputs, contract, *, gain: float = 1.0):
    """Squared joint velocities."""
    return gain * inputs.readings["joint_velocity"] ** 2

@critic_term(kinds.FOOT_AMOUNTS)
def foot_speed(data):
    return data.foot_speed

def too_long(data, *, limit_s: float):
    return data.height > 100.0

@event_term(numbers=1, interval_s=Distribution(0.02, 0.02))
def hop(state, occasion, *, speed_m_s: float = 1.0):
    return state._replace(qvel=state.qvel.at[2].add(speed_m_s * occasion.strength))

@event_term(numbers=0)
def lifted(state, occasion):
    return state._replace(qpos=state.qpos.at[2].add(0.5))

def late(level, *, after: float = 0.5):
    return jnp.where(level < after, 0.0, 1.0)

def kneel(robot, config):
    return LocomotionEnv(robot, replace(config, rewards=(RewardConfig("alive", 2.0),), episode_s=0.5))

def nothing(robot, config):
    return object()
'''


@pytest.fixture(autouse=True)
def own_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's folder with a module `own_terms`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    path = tmp_path / "own_terms.py"
    path.write_text(OWN)
    yield path
    sys.modules.pop("own_terms", None)


def test_a_reward_with_a_state_of_its_own_counts_time_in_the_air() -> None:
    """The state restarts with the episode, differs between robots, and is kept in compiled programs."""
    entry = RewardConfig("own_terms:AirTime", 2.0, settings={"min_s": 0.05})
    env = make_environment(ROBOT, replace(FEW_IN_C, rewards=(entry,), episode_s=0.1, reward_floor=-1.0))
    state, _ = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(0), 3))
    high = state._replace(qpos=state.qpos.at[1, 2].set(2.0))  # the second robot is in the air
    step = jax.jit(lambda state: step_batch(env, state, jnp.zeros((3, 12))))
    for count in range(1, 5):
        high, _, last = step(high)
        air_s = np.asarray(high.terms["rewards"]["AirTime"])
        np.testing.assert_allclose(air_s[1], np.full(4, 0.02 * count), rtol=1e-5)
    assert np.asarray(last.metrics["reward/AirTime"]).shape == (3,)
    ended, _, last = step(high)
    assert np.asarray(last.truncated).tolist() == [1.0, 1.0, 1.0]
    np.testing.assert_array_equal(ended.terms["rewards"]["AirTime"], np.zeros((3, 4)))
    in_the_air = high.terms | {"rewards": {"AirTime": jnp.full((3, 4), 0.3)}}
    _, _, last = step(high._replace(qpos=state.qpos, terms=in_the_air))
    landed = np.asarray(last.metrics["reward/AirTime"]) / (2.0 * 0.25)
    np.testing.assert_allclose(landed, np.round(landed), atol=1e-4)  # feet, each 0.3 s minus 0.05 s
    assert landed.max() >= 2.0


def test_terms_of_every_kind_come_from_a_users_module() -> None:
    config = replace(
        FEW_IN_C,
        rewards=(RewardConfig("own_terms:knees", 1.0, settings={"share": 0.5}),),
        critic=(*FEW_IN_C.critic, NamedTermConfig("own_terms:foot_speed")),
        terminations=(NamedTermConfig("own_terms:too_long", settings={"limit_s": 1.0}),),
        events=(EventConfig("own_terms:lifted"), EventConfig("own_terms:hop")),
        curricula=(CurriculumConfig("own_terms:late", "hop", settings={"after": 0.3}),),
    )
    env, plain = make_environment(ROBOT, config), make_environment(ROBOT, FEW_IN_C)
    assert env.observation_sizes["privileged_state"] == plain.observation_sizes["privileged_state"] + 4
    reset, step, speeds = jax.jit(env.reset), jax.jit(env.step), []
    for level in (0.2, 0.4):  # below and above the level at which hops begin
        state, _ = reset(jax.random.PRNGKey(0), level)
        assert float(state.qpos[2]) == pytest.approx(ROBOT.description.standing_height_m + 0.5)
        waiting, _ = step(state, jnp.zeros(12))
        hopping, result = step(waiting, jnp.zeros(12))
        speeds.append(float(hopping.qvel[2]))
        knees = 0.5 * np.sum(np.asarray(hopping.qpos[7:])[2::3])
        assert float(result.metrics["reward/knees"]) == pytest.approx(knees, rel=1e-4)
    assert speeds[1] - speeds[0] == pytest.approx(1.0, rel=1e-4)


def test_a_users_task_makes_the_environment() -> None:
    env = make_environment(ROBOT, replace(SMOKE_IN_C, task="own_terms:kneel"))
    assert (env.episode_steps, env.config.weights) == (25, {"alive": 2.0})


def test_a_changed_term_changes_the_programs_fingerprint(own_module: Path) -> None:
    config = replace(SMOKE_IN_C, rewards=(RewardConfig("own_terms:knees", 1.0),))
    helper = own_module.with_name("own_helper.py")
    helper.write_text("")
    made = [fingerprint(program_key(ROBOT, config)) for _ in range(2)]
    own_module.write_text("import own_helper\n" + OWN.replace("[2::3]", "[1::3]"))
    sys.modules.pop("own_terms")
    made.append(fingerprint(program_key(ROBOT, config)))
    helper.write_text("GAIN = 2.0")  # what a term's module imports is part of the term
    made.append(fingerprint(program_key(ROBOT, config)))
    sys.modules.pop("own_helper")
    assert made[0] == made[1]
    assert len(set(made)) == 3


def test_the_refusal_of_a_term_names_its_entry() -> None:
    reward, named = SMOKE_IN_C.rewards[0], NamedTermConfig
    cases: list[tuple[dict[str, object], str]] = [
        *(
            ({"rewards": (RewardConfig(term, 1.0, settings=settings),)}, f"env.rewards[0]{words}")
            for term, settings, words in (
                ("track_linear", {"sigma": 1.0}, ".sigma"),
                ("alive", {"gain": 1.0}, ".gain"),
                ("track_linear", {"sigma_m2_s2": "wide"}, ".sigma_m2_s2"),
                ("track_linear", {"sigma_m2_s2": np.nan}, ".sigma_m2_s2"),
                ("swing_height", {"height_m": 80}, ".height_m: must be from"),
                ("own_terms:AirTime", {"min_s": -1.0}, ".min_s"),
                ("own_terms:crooked", {}, ": returns 12 numbers"),
                ("own_terms:broken", {}, ": AttributeError"),
                ("pose", {"joint_shares": {"*_toe": 1.0}}, ": joint_shares: "),
            )
        ),
        ({"rewards": (reward, RewardConfig("dance", 1.0))}, "env.rewards[1]: no reward 'dance'"),
        ({"rewards": (reward, reward)}, "env.rewards[1]"),
        ({"rewards": (RewardConfig("own_terms:absent", 1.0),)}, "own_terms:absent"),
        ({"rewards": (RewardConfig("no_such_module:x", 1.0),)}, "no module 'no_such_module'"),
        ({"terminations": (named("asleep"),)}, "env.terminations[0]: no termination 'asleep'"),
        ({"terminations": (named("own_terms:too_long"),)}, "env.terminations[0].limit_s"),
        ({"terminations": (named("tilted", settings={"limit_rad": 180}),)}, "env.terminations[0].limit_rad"),
        ({"critic": (named("mood"),)}, "env.critic[0]: no critic term 'mood'"),
        ({"critic": (named("own_terms:knees"),)}, "env.critic[0]"),
        ({"events": (EventConfig("own_terms:knees"),)}, "env.events[0]"),
        ({"events": (EventConfig("slope"),)}, "generated"),
        ({"events": (EventConfig("push", settings={"horizontal_m_s": -1.0}),)}, "[0].horizontal_m_s"),
        ({"curricula": (CurriculumConfig("linear", "wind"),)}, "env.curricula[0].of"),
        ({"curricula": (CurriculumConfig("linear", "push"),)}, "env.curricula[0].start"),
        ({"observation": (ObservationConfig("smell"),)}, "no observation term 'smell'"),
        ({"observation": (ObservationConfig("gyro", settings={"gain": 2.0}),)}, "env.observation[0].gain"),
        ({"task": "kneel"}, "env.task: 'kneel'"),
        ({"task": "own_terms:nothing"}, "env.task: own_terms:nothing"),
        ({"task": "own_terms:broken"}, "env.task: own_terms:broken"),
    ]
    for changes, words in cases:
        assert words in refusal_of(make_environment, ROBOT, replace(SMOKE_IN_C, **changes)), changes


def test_names_distinguish_two_entries_of_one_term() -> None:
    hips, knees = (
        RewardConfig("pose", -1.0, name=name, settings={"joint_shares": {f"*{name}*": 1.0, "*": 0.0}})
        for name in ("hip", "calf")
    )
    env = make_environment(ROBOT, replace(FEW_IN_C, rewards=(hips, knees)))
    state, _ = jax.eval_shape(env.reset, jax.random.PRNGKey(0))
    _, result = jax.eval_shape(env.step, state, jnp.zeros(12))
    assert {"reward/hip", "reward/calf"} <= set(result.metrics)
