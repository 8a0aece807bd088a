"""The learned part of the joint law in training; tests/plant/test_motors.py compares the simulated robot."""

import jax
import jax.numpy as jnp
import pytest
from go1_smoke import IN_C, ROBOT
from some_net import with_net

from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.engines import make_engine
from footfall.robots.description import Robot
from footfall.robots.model import training_model


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return with_net(ROBOT, tmp_path_factory.mktemp("net") / "go1")


def test_a_net_moves_a_robot_in_training_and_each_episode_begins_at_rest(robot: Robot) -> None:
    moved = []
    for each in (ROBOT, robot):
        env = LocomotionEnv(each, IN_C)
        state = jax.jit(env.reset)(jax.random.PRNGKey(3))[0]
        moved.append(jax.jit(env.simulate)(state._replace(goals=state.goals + 0.2))[0])
    assert moved[0].net_memory is None
    assert jnp.abs(moved[1].net_memory).max() > 0.1
    assert jnp.abs(moved[1].qvel - moved[0].qvel).max() > 0.1
    assert not jax.jit(env.restart)(moved[1])[0].net_memory.any()


def test_the_generated_physics_refuses_a_net(robot: Robot) -> None:
    engine = make_engine("generated", training_model(robot), robot)
    assert engine.name != "generated"
    assert "actuator_net" in engine.note
