"""The hand-written controllers on the simulated robot."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from direct_plant import DirectPlant, Walk, walk

from footfall.common.rotations import tilt
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stand import Stand
from footfall.policies.controllers.walk import Walk as Generator
from footfall.policies.controllers.walk.config import WalkConfig
from footfall.policies.policy import Policy
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
Trot = partial(Generator, name="trot")
CONTROLLERS: list[Callable[..., Policy]] = [Stand, Trot, Mpc]


def go(
    policy: Policy, command: tuple[float, float, float], duration_s: float = 5.0, **kwargs: object
) -> Walk:
    return walk(
        policy,
        DirectPlant(ROBOT),
        lambda _: np.array(command),
        duration_s,
        BaseEstimator(ROBOT),
        **kwargs,  # type: ignore[arg-type]
    )


def tilted(
    policy: Generator,
    command: tuple[float, float, float],
    duration_s: float,
    change: Callable[[int], None] = lambda _: None,
) -> tuple[Walk, float]:
    """A walk by the true base velocity, and the largest tilt, rad; `change` is called with each tick."""
    tilts: list[float] = []

    def record(time_s: float, plant: DirectPlant) -> None:
        tilts.append(float(tilt(plant.data.qpos[3:7])))
        change(round(time_s * 500))

    result = walk(policy, DirectPlant(ROBOT), lambda _: np.array(command), duration_s, on_tick=record)
    return result, max(tilts)


def drift(result: Walk, after_s: float = 1.0) -> float:
    """Distance walked after a time, m."""
    return float(np.linalg.norm(result.position[-1] - result.position[int(after_s * 500)]))


class TestAll:
    @pytest.mark.parametrize("make", CONTROLLERS)
    def test_zero_command_means_stand_still(self, make: Callable[..., Policy]) -> None:
        result = go(make(ROBOT), (0.0, 0.0, 0.0), 2.0)
        assert not result.fell
        assert drift(result) < 0.02


class TestGaits:
    @pytest.mark.parametrize("gait", ["walk", "bound"])
    def test_every_gait_follows_the_command_with_a_level_body(self, gait: str) -> None:
        result, max_tilt_rad = tilted(Generator(ROBOT, gait), (0.4, 0.1, 0.2), 3.0)
        assert not result.fell
        np.testing.assert_allclose(result.mean_velocity(1.5), (0.4, 0.1, 0.2), atol=0.07)
        assert max_tilt_rad < 0.12

    def test_a_slow_walk_stays_on_its_feet(self) -> None:
        """Without sway, at 2 s per cycle, the body would tip towards the foot in the air.

        The robot walks backwards, which is harder for this order of the feet.
        """
        config = controller_settings(ROBOT, "walk", WalkConfig)
        policy = Generator(ROBOT, "walk", replace(config, gait=GaitConfig("walk", 2.0)))
        result, max_tilt_rad = tilted(policy, (-0.15, 0.0, 0.0), 6.5)
        assert not result.fell
        assert max_tilt_rad < 0.15
        np.testing.assert_allclose(result.mean_velocity(4.5), (-0.15, 0.0, 0.0), atol=0.035)  # over a cycle
        assert policy.notes == []

    def test_a_slow_trot_is_refused_and_the_robot_stands(self) -> None:
        config = controller_settings(ROBOT, "trot", WalkConfig)
        policy = Generator(ROBOT, "trot", replace(config, gait=GaitConfig("trot", 1.0)))
        result = walk(policy, DirectPlant(ROBOT), lambda _: np.array([0.3, 0.0, 0.0]), 2.0)
        assert drift(result) < 0.01
        (note,) = policy.notes
        assert note.startswith("trot: the robot does not walk, however short its strides are: the stability")
        assert note.endswith("a shorter gait.period_s, a larger gait.duty or more stance.sway would help")

    def test_gait_and_steps_change_while_walking(self) -> None:
        """Every second the controller gets another gait and other steps, at any phase.

        The robot neither falls nor stops.
        """
        policy = Generator(ROBOT, "trot")
        step = controller_settings(ROBOT, "trot", WalkConfig).step
        others = {
            500: (GaitConfig("walk", 0.5), replace(step, height_m=0.04)),
            1013: (GaitConfig("pace", 0.25, 0.55), replace(step, body_height_m=0.25)),
            1507: (GaitConfig("bound", 0.25, 0.6), replace(step, length_m=0.2)),
            2022: (GaitConfig("gallop", 0.25, 0.75), step),
            2531: (GaitConfig("trot", 0.4, 0.6), replace(step, height_m=0.08)),
        }
        result, max_tilt_rad = tilted(
            policy, (0.4, 0.0, 0.0), 6.0, lambda tick: policy.change(*others.get(tick, (None, None)))
        )
        assert not result.fell
        assert max_tilt_rad < 0.2
        speed = np.array(result.velocity)[600:, 0].reshape(-1, 300).mean(axis=1)
        assert speed.min() > 0.25
        np.testing.assert_allclose(result.mean_velocity(5.5)[0], 0.4, atol=0.05)


class TestMpc:
    def test_a_robot_stands_again_after_a_push(self) -> None:
        result = go(Mpc(ROBOT), (0.0, 0.0, 0.0), 4.0, push=(0.5, np.array([0.2, 0.8, 0.0])))
        assert not result.fell
        assert drift(result, after_s=3.5) < 0.01
