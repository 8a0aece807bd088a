"""The robot that walks on the page: pace, commands, pushes, policies exported beside it, status text."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import short_episode
from tiny_policy import write_network

from footfall import Robot, run_episode
from footfall.deploy.loop import ControlLoop
from footfall.pages import walk
from footfall.pages.moment import Moment
from footfall.pages.newest_policy import NewestPolicy
from footfall.pages.snapshots import FINISHED, NEWEST, Exported, Snapshot, Snapshots, newest_checkpoint
from footfall.pages.status import WAITING, Status, as_markdown
from footfall.pages.walk import Pace, Walk
from footfall.policies.learned import open_network
from footfall.policies.observation import observation_size
from footfall.policies.registry import ZOO
from footfall.train.runs.folder import open_run

POLICY = ZOO / "go1-flat" / "policy.onnx"


def test_lost_time_is_skipped_and_the_speed_factor_restarts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's clock advances in sleep and on request."""
    clock = SimpleNamespace(now=50.0, slept=[])

    def sleep(time_s: float) -> None:
        clock.slept.append(time_s)
        clock.now += time_s

    monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=sleep))
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
    pace = Pace()
    clock.now += 0.7
    pace.wait(0.5)  # 0.2 s late
    for simulated_s in (0.9, 1.3):
        pace.wait(simulated_s)
    assert clock.slept[-2:] == pytest.approx([0.4, 0.4])  # not caught up


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
        self.requested |= self.frames >= 240

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

            ahead = short_episode(command_source=lambda _: np.array([0.5, 0.0, 0.0]), duration_s=0.6)
            return run_episode(go1, policy, ahead, watch).qpos

        assert np.array_equal(walk(replaced=True), walk(replaced=False))

    def test_after_the_change_the_new_network_decides(self, go1: Robot, tmp_path: Path) -> None:
        onnx = pytest.importorskip("onnx")
        contract = open_network(POLICY)[1]
        shape = observation_size(contract), len(contract.joints)
        weights = np.random.default_rng(0).normal(size=shape).astype(np.float32)
        other = write_network(onnx, tmp_path / "other.onnx", 0.1 * weights, contract)
        session = NewestPolicy(POLICY, go1)
        session.replace_network(other)
        action = session.network(np.ones(shape[0], np.float32))
        np.testing.assert_allclose(action, 0.1 * weights.sum(axis=0), rtol=1e-4, atol=1e-4)


WALKING = Status("go1", "runs/mine", 2000, 10, trained_steps=500, metrics_age_s=3.0, iteration=30, policies=1)


def test_the_status_names_what_is_awaited_and_a_training_without_news_for_two_minutes() -> None:
    nothing = replace(WALKING, policies=0, iteration=None, metrics_age_s=None)
    assert WAITING in as_markdown(nothing)
    assert "Policy" not in as_markdown(nothing)
    assert "1,200" in as_markdown(replace(nothing, exporting=1200))
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


class TestSnapshots:
    @pytest.fixture
    def run(self, tmp_path: Path) -> Path:
        (tmp_path / "run" / "checkpoints").mkdir(parents=True)
        (tmp_path / "out").mkdir()
        return tmp_path / "run"

    def write(self, folder: Path, name: str, at_s: int) -> Path:
        (folder / name).write_text("x")
        os.utime(folder / name, (at_s, at_s))
        return folder / name

    def checkpoint(self, run: Path, number: str, at_s: int = 100) -> Path:
        return self.write(run / "checkpoints", f"{number}.ckpt", at_s)

    def found(self, run: Path) -> tuple[Snapshots, SimpleNamespace]:
        """Snapshots with a fake exporter."""
        exporter = SimpleNamespace(calls=[], answer=None, wake=lambda: None)
        exporter.start = lambda *given: exporter.calls.append(given)
        exporter.poll = lambda: exporter.answer
        return Snapshots(run, run.parent / "out", exporter), exporter  # type: ignore[arg-type]

    def test_a_checkpoint_is_exported_once_and_returned_when_ready(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        checkpoint, out = self.checkpoint(run, "00000012"), run.parent / "out" / "00000012.onnx"
        for _ in range(2):  # not yet
            assert (snapshots.poll(), snapshots.exporting) == (None, 12)
        exporter.answer = Exported(out)
        assert (snapshots.poll(), snapshots.exporting) == (Snapshot(out, 12), None)
        assert snapshots.poll() is None
        assert exporter.calls == [(checkpoint, out)]

    def test_a_problem_is_reported_and_its_checkpoint_is_not_tried_again(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.checkpoint(run, "00000012")
        snapshots.poll()
        exporter.answer = Exported(None, "it is damaged")
        for _ in range(2):
            assert (snapshots.poll(), snapshots.problem) == (None, "it is damaged")
        assert len(exporter.calls) == 1
        done = self.write(run, FINISHED, 200)
        assert (snapshots.poll(), snapshots.problem) == (Snapshot(done, 12), "")

    def test_the_highest_checkpoint_is_exported_if_newer_than_the_policy(self, run: Path) -> None:
        snapshots, _ = self.found(run)
        self.checkpoint(run, "00000012")
        done = self.write(run, FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        later = self.checkpoint(run, "00000013", 300)
        assert (snapshots.poll(), snapshots.exporting) == (None, 13)
        assert newest_checkpoint(run) == later
        self.checkpoint(run, "00000009", 400)
        self.checkpoint(run, "99999999", 500)
        highest = self.checkpoint(run, "100000000", 50)
        assert newest_checkpoint(run) == highest
        assert newest_checkpoint(run.parent) is None

    def test_an_outdated_export_is_repeated(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.checkpoint(run, "00000012")
        self.write(run.parent / "out", "00000012.onnx", 99)
        assert (snapshots.poll(), len(exporter.calls)) == (None, 1)
        other, exporter = self.found(run)
        exported = self.write(run.parent / "out", "00000012.onnx", 100)
        assert other.poll() == Snapshot(exported, 12)
        assert exporter.calls == []

    def test_names_begin_with_the_newest_and_a_choice_is_found_by_name(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.names() == [NEWEST]
        kept = self.checkpoint(run, "00001200")
        self.checkpoint(run, "00000090")
        self.write(run.parent / "out", "00000090.onnx", 100)
        dropped = self.write(run.parent / "out", "00000007.onnx", 100)
        done = self.write(run, FINISHED, 200)
        assert snapshots.names() == [NEWEST, FINISHED, "iteration 1,200", "iteration 90", "iteration 7"]
        snapshots.chosen = "iteration 7"
        assert snapshots.poll() == Snapshot(dropped, 7)
        snapshots.chosen = FINISHED
        assert snapshots.poll() == Snapshot(done, 1200)
        snapshots.chosen = "iteration 1,200"
        assert snapshots.poll() is None
        assert exporter.calls == [(kept, run.parent / "out" / "00001200.onnx")]
        snapshots.chosen = "iteration 5"
        exporter.answer = Exported(None)
        assert snapshots.poll() is None
