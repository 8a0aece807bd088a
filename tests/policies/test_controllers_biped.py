"""Balancing and stepping on soles: the joint law, noisy readings, MuJoCo, no bus."""

from functools import partial

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.plant.episode import Episode, run_episode
from footfall.policies.controllers.balance import Balance
from footfall.policies.controllers.solver import BoundedSolver, QuadraticProgram
from footfall.policies.controllers.step import Step
from footfall.policies.controllers.step.footwork import Phase
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

G1 = load_robot("g1")
STILL = np.zeros(3)


def hold(command: tuple[float, float, float], _: float) -> np.ndarray:
    return np.array(command)


STANDING = partial(hold, (0.0, 0.0, 0.0))


def test_step_refuses_a_robot_of_four_feet() -> None:
    settings = load_policy("step", G1)._config  # type: ignore[attr-defined]
    with pytest.raises(UserError, match="go1"):
        Step(load_robot("go1"), settings)


def test_a_small_push_is_balanced_without_a_step() -> None:
    policy, plant = Balance(G1), DirectPlant(G1, seed=3)
    result = walk(policy, plant, STANDING, 2.5, push=(0.6, np.array([-0.15, -0.15, 0.0])))
    assert not result.fell
    assert policy.control.unsolved_ticks == 0
    moved = np.linalg.norm(np.array(result.position) - result.position[0], axis=1)
    assert moved.max() > 0.015
    assert moved[-1] < 0.02
    assert np.linalg.norm(result.velocity[-1]) < 0.05


class Missing(BoundedSolver):
    """A solver without a solution for a number of ticks, after the first hundred."""

    def __init__(self, ticks: int) -> None:
        super().__init__()
        self._ticks, self._count = ticks, 0

    def solve(self, problem: QuadraticProgram) -> np.ndarray | None:
        self._count += 1
        return None if 100 < self._count <= 100 + self._ticks else super().solve(problem)


class TestTicksWithoutSolution:
    def test_a_run_without_a_solution_ends_damped_with_its_reason(self) -> None:
        policy = Balance(G1)
        policy.control.solver = Missing(ticks=1000)
        trace = run_episode(G1, policy, Episode(command_source=STANDING, duration_s=0.6))
        assert trace.final_state == "ESTOP"
        assert "0.1 s" in trace.faults[0]


class TestStep:
    def test_a_biped_walks_as_commanded(self) -> None:
        policy, plant = Step(G1), DirectPlant(G1, seed=2)
        result = walk(policy, plant, partial(hold, (0.2, 0.0, 0.3)), 3.7)
        assert not result.fell
        assert policy.footwork.steps >= 5
        assert policy.control.unsolved_ticks == 0
        forward, _, yaw_rate = result.mean_velocity(after_s=1.5)
        assert forward == pytest.approx(0.2, abs=0.06)
        assert yaw_rate == pytest.approx(0.3, abs=0.08)

    def test_after_a_push_a_biped_steps_and_then_stands(self) -> None:
        policy, plant = Step(G1), DirectPlant(G1, seed=4)
        shove = (0.8, np.array([-0.37, 0.15, 0.0]))
        result = walk(policy, plant, STANDING, 3.0, BaseEstimator(G1), shove)
        assert not result.fell
        assert 1 <= policy.footwork.steps <= 4
        assert policy.footwork.phase is Phase.STAND
        assert np.linalg.norm(result.velocity[-1][:2]) < 0.1

    def test_after_a_harder_push_a_biped_steps_before_the_weight_has_shifted(self) -> None:
        policy, plant = Step(G1), DirectPlant(G1, seed=4)
        lifted: list[float] = []

        def record(time_s: float, _: DirectPlant) -> None:
            if policy.footwork.steps and not lifted:
                lifted.append(time_s)

        shove = (0.8, np.array([0.5, 0.0, 0.0]))
        assert not walk(policy, plant, STANDING, 2.0, push=shove, on_tick=record).fell
        assert lifted[0] < 0.8 + 0.1

    def test_a_turn_across_a_heading_of_pi_gives_the_same_swing(self) -> None:
        """A turn across pi gives the same commands as a quarter of a circle earlier.

        The other heading differs by a quarter of a circle, because friction pyramids are square. The joints
        stand still, toes outwards; the test turns the body.
        """
        over_half_a_circle, earlier = self.turned(np.pi - 1.5), self.turned(np.pi / 2 - 1.5)
        np.testing.assert_allclose(over_half_a_circle, earlier, atol=1e-4)

    @staticmethod
    def turned(heading: float) -> np.ndarray:
        """The commands (ticks, 5, n) while the body turns from a heading at 1 rad/s."""
        policy, commands = Step(G1), []
        toes_out = G1.default_pose.copy()
        for side, angle in (("left", 0.15), ("right", -0.15)):
            toes_out[G1.joint_names.index(f"{side}_hip_yaw_joint")] = angle
        for time_s in np.arange(0.0, 2.1, 1.0 / policy.rate_hz):
            turn, spin = Rotation.from_euler("z", heading + time_s), (0.0, 0.0, 1.0)
            found = {"turn": turn, "gyro": spin, "joint": toes_out}
            seen = policy_input(G1, float(time_s), spin, STILL, G1.description.standing_height_m, **found)
            if time_s == 0.0:
                policy.reset(seen)
            commands.append(np.array(policy.act(seen)))
        assert policy.footwork.phase is Phase.STEP
        return np.array(commands)
