"""The environment in gymnasium: registered names, gymnasium's contract, one environment and many."""

import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.vector import AutoresetMode

import footfall.gym
from footfall.common.errors import UserError
from footfall.envs.gymnasium_env import GymnasiumEnv, GymnasiumVectorEnv, StepResult, vector_info
from footfall.policies.observation import observation_size

ID = "footfall/Go1Velocity-v0"
MANY = 8


@pytest.fixture(scope="module")
def one() -> Iterator[GymnasiumEnv]:
    env = gymnasium.make(ID, preset="smoke").unwrapped
    yield env
    env.close()


@pytest.fixture(scope="module")
def many() -> Iterator[GymnasiumVectorEnv]:
    mode = {"vectorization_mode": "vector_entry_point"}
    env = gymnasium.make_vec(ID, num_envs=MANY, preset="smoke", **mode).unwrapped
    yield env
    env.close()


class TestOne:
    def test_an_environment_keeps_gymnasiums_contract(self, one: GymnasiumEnv) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # Two warnings are only advice: ranges of actions differ, and observations have no bounds.
            warnings.filterwarnings("ignore", message=".*symmetric and normalized space.*")
            warnings.filterwarnings("ignore", message=".*Box observation space m.* value is.*infinity.*")
            check_env(one, skip_render_check=True)

    def test_a_fall_terminates_and_a_timeout_truncates(self, one: GymnasiumEnv) -> None:
        observation, _ = one.reset(seed=2)
        assert observation.shape == (observation_size(one.env.contract),)
        upside_down = {"qpos": one.state.qpos.at[2:7].set(np.array([0.4, 0.0, 1.0, 0.0, 0.0]))}
        last_step = {"steps": one.state.steps + one.env.episode_steps - 1}
        cases = ({}, (False, False)), (upside_down, (True, False)), (last_step, (False, True))
        for changes, flags in cases:
            one.reset(seed=2)
            one.state = one.state._replace(**changes)
            _, reward, terminated, truncated, info = one.step(np.zeros(12))
            assert (terminated, truncated) == flags
            assert np.isfinite([reward, info["linear_error_m_s"], info["yaw_error_rad_s"]]).all()

    def test_actions_reach_the_soft_limit_that_is_further_away(self, one: GymnasiumEnv) -> None:
        """With the largest action of either sign a joint's target lies at that limit or beyond it."""
        robot, bound = one.env.robot, one.action_space.high
        assert np.array_equal(one.action_space.low, -bound)
        lower, upper = robot.soft_limits
        further = np.maximum(upper - robot.default_pose, robot.default_pose - lower)
        np.testing.assert_allclose(bound * robot.action_scale, further, rtol=1e-6)

    @pytest.mark.filterwarnings("ignore:.*render mode")  # gymnasium's own advice
    def test_unknown_names_options_and_an_early_step_are_refused(self, one: GymnasiumEnv) -> None:
        named = {"preset": "none", "robot": "none", "render_mode": "human", "physics": "bullet"}
        for option, name in named.items():
            with pytest.raises(UserError, match=name):
                gymnasium.make(ID, **({"preset": "smoke"} | {option: name}))
        with pytest.raises(UserError, match="speed"):
            one.reset(options={"speed": 1})
        with pytest.raises(gymnasium.error.ResetNeeded):
            gymnasium.make(ID, preset="smoke").unwrapped.step(np.zeros(12))


class TestMany:
    def test_the_same_seed_gives_the_same_steps(self, many: GymnasiumVectorEnv) -> None:
        def rollout() -> list[object]:
            many.action_space.seed(5)
            return [many.reset(seed=4), *(many.step(many.action_space.sample()) for _ in range(60))]

        assert data_equivalence(rollout(), rollout(), exact=True)

    def test_each_of_many_equals_a_single_one(self, many: GymnasiumVectorEnv, one: GymnasiumEnv) -> None:
        observations, _ = many.reset(seed=10)
        alone, _ = one.reset(seed=10 + 3)
        assert observations[3] == pytest.approx(alone, abs=1e-6)
        for action in np.random.default_rng(0).uniform(-0.3, 0.3, (10, MANY, 12)):
            observations, rewards, *_ = many.step(action)
            alone, reward, *_ = one.step(action[3])
            assert observations[3] == pytest.approx(alone, abs=1e-4)
            assert rewards[3] == pytest.approx(reward, abs=1e-6)

    def test_options_and_wrong_counts_are_refused(self, many: GymnasiumVectorEnv) -> None:
        with pytest.raises(UserError, match="reset_mask"):
            many.reset(options={"reset_mask": np.ones(MANY, bool)})
        for count in (0, 1, MANY + 1):
            with pytest.raises(ValueError, match=str(count)):
                many.reset(seed=list(range(count)))
        with pytest.raises(UserError, match="num_envs"):
            footfall.gym.make_vector("go1", num_envs=0, preset="smoke")

    def test_an_ended_episode_is_reset_in_the_same_step(self, many: GymnasiumVectorEnv) -> None:
        assert many.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
        observations, info = many.reset(seed=6)
        assert many.observation_space.contains(observations)
        assert info["command"].shape == (MANY, 3)
        for actions in np.random.default_rng(0).uniform(-5, 5, (200, MANY, 12)):
            observations, rewards, terminated, truncated, info = many.step(actions)
            ended = terminated | truncated
            assert ("final_obs" in info) == ended.any()
            if ended.any():
                break
        assert 0 < ended.sum() < MANY
        assert many.observation_space.contains(observations)
        assert rewards.shape == terminated.shape == truncated.shape == (MANY,)
        assert terminated.dtype == truncated.dtype == np.bool_
        assert np.array_equal(info["_final_obs"], ended)
        for last, observation, end in zip(info["final_obs"], observations, ended, strict=True):
            assert last is None if not end else (last != observation).any()
        assert np.array_equal(np.asarray(many.state.steps) == 0, ended)

    def test_one_and_many_environments_use_the_robots_own_files(self, own_folder: Path) -> None:
        (own_folder / "training.yaml").write_text("env: {episode_s: 7.0}")
        single, vector = footfall.gym.make_single, footfall.gym.make_vector
        for made in (single(own_folder, "smoke"), vector(own_folder, 1, "smoke")):
            assert (made.env.config.episode_s, made.env.config.physics) == (7.0, "generated")


def test_information_covers_running_and_ended_episodes() -> None:
    last = StepResult(
        np.arange(6.0).reshape(3, 2), np.zeros(3), np.array([False, True, False]),
        np.array([False, False, True]),
        {"command": np.arange(9.0).reshape(3, 3), "error": np.array([0.1, 0.2, 0.3])},
    )  # fmt: skip
    info = vector_info(last, 100 + np.arange(9.0).reshape(3, 3))
    ended, final = [False, True, True], info["final_info"]
    for found, expected in (
        (info["command"], 100 + np.arange(9.0).reshape(3, 3)), (info["_command"], [True] * 3),
        (info["error"], [0.1, 0.0, 0.0]), (info["_error"], [True, False, False]),
        (info["_final_obs"], ended), (info["_final_info"], ended), (final["error"], [0.0, 0.2, 0.3]),
        (final["command"], [[0.0] * 3, [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]),
    ):  # fmt: skip
        np.testing.assert_array_equal(found, expected)
    assert info["final_obs"][0] is None
    assert [row.tolist() for row in info["final_obs"][1:]] == [[2.0, 3.0], [4.0, 5.0]]
    none_ended = last._replace(terminated=np.zeros(3, bool), truncated=np.zeros(3, bool))
    assert set(vector_info(none_ended, last.info["command"])) == {"command", "_command", "error", "_error"}


PROBE = "import mujoco; mujoco.GLContext(8, 8).make_current()"
RENDER = """
import gymnasium
env = gymnasium.make("footfall.gym:footfall/Go1Velocity-v0", preset="smoke", render_mode="rgb_array")
env.reset(seed=0)
picture = env.render()
print(picture.shape, picture.dtype, picture.std() > 5)
"""


def test_a_picture_is_rendered() -> None:
    """Each picture has its own process, because MuJoCo chooses a GL back end when it is imported."""
    options: Any = {"capture_output": True, "text": True}
    for back_end in ("egl", "osmesa"):
        variables = os.environ | {"MUJOCO_GL": back_end, "PYOPENGL_PLATFORM": back_end}
        rendering = subprocess.run([sys.executable, "-c", RENDER], env=variables, check=False, **options)
        if rendering.returncode == 0:
            assert (rendering.stdout, rendering.stderr) == ("(320, 480, 3) uint8 True\n", "")
            return
        probe = subprocess.run([sys.executable, "-c", PROBE], env=variables, check=False, **options)
        assert probe.returncode, rendering.stderr  # if MuJoCo can draw here, the environment must render
    pytest.skip(f"no offscreen rendering here: {probe.stderr.splitlines()[-1]}")
