"""Made-up robots of two and five legs: estimator, walks, gaits, bus, loop, environment and contract."""

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml
from deploy_policies import short_episode
from made_up import BIPED, FIVE, PITCH, ROLL, SOLES, Hinge, Leg, quadruped_leg, six_hinge_leg, write_robot
from moments import under_load
from tiny_policy import write_network

from footfall import Policy, PolicyInput, Robot, Trace, load_policy, load_robot, run_episode
from footfall.common.config import unstructure
from footfall.common.rotations import heading
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.loop import ControlLoop
from footfall.envs.config import GaitConfig as EnvGait
from footfall.plant.robot import SimulatedRobot
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stand import Stand, StandConfig
from footfall.policies.controllers.step import Step
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import StanceConfig, WalkConfig
from footfall.policies.gaits import find_gait
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import observation_size
from footfall.policies.policy import Sensed

GO1, G1 = load_robot("go1"), load_robot("g1")


@pytest.fixture(scope="module")
def onnx() -> ModuleType:
    pytest.importorskip("jax")
    return pytest.importorskip("onnx")


def at_rest(robot: Robot) -> Sensed:
    """Readings of a robot in its default pose whose feet carry 40 N each."""
    return under_load(robot, np.tile([0.0, 0.0, 40.0], (robot.legs.count, 1)))


@pytest.mark.parametrize("kind", [FIVE, BIPED, SOLES])
def test_the_estimator_finds_a_standing_robot_at_rest(bodies: dict[str, Robot], kind: str) -> None:
    robot = bodies[kind]
    estimator = BaseEstimator(robot)
    estimator.reset(at_rest(robot))
    for _ in range(50):
        velocity, height = estimator.update(at_rest(robot), None, 0.002)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-6)
    assert height == pytest.approx(-robot.legs.default_foot[:, 2].mean(), abs=1e-3)


@pytest.mark.parametrize("kind", [BIPED, SOLES])
def test_a_walk_carries_standing_feet_back_and_lifts_others(bodies: dict[str, Robot], kind: str) -> None:
    """The lowest point of a sphere moves with the ground, its centre slower because it rolls."""
    robot = bodies[kind]
    height = -float(robot.legs.default_foot[:, 2].mean())
    config = controller_settings(GO1, "trot", WalkConfig)
    step, gait = replace(config.step, body_height_m=height + 0.01), GaitConfig("walk", 0.6, 0.6)
    policy = Walk(robot, "walk", replace(config, rate_hz=100.0, gait=gait, step=step, stance=StanceConfig()))

    def seen(time_s: float, command: float) -> PolicyInput:
        return PolicyInput(time_s, at_rest(robot), np.array([command, 0.0, 0.0]), np.zeros(3), height)

    policy.reset(seen(0.0, 0.0))
    commands = [policy.act(seen(1.0 + k / 100, 0.2)) for k in range(180)]
    assert np.shape(commands) == (180, 5, len(robot.joint_names))
    assert np.isfinite(commands).all()
    feet = np.array([robot.legs.pose(command.position).foot for command in commands])
    ground = feet[:, :, 2].min() + 1e-6
    down = (feet[1:, :, 2] < ground) & (feet[:-1, :, 2] < ground)
    speed = 100.0 * np.diff(feet[:, :, 0], axis=0)[100:][down[100:]]
    low, high = (-0.205, -0.195) if kind == SOLES else (-0.2, -0.17)
    assert low < speed.min() < speed.max() < high
    np.testing.assert_allclose(np.ptp(feet[100:, :, 2], axis=0), step.height_m, rtol=0.1)


TAIL = Leg(  # the fifth leg, in the middle plane behind
    "tail",
    (-0.2, 0.0, 0.0),
    (
        Hinge(ROLL, (-0.03, 0.0, -0.01), 0.0, (-0.9, 0.9)),
        Hinge(PITCH, (0.0, 0.0, -0.2), 0.8, (-0.6, 2.6)),
        Hinge(PITCH, (0.01, 0.0, -0.21), -1.5, (-2.7, -0.4)),
    ),
)
AHEAD = {"command_source": lambda _: np.array([0.2, 0.0, 0.0]), "seed": 1}
LEGS = [
    *(quadruped_leg("fl", 0.2, 0.1), quadruped_leg("fr", 0.2, -0.1), quadruped_leg("ml", -0.05, 0.12)),
    *(TAIL, quadruped_leg("mr", -0.05, -0.12)),
]


@pytest.fixture(scope="module")
def five(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A robot with settings for its only gait: go1's, scaled to its weight and height."""
    folder = tmp_path_factory.mktemp("five")
    made, like = write_robot(folder, LEGS), controller_settings(GO1, "walk", WalkConfig)
    step = replace(like.step, height_m=0.05, body_height_m=made.description.standing_height_m - 0.01)
    gait = GaitConfig("wave", 0.8)
    written = unstructure(replace(like, gait=gait, step=step, stance=StanceConfig(), weight_n=60.0))
    del written["touch_down"]
    (folder / "controllers.yaml").write_text(yaml.safe_dump({"wave": written}))
    return load_robot(folder)


def test_the_gait_has_one_foot_in_the_air_and_the_middle_foot_last(five: Robot) -> None:
    gait = find_gait("wave", five)
    order = np.argsort((gait.duty - gait.phase) % 1.0)
    assert [LEGS[k].name for k in order] == ["mr", "ml", "fr", "fl", "tail"]
    clock = np.arange(0.01, 1.0, 0.02)[:, None]
    assert (((clock + gait.phase) % 1.0 >= gait.duty).sum(axis=1) == 1).all()


def test_five_legs_track_the_command_over_the_bus(five: Robot) -> None:
    policy = load_policy("wave", five)
    assert isinstance(policy, Walk)
    assert policy.gaits == ("wave",)  # go1's other gaits do not fit five legs
    trace = run_episode(five, policy, short_episode(**AHEAD, duration_s=3.0))
    late = trace.time_s > 1.5
    walked = trace.base_position[-1] - trace.base_position[np.argmax(late)]
    assert (trace.final_state, trace.faults, trace.fell) == ("IDLE", (), False)
    assert walked[0] / (trace.time_s[-1] - 1.5) == pytest.approx(0.2, rel=0.1)
    assert abs(walked[1]) < 0.05 * walked[0] + 0.01
    assert abs(float(heading(trace.base_quaternion[-1]))) < 0.05
    assert len(trace.foot_contact[0]) == 5
    assert set(trace.foot_contact[late].sum(axis=1).tolist()) <= {3, 4, 5}


def test_the_contract_has_the_gait_and_the_policy_stands(
    five: Robot, onnx: ModuleType, tmp_path: Path
) -> None:
    from footfall.envs.locomotion import LocomotionEnv
    from footfall.train.config import load_preset

    preset, gait = load_preset("smoke", five).env, find_gait("wave", five)
    env = LocomotionEnv(five, replace(preset, physics="c", gait=EnvGait("wave", 1.5, 0.05)))
    contract = env.contract
    assert len(contract.joints) == 15
    phase = np.array(contract.gait.phase).reshape(5, 3)
    np.testing.assert_allclose((phase - phase[3]) % 1.0, np.tile((gait.phase % 1.0)[:, None], 3), atol=1e-12)
    size = observation_size(contract)
    assert env.observation_sizes["state"] == size
    path = write_network(onnx, tmp_path / "five.onnx", np.zeros((size, 15), np.float32), contract)
    trace = run_episode(five, LearnedPolicy(path, five), short_episode(duration_s=0.5))
    assert (trace.final_state, trace.faults, trace.fell) == ("IDLE", (), False)
    assert contract.mismatches(GO1) != []


@pytest.fixture(scope="module")
def biped(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Six hinges a leg and no arms."""
    return write_robot(tmp_path_factory.mktemp("six"), (six_hinge_leg("l", 0.09), six_hinge_leg("r", -0.09)))


def run(robot: Robot, policy: Policy, duration_s: float) -> Trace:
    """An episode ahead on the simulated bus, after which all motors are disabled."""
    bodies: list[SimulatedRobot] = []

    def watch(_: ControlLoop, body: SimulatedRobot) -> None:
        bodies[:] = [body]

    trace = run_episode(robot, policy, short_episode(**AHEAD, duration_s=duration_s), watch)
    assert not bodies[0].motors_on.any()
    return trace


def assert_falls_safely(robot: Robot, policy: Policy) -> None:
    """The robot falls and the supervisor ends the run: damped, then disabled."""
    trace = run(robot, policy, 3.0)
    assert (trace.final_state, trace.fell, len(trace.faults)) == ("FALLING", True, 1)
    assert trace.notes == ()  # each motor has answered that it is off
    assert 0.1 < trace.time_s[-1] < 2.5
    assert np.isfinite(trace.joint_target).all()


def test_a_biped_has_an_environment_and_falls_safely(biped: Robot, onnx: ModuleType, tmp_path: Path) -> None:
    """Contract, mirror image, environment, exported file, loop: compiled once for all of them."""
    import jax

    from footfall.envs.locomotion import LocomotionEnv
    from footfall.train.config import load_preset

    preset = load_preset("smoke", biped).env
    env = LocomotionEnv(biped, replace(preset, physics="c", gait=EnvGait("walk", 1.5, 0.05)))
    contract = env.contract
    assert contract.joints == tuple(f"{side}{k}" for side in "lr" for k in range(6))
    assert contract.gait is not None
    assert contract.gait.phase == (0.5,) * 6 + (0.0,) * 6
    assert (observation_size(contract), contract.mismatches(biped)) == (11 + 4 * 12, [])

    mirror = env.mirror()
    assert mirror.action.source.tolist() == [*range(6, 12), *range(6)]
    assert mirror.action.sign.tolist() == [-1, -1, 1, 1, 1, -1] * 2  # rolls and yaws are reversed
    state, observation = jax.jit(env.reset)(jax.random.PRNGKey(0))
    step, action = jax.jit(env.step), np.full(12, 0.1, np.float32)
    for _ in range(4):
        state, after = step(state, action)
        assert np.isfinite(after.reward)
        for part, size in env.observation_sizes.items():
            assert observation[part].shape == after.observation[part].shape == (size,)
            assert np.isfinite(after.observation[part]).all()
            assert len(mirror.observation[part].source) == size
    assert int(state.steps) == 4

    weights = np.random.default_rng(0).normal(scale=0.02, size=(59, 12)).astype(np.float32)
    policy = LearnedPolicy(write_network(onnx, tmp_path / "random.onnx", weights, contract), biped)
    assert policy.contract == contract
    assert_falls_safely(biped, policy)


def test_a_biped_without_ankles_cannot_stand_on_spheres_and_falls_safely(bodies: dict[str, Robot]) -> None:
    config = replace(controller_settings(G1, "stand", StandConfig), kp=150.0)
    assert_falls_safely(bodies[BIPED], Stand(bodies[BIPED], config))


def test_six_hinges_walk_over_the_bus_with_the_settings_of_g1(biped: Robot) -> None:
    trace = run(biped, Step(biped, controller_settings(G1, "step", StepConfig)), 2.7)
    assert (trace.final_state, trace.faults, trace.notes, trace.fell) == ("IDLE", (), (), False)
    assert (trace.foot_contact[:-1] & ~trace.foot_contact[1:]).sum() >= 3  # lift-offs
    assert trace.base_velocity[trace.time_s > 1.5].mean(axis=0)[:2] == pytest.approx([0.2, 0.0], abs=0.05)
