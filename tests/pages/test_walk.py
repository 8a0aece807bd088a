"""The robot that walks on the page: pace, commands, pushes, restarts, status text."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from footfall import Episode, Robot, run_episode
from footfall.deploy.loop import ControlLoop
from footfall.pages import walk
from footfall.pages.moment import Moment
from footfall.pages.newest_policy import NewestPolicy
from footfall.pages.snapshots import NEWEST, Snapshot
from footfall.pages.status import WAITING, Status, as_markdown
from footfall.pages.walk import Pace, Walk
from footfall.policies.learned import open_network
from footfall.policies.observation import observation_size
from footfall.policies.registry import ZOO
from footfall.train.runs.folder import open_run

POLICY = ZOO / "go1-flat" / "policy.onnx"


class TestPace:
    @pytest.fixture
    def clock(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A clock for the page that advances in sleep and on request."""
        clock = SimpleNamespace(now=50.0, slept=[])

        def sleep(time_s: float) -> None:
            clock.slept.append(time_s)
            clock.now += time_s

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=sleep))
        return clock

    def test_lost_time_is_skipped_and_the_speed_factor_restarts(self, clock: SimpleNamespace) -> None:
        pace = Pace()
        assert pace.factor == 1.0
        pace.wait(0.5)
        clock.now += 0.55  # 50 ms late: within tolerance, caught up on by sleeping less
        pace.wait(1.0)
        pace.wait(1.5)
        assert clock.slept == pytest.approx([0.5, 0.45])
        assert pace.factor == pytest.approx(1.0 / 1.05)
        clock.now += 2.0
        pace.wait(1.7)  # 1.8 s late: lost
        assert pace.factor == pytest.approx(0.7 / 2.45, rel=1e-3)
        clock.now += 100.0
        pace.resume(1.7)
        pace.wait(2.0)
        assert clock.slept[2:] == pytest.approx([0.3])
        clock.now += 1.0
        pace.wait(3.0)
        assert pace.factor == pytest.approx(1.3 / 1.3)

    def test_a_delay_of_a_fifth_of_a_second_is_not_caught_up(self, clock: SimpleNamespace) -> None:
        pace = Pace()
        clock.now += 0.7
        pace.wait(0.5)  # 0.2 s late
        for simulated_s in (0.9, 1.3):
            pace.wait(simulated_s)
        assert clock.slept == pytest.approx([0.4, 0.4])


class Visitor:
    """A fake page and run whose visitor acts after each frame; its clock advances while the walk waits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s, self.frames, self.texts = 1000.0, 0, [""]
        self.shown: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # base velocity, command, velocity
        self.command = np.array([0.5, 0.0, 0.0])
        self.paused, self.follow, self.visited, self.policy = False, True, True, NEWEST
        self.push, self.restart = 0.0, False
        self.ready: list[Snapshot] = [Snapshot(POLICY, 3)]
        self.problem, self.exporting, self.requested = "", None, False
        self.offered: list[Any] = []
        self.offer_commands = self.offer_policies = self.offered.append
        self.show_status = self.texts.append
        self.names, self.begin, self.draw = (lambda: ["a name"]), Mock(), Mock()
        self.poll = Mock(side_effect=lambda: self.ready.pop(0) if self.ready else None)
        self.after_frame: Callable[[int], None] = lambda frame: None
        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: self.now_s, sleep=self.sleep))

    def sleep(self, time_s: float) -> None:
        self.now_s += time_s
        self.requested |= self.now_s > 1100.0

    def take_push(self) -> float:
        push, self.push = self.push, 0.0
        return push

    def take_restart(self) -> bool:
        restart, self.restart = self.restart, False
        return restart

    def show(self, data: Any, moment: Moment, velocity: np.ndarray, follow: bool) -> None:
        self.frames += 1
        self.shown.append((data.qvel[:3].copy(), moment.command, velocity))
        self.after_frame(self.frames)
        self.requested |= self.frames >= 300

    def walk(self, run: Path, robot: Robot) -> None:
        """Run until the visitor leaves."""
        Walk(open_run(run), robot, self, self, self, self).run()  # type: ignore[arg-type]


class TestWalk:
    @pytest.fixture
    def visitor(self, monkeypatch: pytest.MonkeyPatch) -> Visitor:
        return Visitor(monkeypatch)

    def test_the_robot_walks_as_commanded(self, visitor: Visitor, finished: Path, go1: Robot) -> None:
        pushes: list[np.ndarray] = []

        def push(frame: int) -> None:
            if frame in (200, 210, 220):
                visitor.push = 1.5
            elif frame in (201, 211, 221):
                pushes.append(visitor.shown[-1][0] - visitor.shown[-2][0])
            visitor.restart = frame == 5
            if frame == 150:
                visitor.command = np.array([0.3, 0.0, 0.0])

        visitor.after_frame = push
        visitor.walk(finished, go1)
        np.testing.assert_allclose([np.hypot(x, y) for x, y, _ in pushes], 1.5, atol=0.5)
        directions = np.arctan2(*np.array(pushes)[:, 1::-1].T)
        assert np.ptp(directions) > 0.5
        _, command, velocity = visitor.shown[199]
        assert command is visitor.command
        np.testing.assert_allclose(velocity, [0.4, 0.0, 0.0], atol=0.15)  # smoothed
        assert visitor.begin.call_count == 2
        assert len(visitor.texts) < visitor.frames / 20  # the walk checks once a second
        assert visitor.now_s == pytest.approx(1000.0 + 0.033 * visitor.frames, abs=0.2)

    def test_newer_policies_walk(self, visitor: Visitor, finished: Path, go1: Robot, tmp_path: Path) -> None:
        """A policy with another contract changes nothing except the message."""
        (tmp_path / "other.onnx").write_bytes(b"no policy")
        visitor.ready += [Snapshot(POLICY, 5), Snapshot(tmp_path / "other.onnx", 6)]
        visitor.walk(finished, go1)
        assert "of iteration 5," in visitor.texts[-1]
        assert "Not usable" in visitor.texts[-1]
        assert visitor.poll.call_count > 3
        assert [each for each in visitor.offered if each != ["a name"]] == [open_network(POLICY)[1].commands]


class TestNewestPolicy:
    def test_a_new_network_continues_the_state_of_the_old_one(self, go1: Robot) -> None:
        """With the same network the outputs do not change: history, last action and clock continue."""

        def walk(replaced: bool) -> np.ndarray:
            policy = NewestPolicy(POLICY, go1)

            def watch(loop: ControlLoop, _: object) -> None:
                if replaced and round(loop.walking_s * 500) == 200:
                    policy.replace_network(POLICY)

            episode = Episode(lambda _: np.array([0.5, 0.0, 0.0]), 1.0)
            return run_episode(go1, policy, episode, watch).qpos

        assert np.array_equal(walk(replaced=True), walk(replaced=False))

    def test_after_the_change_the_new_network_decides(self, go1: Robot, tmp_path: Path) -> None:
        onnx = pytest.importorskip("onnx")
        from tiny_policy import write_network

        contract = open_network(POLICY)[1]
        shape = observation_size(contract), len(contract.joints)
        weights = np.random.default_rng(0).normal(size=shape).astype(np.float32)
        other = write_network(onnx, tmp_path / "other.onnx", 0.1 * weights, contract)
        session = NewestPolicy(POLICY, go1)
        session.replace_network(other)
        action = session.network(np.ones(shape[0], np.float32))
        np.testing.assert_allclose(action, 0.1 * weights.sum(axis=0), rtol=1e-4, atol=1e-4)


WALKING = Status("go1", "runs/mine", 2000, 10, trained_steps=500, metrics_age_s=3.0, iteration=30, policies=1)


def test_the_awaited_policy_is_shown() -> None:
    nothing = replace(WALKING, policies=0, iteration=None, metrics_age_s=None)
    assert WAITING in as_markdown(nothing)
    assert "Policy" not in as_markdown(nothing)
    assert "1,200" in as_markdown(replace(nothing, exporting=1200))


def test_a_training_without_news_for_two_minutes_is_reported_unless_finished() -> None:
    for age_s, finished, quiet in ((120.0, False, False), (120.1, False, True), (999.0, True, False)):
        text = as_markdown(replace(WALKING, metrics_age_s=age_s, finished=finished))
        assert ("train --resume runs/mine" in text) is quiet
    done = as_markdown(replace(WALKING, finished=True, trained_steps=2000, metrics_age_s=7300.0))
    assert "2,000 steps, 2 h" in done


def test_the_status_shows_the_walking_policy_and_its_tracking_error() -> None:
    status = replace(
        WALKING, command=np.array([0.5, 0.0, 0.0]), velocity=np.array([0.42, -0.01, 0.0]), mode="WALKING",
        episodes=4, falls=3, last_fall="the base tilted", walked_s=12.0, restart_s=60.0,
    )  # fmt: skip
    text = as_markdown(status)
    facts = ("500 of 2,000 steps (25%)", "iteration 30", "+0.42 of +0.50 m/s", "3 in 4", "the base tilted")
    assert [fact for fact in (*facts, "12 of 60 s") if fact not in text] == []
    assert WAITING not in text
