"""Made-up bipeds from contract to bus: one without ankles, one with six hinges a leg and no arms."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from made_up import Leg, biped_leg, six_hinge_leg, write_robot
from tiny_policy import write_network

from footfall.deploy.loop import ControlLoop
from footfall.envs.config import GaitConfig
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.trace import Trace
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stand import Stand, StandConfig
from footfall.policies.controllers.step import Step
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import observation_size
from footfall.policies.policy import Policy
from footfall.robots.description import Robot, load_robot


class Case(NamedTuple):
    """A biped, and figures that follow from its hinges."""

    legs: tuple[Leg, Leg]
    mirror: tuple[float, ...]  # sign of each joint of a leg in the mirror image: rolls and yaws are reversed
    actor: int  # numbers that the actor sees with the preset `smoke`: 11, and 4 for each joint


CASES = {
    "no ankles": Case((biped_leg("l", 0.08), biped_leg("r", -0.08)), (-1, 1, 1), 35),
    "six hinges": Case((six_hinge_leg("l", 0.09), six_hinge_leg("r", -0.09)), (-1, -1, 1, 1, 1, -1), 59),
}


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    folder = tmp_path_factory.mktemp("bipeds")
    return {name: write_robot(folder / name, case.legs) for name, case in CASES.items()}


def test_a_made_up_biped_has_an_environment_and_falls_safely(
    robots: dict[str, Robot], tmp_path: Path
) -> None:
    """Contract, mirror image, environment, exported file, loop: compiled once for all of them."""
    onnx, jax = pytest.importorskip("onnx"), pytest.importorskip("jax")
    from footfall.envs.locomotion import LocomotionEnv
    from footfall.train.config import load_preset

    robot, case = robots["six hinges"], CASES["six hinges"]
    n = len(robot.joint_names)
    preset = load_preset("smoke", robot).env
    env = LocomotionEnv(robot, replace(preset, physics="c", gait=GaitConfig("walk", 1.5, 0.05)))
    contract = env.contract
    assert contract.joints == tuple(f"{side}{k}" for side in "lr" for k in range(n // 2))
    assert contract.gait is not None
    assert contract.gait.phase == (0.5,) * (n // 2) + (0.0,) * (n // 2)
    assert observation_size(contract) == case.actor
    assert contract.mismatches(robot) == []

    mirror = env.mirror()
    assert mirror.action.source.tolist() == [*range(n // 2, n), *range(n // 2)]
    assert mirror.action.sign.tolist() == [*case.mirror, *case.mirror]
    state, observation = jax.jit(env.reset)(jax.random.PRNGKey(0))
    step, action = jax.jit(env.step), np.full(n, 0.1, np.float32)
    for _ in range(4):
        state, after = step(state, action)
        assert np.isfinite(after.reward)
        for part, size in env.observation_sizes.items():
            assert observation[part].shape == after.observation[part].shape == (size,)
            assert np.isfinite(after.observation[part]).all()
            assert len(mirror.observation[part].source) == size
    assert int(state.steps) == 4

    weights = np.random.default_rng(0).normal(scale=0.02, size=(case.actor, n)).astype(np.float32)
    path = write_network(onnx, tmp_path / "random.onnx", weights, contract)
    policy = LearnedPolicy(path, robot)
    assert policy.contract == contract
    assert_falls_safely(robot, policy)


def test_without_ankles_it_cannot_stand_on_two_spheres_and_falls_safely(robots: dict[str, Robot]) -> None:
    robot = robots["no ankles"]
    config = controller_settings(load_robot("g1"), "stand", StandConfig)
    assert_falls_safely(robot, Stand(robot, replace(config, kp=150.0)))


def test_six_hinges_walk_over_the_bus_with_the_settings_of_g1(robots: dict[str, Robot]) -> None:
    robot = robots["six hinges"]
    policy = Step(robot, controller_settings(load_robot("g1"), "step", StepConfig))
    trace, motors_on = run(robot, policy, 2.7)
    assert (trace.final_state, trace.faults, trace.notes, trace.fell) == ("IDLE", (), (), False)
    lifted = trace.foot_contact[:-1] & ~trace.foot_contact[1:]
    assert lifted.sum() >= 3
    assert not motors_on.any()
    late = trace.time_s > 1.5
    assert trace.base_velocity[late].mean(axis=0)[:2] == pytest.approx([0.2, 0.0], abs=0.05)


def assert_falls_safely(robot: Robot, policy: Policy) -> None:
    """The robot falls and the supervisor ends the run: damped, then disabled."""
    trace, motors_on = run(robot, policy, 3.0)
    assert trace.final_state == "FALLING"
    assert trace.fell
    assert len(trace.faults) == 1
    assert trace.notes == ()  # each motor has answered that it is off
    assert 0.1 < trace.time_s[-1] < 2.5
    assert np.isfinite(trace.joint_target).all()
    assert not motors_on.any()


def run(robot: Robot, policy: Policy, duration_s: float) -> tuple[Trace, np.ndarray]:
    """An episode ahead on the simulated bus, and the motors that are enabled after it."""
    bodies: list[SimulatedRobot] = []

    def watch(_: ControlLoop, body: SimulatedRobot) -> None:
        bodies[:] = [body]

    trace = run_episode(
        robot, policy, Episode(lambda _: np.array([0.2, 0.0, 0.0]), duration_s, seed=1), watch
    )
    return trace, bodies[0].motors_on
