"""A made-up robot of five legs: gait, generator, bus, loop, environment and contract."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_up import PITCH, ROLL, Hinge, Leg, quadruped_leg, write_robot
from tiny_policy import write_network

from footfall.common.config import unstructure
from footfall.common.rotations import heading
from footfall.envs.config import GaitConfig as EnvGait
from footfall.plant.episode import Episode, run_episode
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import StanceConfig, WalkConfig
from footfall.policies.gaits import find_gait
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import observation_size
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

TAIL = Leg(  # the fifth leg, in the middle plane behind
    "tail",
    (-0.2, 0.0, 0.0),
    (
        Hinge(ROLL, (-0.03, 0.0, -0.01), 0.0, (-0.9, 0.9)),
        Hinge(PITCH, (0.0, 0.0, -0.2), 0.8, (-0.6, 2.6)),
        Hinge(PITCH, (0.01, 0.0, -0.21), -1.5, (-2.7, -0.4)),
    ),
)
LEGS = [
    quadruped_leg("fl", 0.2, 0.1),
    quadruped_leg("fr", 0.2, -0.1),
    quadruped_leg("ml", -0.05, 0.12),
    TAIL,
    quadruped_leg("mr", -0.05, -0.12),
]
NAMES = [leg.name for leg in LEGS]


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A robot with settings for its only gait: go1's, scaled to its weight and height."""
    folder = tmp_path_factory.mktemp("five")
    made = write_robot(folder, LEGS)
    like = controller_settings(load_robot("go1"), "walk", WalkConfig)
    settings = replace(
        like,
        gait=GaitConfig("wave", 0.8),
        step=replace(like.step, height_m=0.05, body_height_m=made.description.standing_height_m - 0.01),
        stance=StanceConfig(),
        weight_n=60.0,
    )
    written = unstructure(settings)
    del written["touch_down"]
    (folder / "controllers.yaml").write_text(yaml.safe_dump({"wave": written}))
    return load_robot(folder)


def test_the_gait_has_one_foot_in_the_air_and_the_middle_foot_last(robot: Robot) -> None:
    gait = find_gait("wave", robot)
    begins = (gait.duty - gait.phase) % 1.0
    assert [NAMES[k] for k in np.argsort(begins)] == ["mr", "ml", "fr", "fl", "tail"]
    for clock in np.arange(0.01, 1.0, 0.02):
        assert ((clock + gait.phase) % 1.0 >= gait.duty).sum() == 1


def test_the_robot_tracks_the_command_over_the_bus(robot: Robot) -> None:
    policy = load_policy("wave", robot)
    assert isinstance(policy, Walk)
    assert policy.gaits == ("wave",)  # go1's other gaits do not fit five legs
    episode = Episode(lambda _: np.array([0.2, 0.0, 0.0]), 4.0, seed=1)
    trace = run_episode(robot, policy, episode)
    late = trace.time_s > 1.5
    walked = trace.base_position[-1] - trace.base_position[np.argmax(late)]
    assert not trace.fell
    assert (trace.final_state, trace.faults) == ("IDLE", ())
    assert walked[0] / (trace.time_s[-1] - 1.5) == pytest.approx(0.2, rel=0.1)
    assert abs(walked[1]) < 0.05 * walked[0] + 0.01
    assert abs(float(heading(trace.base_quaternion[-1]))) < 0.05
    assert len(trace.foot_contact[0]) == 5
    assert set(trace.foot_contact[late].sum(axis=1).tolist()) <= {3, 4, 5}


def test_the_training_contract_has_the_gait_and_the_policy_stands(robot: Robot, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("jax")
    from footfall.envs.locomotion import LocomotionEnv
    from footfall.train.config import load_preset

    preset = load_preset("smoke", robot).env
    env = LocomotionEnv(robot, replace(preset, physics="c", gait=EnvGait("wave", 1.5, 0.05)))
    contract = env.contract
    assert len(contract.joints) == 15
    phase = np.array(contract.gait.phase).reshape(5, 3)
    gait = find_gait("wave", robot)
    np.testing.assert_allclose((phase - phase[3]) % 1.0, np.tile((gait.phase % 1.0)[:, None], 3), atol=1e-12)
    size = observation_size(contract)
    assert env.observation_sizes["state"] == size
    path = write_network(onnx, tmp_path / "five.onnx", np.zeros((size, 15), np.float32), contract)
    policy = LearnedPolicy(path, robot)
    trace = run_episode(robot, policy, Episode(lambda _: np.zeros(3), 1.0))
    assert (trace.final_state, trace.faults, trace.fell) == ("IDLE", (), False)
    assert contract.mismatches(load_robot("go1")) != []
