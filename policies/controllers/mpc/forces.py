"""Planned wrenches of the feet in stance."""

from collections import deque

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.mpc.wrenches import Wrenches, sole_levers
from footfall.policies.controllers.solver import BoundedSolver
from footfall.robots.description import Robot
from footfall.robots.rigid_body import RigidBody

_TIMINGS_KEPT = 100_000


class ForcePlanner:
    """Solves for the wrenches of the feet that move the body along its reference.

    Attributes:
        wrenches: wrench of each foot in the first step of the last plan, world.
        solve_ms: duration of each plan.
    """

    def __init__(self, robot: Robot, body: RigidBody, config: MpcConfig) -> None:
        sole = config.contact.sole_share
        levers = sole_levers(robot, sole) if sole else None
        self.problems = ForceProblems(body, config.horizon, config.weights, config.contact, levers)
        self.solver = BoundedSolver()
        self.solve_ms: deque[float] = deque(maxlen=_TIMINGS_KEPT)
        self._weight_n, self._feet = body.mass * GRAVITY_M_S2, robot.legs.count
        self.reset()

    def reset(self) -> None:
        """Start with the weight shared by all feet."""
        weight = [0.0, 0.0, self._weight_n / self._feet]
        self.wrenches = Wrenches(np.tile(weight, (self._feet, 1)), np.zeros((self._feet, 3)))

    def plan(
        self,
        state: BodyState,
        reference: BodyState,
        contacts: np.ndarray,
        arms: np.ndarray,
        to_heading: np.ndarray,
        friction: float,
        gravity: np.ndarray,
    ) -> None:
        """Replace the wrenches; without a solution, feet in stance keep theirs.

        Args:
            state, reference, contacts, friction, gravity: see `ForceProblems.build`.
            arms: `feet` of `ForceProblems.build`.
            to_heading: (3, 3), by which a row vector in the world is multiplied for the heading frame.
        """
        previous_force = self.wrenches.force.dot(to_heading)
        problem = self.problems.build(state, reference, contacts, arms, previous_force, friction, gravity)
        solution = self.solver.solve(problem)
        if solution is None:
            force, moment = self.wrenches
            stands = contacts[0][:, None]
            self.wrenches = Wrenches(force * stands, moment * stands)
        else:
            wrenches = self.problems.wrenches(solution, problem, self._feet)
            self.wrenches = wrenches.dot(to_heading.T)
