"""Which runs estimate the base's velocity and height, and from which sensors."""

import numpy as np
from deploy_policies import Hold
from fake_estimator import FakeEstimator
from loops import simulated_loop, walk_for

from footfall.deploy.modes import Mode
from footfall.robots.description import Robot


def test_the_estimator_gets_the_policys_contact_plan_once_it_has_begun(go1: Robot) -> None:
    plan = np.array([1.0, 0.0, 0.0, 1.0])

    class Planned(Hold):
        def stance(self) -> np.ndarray:  # type: ignore[override]
            return plan if self.resets else 0.0 * plan  # before the reset: the last episode's

    policy, note = Planned(go1), FakeEstimator()
    loop = simulated_loop(go1, policy, estimator=note, estimator_rate_hz=30.0)
    while loop.state.mode is not Mode.WALKING:
        standing = len(note.plans)
        loop.tick()
    walk_for(loop, 0.1)
    assert note.resets == 1
    assert note.started == [standing]  # the pose is zero where the policy takes over
    assert standing == 2  # of 0.1 s
    assert all(stance is None for stance in note.plans[: standing + 1])
    assert all(stance is plan for stance in note.plans[standing + 1 :])
    np.testing.assert_allclose(note.steps_s[:2], 0.034, atol=1e-9)  # 1/30 s, at the next tick
    assert [seen.base_velocity[0] for seen in policy.seen] == [3, 4, 5, 6, 7, 8]  # one at each policy step
    np.testing.assert_allclose(note.steps_s[3:], 0.02, atol=1e-9)
    assert policy.seen[-1].base_height == 0.25
