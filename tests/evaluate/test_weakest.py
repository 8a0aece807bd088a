"""The search for the smallest disturbance at which a policy fails."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from shell import Shell

from footfall import EvaluationConfig, UserError, load_robot
from footfall.evaluate import weakest as search
from footfall.evaluate.episodes import EpisodeTask
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.weakest import Ray, bisect, disturbed, smallest, weakest

NAMES = ("push", "latency")
FILE = load_scenarios(load_robot("go1"))
(PLAN,) = plan_episodes("push", FILE.scenarios["push"], 3, 1)


def test_a_bisection_finds_the_smallest_size_that_makes_a_policy_fall() -> None:
    for limit in (0.001, 0.3, 0.77, 1.0, math.inf):
        assert smallest(lambda share, limit=limit: share >= limit) == pytest.approx(limit, abs=1 / 256)
    assert smallest(lambda share: True) == 0.0  # a policy that falls by itself


def test_a_push_keeps_its_time_and_direction_and_other_disturbances_replace_it() -> None:
    (before,), (after,) = PLAN.pushes, disturbed(PLAN, {"push": 0.5}).pushes
    assert after.time_s == before.time_s
    assert np.linalg.norm(after.delta_v_m_s) == pytest.approx(4.0)
    assert np.dot(after.delta_v_m_s, before.delta_v_m_s) > 0.0
    np.testing.assert_allclose(np.cross(after.delta_v_m_s, before.delta_v_m_s), 0.0, atol=1e-9)
    changed = disturbed(PLAN, {"friction": 0.75, "strength": 0.4, "latency": 0.2})
    assert changed.pushes == ()
    assert changed.levels == pytest.approx({"friction": 0.25, "motor_strength": 0.6, "action_delay_s": 0.05})


def fall_if(monkeypatch: pytest.MonkeyPatch, falls: Callable[[float, float], bool]) -> None:
    """Replace simulated episodes: whether the policy falls is a function of both severities."""

    def limit(ray: Ray) -> float:
        ends = [ray.direction.get(name, 0.0) for name in NAMES]
        return smallest(lambda share: falls(*(share * end for end in ends)))

    monkeypatch.setattr(search, "_run", lambda rays, workers: [limit(ray) for ray in rays])


def test_each_disturbance_has_its_figures_in_its_unit(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cma")
    fall_if(monkeypatch, lambda push, latency: push >= 0.5)
    figures = weakest("go1-flat", EvaluationConfig(episodes=6), FILE, NAMES)
    assert figures["push"]["smallest"] == pytest.approx(4.0, abs=0.04)
    assert figures["push"]["interval"] == pytest.approx([4.0, 4.0], abs=0.04)
    assert (figures["latency"]["smallest"], figures["latency"]["never_fell"]) == (None, 6)


def test_smaller_disturbances_together_make_a_policy_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    """A large product of both severities is enough: a fifth of what each needs alone."""
    pytest.importorskip("cma")
    fall_if(monkeypatch, lambda push, latency: push >= 0.5 or latency >= 0.5 or push * latency >= 0.01)
    together = weakest("go1-flat", EvaluationConfig(episodes=6), FILE, NAMES)["together"]
    assert together["size"] <= 0.3  # of the norm; the smallest is 0.2 * sqrt(2)
    push, latency = together["values"]["push"] / 8.0, together["values"]["latency"] / 0.25
    assert push * latency == pytest.approx(0.01, rel=0.1)


def test_an_unknown_or_repeated_disturbance_is_refused() -> None:
    for names in (["wind"], ["push", "push"]):
        with pytest.raises(UserError, match=f"--weakest {','.join(names)}"):
            weakest("go1-flat", EvaluationConfig(), FILE, names)


@pytest.mark.usefixtures("quick_standing")
def test_a_push_makes_a_simulated_robot_fall(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "smallest", partial(smallest, halvings=1))
    early = replace(PLAN, duration_s=1.2, pushes=(replace(PLAN.pushes[0], time_s=0.1),))
    task = EpisodeTask("stand", "go1", early, FILE.noise)
    assert bisect(Ray(task, {"push": 1.0})) in (0.5, 1.0)
    assert math.isinf(bisect(Ray(task, {"push": 0.01})))


@pytest.mark.usefixtures("quick_standing")
def test_a_robot_that_makes_no_progress_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot on ice never falls but makes no progress. For a command to stand, that is no failure."""
    monkeypatch.setattr(search, "smallest", partial(smallest, halvings=0))
    task = EpisodeTask("go1-flat", "go1", replace(PLAN, duration_s=1.5), FILE.noise)
    assert bisect(Ray(task, {"friction": 1.0})) == 1.0
    assert math.isinf(bisect(Ray(task, {"friction": 0.01})))
    standing = replace(task, policy="stand", plan=replace(PLAN, duration_s=0.3))
    assert math.isinf(bisect(Ray(standing, {"friction": 1.0})))


def test_the_command_prints_and_writes_the_result(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    fall_if(monkeypatch, lambda push, latency: push >= 0.5)
    outcome = shell("evaluate", "stand", "--weakest", "push", "--episodes", "3", "--json", "a.json")
    assert outcome.status == 0
    assert "push, m/s" in outcome.out
    assert json.loads(Path("a.json").read_text())["weakest"]["push"]["median"] == pytest.approx(4.0, abs=0.04)
