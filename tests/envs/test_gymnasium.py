"""The environment in gymnasium: registered names, gymnasium's contract, one environment and many."""

import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import jax
import mujoco
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv, VectorObservationWrapper, VectorWrapper
from gymnasium.wrappers import TransformObservation
from gymnasium.wrappers.vector import DictInfoToList, RecordEpisodeStatistics, VectorizeTransformObservation
from long_tests import long_test

import footfall.gym
from footfall.common.errors import UserError
from footfall.envs.camera import Camera
from footfall.envs.gymnasium_env import GymnasiumEnv, GymnasiumVectorEnv
from footfall.policies.observation import observation_size
from footfall.robots.description import Robot
from footfall.robots.model import plant_model

ID = "footfall/Go1Velocity-v0"
MANY = 8


@pytest.fixture(scope="module")
def one() -> Iterator[GymnasiumEnv]:
    env = gymnasium.make(ID, preset="smoke").unwrapped
    yield env
    env.close()


@pytest.fixture(scope="module")
def many() -> Iterator[GymnasiumVectorEnv]:
    env = gymnasium.make_vec(
        ID, num_envs=MANY, vectorization_mode="vector_entry_point", preset="smoke"
    ).unwrapped
    yield env
    env.close()


class TestOne:
    def test_it_keeps_gymnasiums_contract(self, one: GymnasiumEnv) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # These two are advice: joints differ in reach, and an observation has no bounds.
            warnings.filterwarnings("ignore", message=".*symmetric and normalized space.*")
            warnings.filterwarnings("ignore", message=".*Box observation space m.* value is.*infinity.*")
            check_env(one, skip_render_check=True)

    def test_a_fall_terminates_and_a_timeout_truncates(self, one: GymnasiumEnv) -> None:
        begun, _ = one.reset(seed=2)
        assert begun.shape == (observation_size(one.env.contract),)
        upside_down = one.state.qpos.at[2:7].set(np.array([0.4, 0.0, 1.0, 0.0, 0.0]))
        last = one.state.steps + one.env.episode_steps - 1
        for changes, ends in (
            ({}, (False, False)),
            ({"qpos": upside_down}, (True, False)),
            ({"steps": last}, (False, True)),
        ):
            one.reset(seed=2)
            one.state = one.state._replace(**changes)
            _, reward, terminated, truncated, info = one.step(np.zeros(12))
            assert (terminated, truncated) == ends
            assert np.isfinite([reward, info["linear_error_m_s"], info["yaw_error_rad_s"]]).all()

    def test_the_info_has_the_command_of_the_next_step(self, one: GymnasiumEnv) -> None:
        _, info = one.reset(seed=4)
        for _ in range(3):
            assert np.array_equal(info["command"], one.state.command)
            *_, info = one.step(np.zeros(12))

    def test_actions_reach_the_soft_limit_that_is_further_away(self, one: GymnasiumEnv) -> None:
        """With the largest action of either sign a joint's target lies at that limit or beyond it."""
        robot, bound = one.env.robot, one.action_space.high
        assert np.array_equal(one.action_space.low, -bound)
        reach = bound * robot.action_scale
        lower, upper = robot.soft_limits
        np.testing.assert_allclose(
            reach,
            np.where(
                upper - robot.default_pose > robot.default_pose - lower,
                upper - robot.default_pose,
                robot.default_pose - lower,
            ),
            rtol=1e-6,
        )

    def test_a_reset_with_options_is_refused(self, one: GymnasiumEnv, many: GymnasiumVectorEnv) -> None:
        with pytest.raises(UserError, match="no options: speed"):
            one.reset(options={"speed": 1})
        with pytest.raises(UserError, match="no options: reset_mask"):
            many.reset(options={"reset_mask": np.ones(MANY, bool)})

    def test_a_step_before_the_reset_is_refused(self) -> None:
        env = gymnasium.make(ID, preset="smoke").unwrapped
        with pytest.raises(gymnasium.error.ResetNeeded):
            env.step(np.zeros(12))

    @pytest.mark.filterwarnings("ignore:.*render mode")  # gymnasium's own advice
    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"preset": "none"}, "no preset 'none'"),
            ({"robot": "none"}, "no robot 'none'"),
            ({"render_mode": "human"}, "render mode"),
            ({"physics": "bullet"}, "no physics 'bullet'"),
        ],
    )
    def test_unknown_names_are_refused(self, options: dict[str, str], message: str) -> None:
        with pytest.raises(UserError, match=message):
            gymnasium.make(ID, **({"preset": "smoke"} | options))


class TestMany:
    def test_shapes_are_those_of_the_spaces(self, many: GymnasiumVectorEnv) -> None:
        observations, info = many.reset(seed=3)
        assert many.observation_space.contains(observations)
        assert info["command"].shape == (MANY, 3)
        observations, rewards, terminated, truncated, _ = many.step(many.action_space.sample() * 0.05)
        assert many.observation_space.contains(observations)
        assert rewards.shape == terminated.shape == truncated.shape == (MANY,)
        assert terminated.dtype == truncated.dtype == np.bool_

    def test_the_same_seed_gives_the_same_steps(self, many: GymnasiumVectorEnv) -> None:
        def rollout() -> list[object]:
            many.action_space.seed(5)
            return [many.reset(seed=4), *(many.step(many.action_space.sample()) for _ in range(60))]

        assert data_equivalence(rollout(), rollout(), exact=True)

    def test_each_is_the_single_environment_of_its_seed(
        self, many: GymnasiumVectorEnv, one: GymnasiumEnv
    ) -> None:
        observations, _ = many.reset(seed=10)
        alone, _ = one.reset(seed=10 + 3)
        assert observations[3] == pytest.approx(alone, abs=1e-6)
        for action in np.random.default_rng(0).uniform(-0.3, 0.3, (10, MANY, 12)):
            observations, rewards, *_ = many.step(action)
            alone, reward, *_ = one.step(action[3])
            assert observations[3] == pytest.approx(alone, abs=1e-4)
            assert rewards[3] == pytest.approx(reward, abs=1e-6)

    def test_the_second_reset_is_the_next_episode(self, many: GymnasiumVectorEnv, one: GymnasiumEnv) -> None:
        first, _ = many.reset(seed=5)
        second, _ = many.reset()
        assert (first != second).any(axis=1).all()
        for k in (0, MANY - 1):
            one.reset(seed=5 + k)
            assert second[k] == pytest.approx(one.reset()[0], abs=1e-6)

    def test_a_single_one_can_be_seeded(self, many: GymnasiumVectorEnv) -> None:
        first, _ = many.reset(seed=5)
        second, _ = many.reset()
        many.reset(seed=5)
        again, _ = many.reset(seed=[None, 6, *[None] * (MANY - 2)])  # 6 was the second's before
        assert np.array_equal(again[1], first[1])
        assert np.array_equal(np.delete(again, 1, axis=0), np.delete(second, 1, axis=0))

    @pytest.mark.parametrize("count", [0, 1, MANY + 1])
    def test_a_wrong_number_of_seeds_is_refused(self, many: GymnasiumVectorEnv, count: int) -> None:
        with pytest.raises(ValueError, match=f"{count} seeds for {MANY} environments"):
            many.reset(seed=list(range(count)))

    def test_an_ended_episode_is_reset_in_the_same_step(self, many: GymnasiumVectorEnv) -> None:
        assert many.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
        many.reset(seed=6)
        observations, ended, info = thrash(many)
        assert np.array_equal(info["_final_obs"], ended)
        for last, observation, end in zip(info["final_obs"], observations, ended, strict=True):
            assert last is None if not end else (last != observation).any()
        assert np.array_equal(np.asarray(many.state.steps) == 0, ended)

    def test_a_fall_terminates_and_a_timeout_truncates(self, many: GymnasiumVectorEnv) -> None:
        many.reset(seed=8)
        upside_down = many.state.qpos.at[0, 2:7].set(np.array([0.4, 0.0, 1.0, 0.0, 0.0]))
        at_its_end = many.state.steps.at[1].set(many.env.episode_steps - 1)
        many.state = many.state._replace(qpos=upside_down, steps=at_its_end)
        _, _, terminated, truncated, info = many.step(np.zeros((MANY, 12)))
        assert np.flatnonzero(terminated).tolist() == [0]
        assert np.flatnonzero(truncated).tolist() == [1]
        assert info["_final_obs"][1]
        assert info["final_obs"][1].shape == many.single_observation_space.shape

    @long_test
    def test_its_information_is_like_that_of_gymnasiums_own(self, many: GymnasiumVectorEnv) -> None:
        own = SyncVectorEnv(
            [lambda: gymnasium.make(ID, preset="smoke")] * MANY, autoreset_mode=AutoresetMode.SAME_STEP
        )
        both = [DictInfoToList(many), DictInfoToList(own)]
        infos = [env.reset(seed=6)[1] for env in both]
        assert alike(*infos)
        infos, ended = zip(*(thrash(env)[:0:-1] for env in both), strict=True)
        assert np.array_equal(*ended)
        for ours, theirs, end in zip(*infos, ended[0], strict=True):
            assert ours.keys() == theirs.keys()
            assert ("final_info" in ours) == ("final_obs" in ours) == end
            if end:  # the next episodes differ
                ours.pop("command"), theirs.pop("command")
            assert alike(ours, theirs)

    def test_gymnasiums_wrappers_accept_it(
        self, many: GymnasiumVectorEnv, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Gymnasium 1.4 refuses this mode at once, although the wrapper's step supports it.
        monkeypatch.setattr(VectorObservationWrapper, "__init__", VectorWrapper.__init__)
        shorter = {"func": lambda x: x[:7], "observation_space": Box(-np.inf, np.inf, (7,))}
        env = RecordEpisodeStatistics(VectorizeTransformObservation(many, TransformObservation, **shorter))
        assert env.reset(seed=6)[0].shape == (MANY, 7)
        observations, ended, info = thrash(env)
        assert observations.shape == (MANY, 7)
        assert all(info["final_obs"][k].shape == (7,) for k in np.flatnonzero(ended))
        assert np.array_equal(info["_episode"], ended)
        assert np.array_equal(info["episode"]["l"] > 0, ended)

    def test_one_and_many_environments_use_the_robots_own_files(self, own_folder: Path) -> None:
        (own_folder / "training.yaml").write_text("env: {episode_s: 7.0}")
        for made in (
            footfall.gym.make_single(own_folder, "smoke"),
            footfall.gym.make_vector(own_folder, 1, "smoke"),
        ):
            assert made.env.config.episode_s == 7.0
            assert made.env.config.physics == "generated"

    def test_no_environment_is_refused(self) -> None:
        with pytest.raises(UserError, match="num_envs must be at least 1"):
            footfall.gym.make_vector("go1", num_envs=0, preset="smoke")


def thrash(env: VectorEnv) -> tuple[np.ndarray, np.ndarray, Any]:
    """Step with large actions until some episodes have ended, but not all.

    Observations, which ended, information.
    """
    generator = np.random.default_rng(0)
    for _ in range(200):
        actions = 5 * generator.uniform(-1, 1, (MANY, 12))
        observations, _, terminated, truncated, info = env.step(actions)
        ended = terminated | truncated
        if isinstance(info, dict):
            assert ("final_obs" in info) == ended.any()
        if ended.any():
            break
    assert ended.any()
    assert not ended.all()
    return observations, ended, info


def alike(one: Any, other: Any) -> bool:
    """Whether two pieces of information have the same keys and equal numbers, except for rounding."""
    close = jax.tree.map(lambda a, b: np.allclose(a, b, atol=1e-3), one, other)
    return all(jax.tree.leaves(close))


PROBE = "import mujoco; mujoco.GLContext(8, 8).make_current()"
RENDER = """
import gymnasium
env = gymnasium.make("footfall.gym:footfall/Go1Velocity-v0", preset="smoke", render_mode="rgb_array")
env.reset(seed=0)
picture = env.render()
print(picture.shape, picture.dtype, picture.std() > 5)
"""


def test_it_renders() -> None:
    """In separate processes, because MuJoCo chooses a GL back end when it is imported."""
    for back_end in ("egl", "osmesa"):
        variables = os.environ | {"MUJOCO_GL": back_end, "PYOPENGL_PLATFORM": back_end}
        done = run(RENDER, variables)
        if done.returncode == 0:
            assert (done.stdout, done.stderr) == ("(320, 480, 3) uint8 True\n", "")
            return
        probe = run(PROBE, variables)
        assert probe.returncode, done.stderr  # it can be rendered here, but not by the environment
    pytest.skip(f"no offscreen rendering here: {probe.stderr.splitlines()[-1]}")


def test_without_rendering_the_error_names_the_variable_to_set(
    go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_screen(*_: Any) -> None:
        raise mujoco.FatalError("an OpenGL platform library has not been loaded")

    monkeypatch.setattr(mujoco, "Renderer", no_screen)
    with pytest.raises(UserError, match=r"MUJOCO_GL=egl .*platform library"):
        Camera(go1).picture(plant_model(go1).qpos0)


def run(code: str, variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
