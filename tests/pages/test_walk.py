"""The robot that walks on the page: pace, commands, pushes, restarts."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.pages import walk
from footfall.pages.metrics_file import MetricsFile
from footfall.pages.newest_policy import NewestPolicy
from footfall.pages.snapshots import (
    NEWEST,
    Snapshot,
)
from footfall.pages.status import as_markdown
from footfall.pages.walk import Pace, Walk
from footfall.plant.episode import Episode, run_episode
from footfall.policies.learned import open_network
from footfall.policies.observation import observation_size
from footfall.policies.registry import ZOO
from footfall.robots.description import Robot
from footfall.train.runs.folder import open_run

pytest.importorskip("viser")


class TestPace:
    @pytest.fixture
    def clock(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A clock of the page whose time passes in sleep, and by hand."""
        clock = SimpleNamespace(now=50.0, slept=[])

        def sleep(time_s: float) -> None:
            clock.slept.append(time_s)
            clock.now += time_s

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: clock.now, sleep=sleep))
        return clock

    def test_time_that_was_lost_or_paused_is_not_caught_up_on_and_the_factor_is_of_late(
        self, clock: SimpleNamespace
    ) -> None:
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

    def test_a_fifth_of_a_second_is_lost_for_good(self, clock: SimpleNamespace) -> None:
        pace = Pace()
        clock.now += 0.7
        pace.wait(0.5)  # 0.2 s late
        for simulated_s in (0.9, 1.3):
            pace.wait(simulated_s)
        assert clock.slept == pytest.approx([0.4, 0.4])

    def test_a_pause_does_not_count_as_slowness(self, clock: SimpleNamespace) -> None:
        pace = Pace()
        clock.now += 100.0
        pace.resume(0.0)
        pace.wait(0.4)
        assert pace.factor == 1.0
        pace.wait(1.2)
        assert pace.factor == pytest.approx(1.0)

    def test_it_keeps_to_the_wall_clock_and_does_not_catch_up_on_lost_time(
        self, clock: SimpleNamespace
    ) -> None:
        pace = Pace()
        pace.wait(1.0)
        clock.now += 5.0  # something else took long
        pace.wait(1.5)
        pace.wait(2.0)
        assert clock.slept == pytest.approx([1.0, 0.5])


class TestWalk:
    @pytest.fixture
    def made(self, go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A walk in a world of stand-ins; `log` says what it did."""
        log: list[Any] = []
        now = SimpleNamespace(s=1000.0)

        def sleep(time_s: float) -> None:
            log.append(("sleep", time_s))
            now.s += time_s
            if now.s > 2000.0:
                stop.requested = True

        monkeypatch.setattr(walk, "time", SimpleNamespace(monotonic=lambda: now.s, sleep=sleep))
        stop = SimpleNamespace(requested=False)
        panel = SimpleNamespace(
            command=np.array([0.3, -0.2, 0.1]), paused=False, follow=True, seen=False, policy="chosen",
            push=0.0,
            restart=False, offer_commands=lambda ranges: log.append(("commands", ranges)),
            offer_policies=lambda names: log.append(("policies", names)),
            say=lambda text: log.append(("say", text)),
            draw=lambda metrics, finished: None,
        )  # fmt: skip
        panel.take_push = lambda: panel.push
        panel.take_restart = lambda: panel.restart
        snapshots = SimpleNamespace(
            problem="a problem",
            exporting=8,
            chosen="",
            next=None,
            names=lambda: ["a name"],
            poll=lambda: snapshots.next,
        )
        view = SimpleNamespace(
            show=lambda *given: log.append(("show", *given)), begin=lambda: log.append(("begin",))
        )
        made = SimpleNamespace(robot="go1", preset="presets/mine.yaml", seed=4, trainer="brax")
        ppo = SimpleNamespace(iterations=10, steps_per_iteration=16)
        run: Any = SimpleNamespace(
            folder=tmp_path, policy=tmp_path / "policy.onnx", provenance=made, config=SimpleNamespace(ppo=ppo)
        )
        walking = Walk(run, go1, view, panel, snapshots, stop)  # type: ignore[arg-type]
        return SimpleNamespace(
            walk=walking,
            log=log,
            panel=panel,
            snapshots=snapshots,
            stop=stop,
            now=now,
            run=run,
            status=walking._status,
        )

    def done(self, made: SimpleNamespace) -> list[str]:
        return [each[0] for each in made.log]

    def test_it_looks_at_most_once_a_second_and_tells_what_it_saw(
        self, made: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "metrics.jsonl").write_text('{"step": 160}\n')
        monkeypatch.setattr(made.walk._metrics, "age_s", lambda: 42.0)
        made.walk._look()
        assert ("policies", ["a name"]) in made.log
        assert made.snapshots.chosen == "chosen"
        assert (made.status.trained_steps, made.status.finished) == (160, False)
        assert made.status.metrics_age_s == 42.0
        assert (made.status.problem, made.status.exporting) == ("a problem", 8)
        assert made.log[-1] == ("say", as_markdown(made.status))
        made.log.clear()
        made.now.s += 0.99
        made.walk._look()
        assert made.log == []
        made.now.s += 0.02
        made.run.policy.touch()
        made.walk._look()
        assert self.done(made) == ["policies", "say"]
        assert made.status.finished

    def test_the_first_policy_brings_its_commands_and_the_next_replaces_its_network(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        policies: list[Any] = []

        def newest(path: str, robot: Robot) -> Any:
            policies.append((path, robot.name))
            contract = SimpleNamespace(commands="ranges")
            return SimpleNamespace(contract=contract, replace_network=policies.append)

        monkeypatch.setattr(walk, "NewestPolicy", newest)
        for path, iteration in (("a.onnx", 3), ("b.onnx", 5)):
            made.snapshots.next = Snapshot(path, iteration)  # type: ignore[arg-type]
            made.panel.seen = True
            made.now.s += 2.0
            made.walk._look()
        assert policies == [("a.onnx", "go1"), "b.onnx"]
        assert [each for each in made.log if each[0] == "commands"] == [("commands", "ranges")]
        assert (made.status.iteration, made.status.policies) == (5, 2)

    def test_a_policy_is_looked_for_until_there_is_one_and_then_while_somebody_looks(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[str] = []
        made.snapshots.poll = lambda: asked.append("asked")
        for policy, seen, times in ((None, False, 1), ("policy", False, 1), ("policy", True, 2)):
            made.walk._policy, made.panel.seen = policy, seen
            made.now.s += 2.0
            made.walk._look()
            assert len(asked) == times

    def test_a_training_is_finished_after_its_last_step_alone(self, made: SimpleNamespace) -> None:
        """A policy.onnx may be one that was exported on the way."""
        made.run.policy.touch()
        metrics = made.run.folder / "metrics.jsonl"
        for step, finished in ((159, False), (160, True)):
            metrics.write_text(f'{{"step": {step}}}\n')
            made.walk._metrics = MetricsFile(metrics)
            made.now.s += 2.0
            made.walk._look()
            assert made.status.finished is finished

    def test_a_network_that_is_refused_changes_nothing_but_what_is_said(self, made: SimpleNamespace) -> None:
        def refuse(_: Path) -> None:
            raise UserError("another contract")

        made.walk._policy = SimpleNamespace(replace_network=refuse)
        made.status.iteration, made.status.policies = 3, 1
        made.panel.seen, made.snapshots.next = True, Snapshot(Path("b.onnx"), 5)
        made.walk._look()
        assert (made.status.iteration, made.status.policies) == (3, 1)
        assert made.status.problem == "another contract"

    def test_an_episode_is_walked_as_the_page_commands_and_its_fall_is_counted(
        self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given: list[Any] = []
        traces = [
            SimpleNamespace(fell=True, fall_reason="it tilted", faults=("x",)),
            SimpleNamespace(fell=False, fall_reason="", faults=("motor 3",)),
            SimpleNamespace(fell=False, fall_reason="", faults=()),
        ]
        monkeypatch.setattr(walk, "run_episode", lambda *each: given.append(each) or traces[len(given) - 1])
        ends = []
        for _ in traces:
            made.walk._next_frame_us = 7_000_000  # of an episode before
            made.walk._episode("policy")
            assert made.walk._next_frame_us == 0
            assert isinstance(made.walk._pace, Pace)
            ends.append((made.status.episodes, made.status.falls, made.status.last_fall))
        assert ends == [(1, 1, "it tilted"), (2, 1, "motor 3"), (3, 1, "motor 3")]
        robot, policy, episode, tick = given[0]
        assert (robot.name, policy, episode.duration_s) == ("go1", "policy", 60.0)
        assert episode.command_source(0.0) is made.panel.command
        made.panel.command = np.array([0.7, 0.1, -0.2])  # moved meanwhile
        assert episode.command_source(5.0) is made.panel.command
        assert tick == made.walk._tick
        assert self.done(made) == ["begin"] * 3

    @pytest.fixture
    def walking(self, made: SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """In the middle of an episode, at 2 s."""
        monkeypatch.setattr(made.walk, "_look", lambda: made.log.append(("look",)))
        made.walk._pace = SimpleNamespace(
            factor=0.75,
            wait=lambda at: made.log.append(("wait", at)),
            resume=lambda at: made.log.append(("resume", at)),
        )
        made.walk._next_frame_us = 2_000_000
        made.loop = SimpleNamespace(
            now_us=2_000_000, walking_s=1.0, walking=True, sensed="sensed",
            state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
            finish=lambda: made.log.append(("finish",)),
        )  # fmt: skip
        truth = SimpleNamespace(
            base_position=np.zeros(3), base_quaternion=np.array([1.0, 0, 0, 0]),
            foot_contact=np.ones(4, bool),
            base_velocity=np.array([0.4, 0.2, 9.0]), base_angular_velocity=np.array([7.0, 8.0, -1.0]),
        )  # fmt: skip
        made.body = SimpleNamespace(
            data="data", truth=lambda: truth, push=lambda change: made.log.append(("push", change))
        )
        return made

    def test_a_frame_comes_when_it_is_due(self, walking: SimpleNamespace) -> None:
        walking.loop.now_us = 1_999_999
        walking.walk._tick(walking.loop, walking.body)
        assert walking.log == []
        walking.loop.now_us = 2_000_000
        walking.walk._tick(walking.loop, walking.body)
        assert self.done(walking) == ["show", "look", "wait"]
        assert walking.log[-1] == ("wait", 2.0)
        assert walking.walk._next_frame_us == 2_033_000
        walking.loop.now_us = 2_040_000  # a late one leaves the rhythm as it is
        walking.walk._tick(walking.loop, walking.body)
        assert walking.walk._next_frame_us == 2_066_000
        walking.stop.requested = True
        walking.log.clear()
        walking.walk._tick(walking.loop, walking.body)
        assert walking.log == [("finish",)]

    def test_it_shows_the_true_velocity_smoothed_beside_the_command(self, walking: SimpleNamespace) -> None:
        for share in (0.1, 0.19):
            walking.log.clear()
            walking.walk._show(walking.loop, walking.body)
            ((_, data, moment, velocity, follow),) = walking.log
            assert (data, follow) == ("data", True)
            assert moment.command is walking.panel.command
            np.testing.assert_allclose(velocity, share * np.array([0.4, 0.2, -1.0]))
        assert (walking.status.mode, walking.status.pace) == ("WALKING", 0.75)

    def test_a_push_has_the_speed_that_was_asked_for_and_a_direction_of_its_own(
        self, walking: SimpleNamespace
    ) -> None:
        walking.panel.push = 1.5
        for _ in range(40):
            walking.walk._do_as_asked(walking.loop, walking.body)
        pushes = np.array([change for _, change in walking.log])
        np.testing.assert_allclose(np.hypot(pushes[:, 0], pushes[:, 1]), 1.5)
        assert not pushes[:, 2].any()
        angles = np.arctan2(pushes[:, 1], pushes[:, 0])
        assert angles.min() < -2.0
        assert angles.max() > 2.0

    def test_a_restart_ends_the_episode(self, walking: SimpleNamespace) -> None:
        walking.panel.restart = True
        walking.walk._do_as_asked(walking.loop, walking.body)
        assert walking.log == [("finish",)]

    def test_while_it_is_paused_it_looks_on_and_then_keeps_its_time(
        self, walking: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        walking.panel.paused = True

        def look() -> None:
            walking.log.append(("look",))
            walking.panel.paused = len(walking.log) < 5

        monkeypatch.setattr(walking.walk, "_look", look)
        walking.walk._do_as_asked(walking.loop, walking.body)
        assert walking.log == [("look",), ("sleep", 0.1)] * 3 + [("resume", 2.0)]

    @pytest.fixture
    def looking(self, finished: Path, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """A walk whose page and snapshots are stand-ins: `look` looks into the run folder."""
        monkeypatch.setattr("footfall.pages.walk.LOOK_S", 0.0)
        said: list[str] = []
        panel = SimpleNamespace(
            seen=False,
            say=said.append,
            offer_commands=lambda _: None,
            offer_policies=lambda _: None,
            draw=lambda metrics, finished: None,
            policy=NEWEST,
        )
        snapshots = SimpleNamespace(
            problem="", exporting=None, names=list, poll=lambda: Snapshot(POLICY, None)
        )
        walk = Walk(open_run(finished), go1, None, panel, snapshots, None)
        return SimpleNamespace(
            look=walk._look, status=walk._status, panel=panel, snapshots=snapshots, said=said
        )

    def test_it_asks_for_newer_policies_while_somebody_looks(self, looking: SimpleNamespace) -> None:
        for seen, shown in ((False, 1), (False, 1), (True, 2)):
            looking.panel.seen = seen
            looking.look()
            assert looking.status.policies == shown

    def test_why_a_network_was_refused_stays_on_the_page(
        self, looking: SimpleNamespace, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def refuse(*_: object) -> None:
            raise UserError("another contract")

        looking.look()
        monkeypatch.setattr(NewestPolicy, "replace_network", refuse)
        looking.panel.seen = True
        looking.look()
        looking.snapshots.poll = lambda: None
        looking.look()
        assert "Not usable: another contract" in looking.said[-1]


POLICY = ZOO / "go1-flat" / "policy.onnx"


class TestNewestPolicy:
    def test_a_new_network_goes_on_where_the_old_one_was(self, go1: Robot) -> None:
        """With the same network nothing changes at all: history, last action and clock carry over."""

        def walk(replace: bool) -> np.ndarray:
            policy = NewestPolicy(POLICY, go1)

            def watch(loop, _) -> None:
                if replace and round(loop.walking_s * 500) == 200:
                    policy.replace_network(POLICY)

            episode = Episode(lambda _: np.array([0.5, 0.0, 0.0]), 1.0)
            return run_episode(go1, policy, episode, watch).qpos

        assert np.array_equal(walk(replace=True), walk(replace=False))

    def test_it_is_the_new_network_that_decides(self, go1: Robot, tmp_path: Path) -> None:
        onnx = pytest.importorskip("onnx")
        from tiny_policy import write_network

        contract = open_network(POLICY)[1]
        shape = observation_size(contract), len(contract.joints)
        weights = np.random.default_rng(0).normal(size=shape).astype(np.float32)
        other = write_network(onnx, tmp_path / "other.onnx", 0.1 * weights, contract)
        session = NewestPolicy(POLICY, go1)
        observed = np.ones((1, shape[0]), np.float32)
        session.replace_network(other)
        (action,) = session._session.run(None, {"observation": observed})
        np.testing.assert_allclose(action, 0.1 * observed @ weights, rtol=1e-4, atol=1e-4)

    def test_a_network_of_another_contract_is_refused(
        self, go1: Robot, own_folder: Path, tmp_path: Path
    ) -> None:
        onnx = pytest.importorskip("onnx")
        from tiny_policy import write_policy

        other = write_policy(onnx, tmp_path / "other.onnx", own_folder)
        with pytest.raises(UserError, match="another contract"):
            NewestPolicy(POLICY, go1).replace_network(other)

    def test_one_whose_actions_start_from_another_pose_is_refused(self, go1: Robot, tmp_path: Path) -> None:
        onnx = pytest.importorskip("onnx")
        from tiny_policy import write_network

        contract = open_network(POLICY)[1]
        shape = observation_size(contract), len(contract.joints)
        lower = replace(contract, default_pose_rad=tuple(0.9 * np.array(contract.default_pose_rad)))
        other = write_network(onnx, tmp_path / "other.onnx", np.zeros(shape, np.float32), lower)
        with pytest.raises(UserError, match="another contract"):
            NewestPolicy(POLICY, go1).replace_network(other)
