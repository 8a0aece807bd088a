"""Watching a run: what is read from its folder, what is drawn of the robot, how the page begins and ends."""

import json
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from shell import Shell

from footfall.common.errors import UserError
from footfall.pages.geometry import COLLISION_GROUP, visible_shapes
from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.pages.newest_policy import NewestPolicy
from footfall.pages.page import check_page
from footfall.pages.panel import Panel
from footfall.pages.snapshots import FINISHED, NEWEST, Exported, Snapshot, Snapshots, _export
from footfall.pages.status import WAITING, Status, as_markdown
from footfall.pages.walk import Pace, Walk, standing
from footfall.plant.episode import Episode, run_episode
from footfall.policies.learned import open_network
from footfall.policies.observation import observation_size
from footfall.policies.registry import ZOO
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model
from footfall.train.config import load_preset
from footfall.train.runs.folder import Provenance, create_run, open_run
from footfall.verbs.train import ClusterOptions, TrainOptions, train

POLICY = ZOO / "go1-flat" / "policy.onnx"
FOOTFALL = [sys.executable, "-m", "footfall"]


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """A run that was begun and has nothing to show yet."""
    made = Provenance("go1", 0, "smoke", "brax", "cpu", "unknown", "2026-01-01", {})
    return create_run(tmp_path / "run", made, load_preset("smoke")).folder


@pytest.fixture
def finished(begun: Path) -> Path:
    """A run with a policy."""
    shutil.copy(POLICY, begun)
    return begun


@pytest.fixture
def port() -> int:
    """One that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("localhost", port)) == 0


def wait_until(condition, limit_s: float = 120.0) -> None:
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


class TestMetricsFile:
    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        return tmp_path / "metrics.jsonl"

    def write(self, path: Path, *rows: dict, rest: str = "", mode: str = "a") -> None:
        with path.open(mode) as file:
            file.write("".join(json.dumps(row) + "\n" for row in rows) + rest)

    def test_curves_grow_with_the_file(self, path: Path) -> None:
        metrics = MetricsFile(path)
        assert not metrics.refresh()
        self.write(path, {"step": 10, "a": 1.0})
        assert metrics.refresh()
        assert [x.tolist() for x in metrics.curve("a")] == [[10], [1]]
        assert not metrics.refresh()
        self.write(path, {"step": 20, "a": 2.0}, {"step": 30, "a": 3.0})
        assert metrics.refresh()
        assert [x.tolist() for x in metrics.curve("a")] == [[10, 20, 30], [1, 2, 3]]
        assert metrics.last_step == 30

    def test_half_a_line_waits_for_its_other_half(self, path: Path) -> None:
        metrics = MetricsFile(path)
        self.write(path, {"step": 10, "a": 1.0}, rest='{"step": 20, ')
        metrics.refresh()
        assert metrics.last_step == 10
        self.write(path, rest='"a": 2.0}\n')
        assert metrics.refresh()
        assert metrics.curve("a")[1].tolist() == [1, 2]

    def test_what_a_resumed_run_computes_again_replaces_what_it_dropped(self, path: Path) -> None:
        metrics = MetricsFile(path)
        self.write(path, *({"step": step, "a": 1.0} for step in range(1, 6)))
        metrics.refresh()
        self.write(path, {"step": 1, "a": 1.0}, {"step": 2, "a": 7.0}, mode="w")
        metrics.refresh()
        assert metrics.curve("a")[1].tolist() == [1, 7]

    def test_numbers_that_cannot_be_drawn_and_lines_that_are_none_are_left_out(self, path: Path) -> None:
        metrics = MetricsFile(path)
        self.write(path, {"step": 1, "a": float("nan")}, {"step": 2, "a": None}, rest="garbage\n[]\n")
        self.write(path, {"step": 3, "a": 3.0})
        metrics.refresh()
        assert [x.tolist() for x in metrics.curve("a")] == [[3], [3]]
        assert len(metrics.curve("b")[0]) == 0

    def test_a_long_curve_is_thinned_between_its_ends(self) -> None:
        few = thinned(np.arange(10_000), 400)
        assert len(few) == 400
        assert (few[0], few[-1]) == (0, 9999)
        assert (np.diff(few) > 0).all()
        assert thinned(np.arange(5), 400).tolist() == [0, 1, 2, 3, 4]


class TestStatus:
    def test_says_that_it_waits(self) -> None:
        text = as_markdown(Status("go1", "runs/mine", 1000, 10))
        assert WAITING in text
        assert "no metrics yet" in text

    def test_says_that_the_first_policy_is_being_prepared(self) -> None:
        text = as_markdown(Status("go1", "runs/mine", 1000, 10, exporting=30))
        assert WAITING not in text
        assert "preparing the policy of iteration 30" in text

    def test_says_what_walks_and_how_it_follows(self) -> None:
        status = Status(
            "go1", "runs/mine", 1000, 10, trained_steps=500, metrics_age_s=2.0, iteration=30, policies=3
        )
        status.command, status.velocity = np.array([0.5, 0.0, 0.0]), np.array([0.42, -0.01, 0.0])
        status.mode, status.episodes, status.falls, status.last_fall = "WALKING", 4, 3, "the base tilted"
        text = as_markdown(status)
        assert WAITING not in text
        for fact in (
            "500 of 1,000 steps (50%)", "iteration 30, 300 steps", "+0.42 of +0.50 m/s",
            "3 in 4 starts: the base tilted", "walking",
        ):  # fmt: skip
            assert fact in text

    def test_says_that_a_training_is_finished(self) -> None:
        status = Status("go1", "runs/mine", 1000, 10, finished=True, trained_steps=1000, metrics_age_s=7200.0)
        assert "**finished** after 1,000 steps, 2 h ago" in as_markdown(status)
        assert "--resume" not in as_markdown(status)

    @pytest.mark.parametrize(("age_s", "said"), [(119.0, False), (121.0, True)])
    def test_says_how_a_training_that_was_stopped_goes_on(self, age_s: float, said: bool) -> None:
        text = as_markdown(Status("go1", "runs/mine", 1000, 10, trained_steps=500, metrics_age_s=age_s))
        assert ("footfall train --resume runs/mine" in text) is said


class TestGeometry:
    @pytest.fixture(autouse=True)
    def _needs_trimesh(self) -> None:
        pytest.importorskip("trimesh")

    def test_every_geom_that_is_to_be_seen_is_there_in_its_size_place_and_colour(self, go1: Robot) -> None:
        model = plant_model(go1)
        shapes = {shape.geom: shape for shape in visible_shapes(model)}
        planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        seen = np.flatnonzero((model.geom_group < COLLISION_GROUP) & ~planes)
        assert sorted(shapes) == seen.tolist()
        assert len(seen) > 30
        for geom, shape in shapes.items():
            middle, half = model.geom_aabb[geom].reshape(2, 3)
            assert shape.vertices.min(axis=0) == pytest.approx(middle - half, abs=2e-4)
            assert shape.vertices.max(axis=0) == pytest.approx(middle + half, abs=2e-4)
        accent = model.mat_rgba[model.material("accent").id]
        assert any(np.array_equal(shape.rgba, accent) for shape in shapes.values())

    def test_meshes_are_drawn_where_mujoco_has_them(self) -> None:
        vertices = "0 0 0 1 0 0 0 2 0 0 0 3"
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><asset><mesh name="m" vertex="{vertices}"/></asset>'
            '<worldbody><body><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
        )
        (shape,) = visible_shapes(model)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, shape.quaternion)
        placed = shape.vertices @ rotation.reshape(3, 3).T + shape.position
        assert np.ptp(placed, axis=0) == pytest.approx([1, 2, 3], abs=1e-5)
        assert placed.min(axis=0) == pytest.approx([0, 0, 0], abs=1e-5)


class TestScene:
    def test_what_is_drawn_stands_where_mujoco_says(self, go1: Robot, port: int) -> None:
        pytest.importorskip("viser")
        from footfall.pages.page import serving
        from footfall.pages.scene import Scene

        model = plant_model(go1)
        data = mujoco.MjData(model)
        data.qpos[:] = np.random.default_rng(0).normal(size=model.nq)
        mujoco.mj_normalizeQuat(model, data.qpos)
        mujoco.mj_kinematics(model, data)
        with serving("localhost", port, "test") as server:
            scene = Scene(server, go1, model)
            scene.show(data, np.zeros(3), np.zeros(3), follow=False)
            frames = {handle.name: handle for handle in scene.bodies.values()}
            shapes = visible_shapes(model)
            assert {shape.body for shape in shapes} == set(scene.bodies)
            for shape in shapes:
                frame = frames[scene.bodies[shape.body].name]
                place, turned = np.empty(3), np.empty(4)
                mujoco.mju_rotVecQuat(place, shape.position, np.asarray(frame.wxyz, dtype=float))
                mujoco.mju_mulQuat(turned, np.asarray(frame.wxyz, dtype=float), shape.quaternion)
                rotation = np.empty(9)
                mujoco.mju_quat2Mat(rotation, turned)
                assert frame.position + place == pytest.approx(data.geom_xpos[shape.geom], abs=1e-6)
                assert rotation == pytest.approx(data.geom_xmat[shape.geom], abs=1e-6)

    def test_before_anything_walks_the_robot_stands(self, go1: Robot) -> None:
        """In its default pose, its lowest foot on the ground, not its bodies heaped at the origin."""
        data = standing(go1).data
        model = plant_model(go1)
        mujoco.mj_kinematics(model, data)
        feet = [model.geom(foot.geoms[0]).id for foot in go1.description.feet]
        soles = data.geom_xpos[feet, 2] - model.geom_size[feet, 0]
        assert np.abs(soles).max() < 0.01
        assert data.body(go1.description.base).xpos[2] == pytest.approx(
            go1.description.standing_height_m, abs=0.02
        )


class TestPanel:
    @pytest.fixture
    def panel(self, port: int) -> Iterator[Panel]:
        pytest.importorskip("viser")
        from footfall.pages.page import serving

        with serving("localhost", port, "test") as server:
            panel = Panel(server)
            panel.offer_commands(CommandRange((-1.0, 1.8), (-0.7, 0.7), (-1.4, 1.4)))
            yield panel

    def test_a_typed_command_is_clipped_to_what_the_policy_was_trained_on(self, panel: Panel) -> None:
        for slider, typed in zip(panel._sliders, (99.0, -3.0, 0.2), strict=True):
            slider._impl.value = typed  # a browser's message, before anything has answered to it
        assert panel.command.tolist() == [1.8, -0.7, 0.2]

    def test_the_field_then_shows_what_it_was_clipped_to(self, panel: Panel) -> None:
        panel._sliders[0].value = 99.0
        wait_until(lambda: panel._sliders[0].value == 1.8, limit_s=5.0)

    def test_so_is_a_push(self, panel: Panel) -> None:
        panel._push_m_s.value, panel._push_asked = 50.0, True
        assert panel.take_push() == 4.0
        assert panel.take_push() == 0.0


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


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a checkpoint and the policy made of it. Its weights are all alike: no training needed."""
    jax = pytest.importorskip("jax")
    from footfall.train import api
    from footfall.train.brax.parts import assemble
    from footfall.train.runs import checkpoint

    folder = api.begin(api.TrainRequest(preset="smoke", out=tmp_path_factory.mktemp("runs") / "alike"))
    run = open_run(folder)
    shapes = assemble(run, load_robot("go1")).shapes
    state = jax.tree.map(lambda leaf: np.full(leaf.shape, 0.01).astype(leaf.dtype), shapes)
    seen = np.zeros((4, *shapes.observation["state"].shape[1:]), np.float32)
    checkpoint.save(run.checkpoints, 3, state, seen)
    api.export_run(folder)
    return folder


class TestSnapshots:
    @pytest.fixture
    def snapshots(self, begun: Path, tmp_path: Path) -> Iterator[Snapshots]:
        found = Snapshots(begun, tmp_path)
        yield found
        found.close()

    def wait_for(self, snapshots: Snapshots) -> Snapshot | None:
        """The next snapshot, or None if the newest checkpoint turns out to be of no use."""
        end = time.monotonic() + 240.0
        while time.monotonic() < end:
            if (snapshot := snapshots.poll()) is not None:
                return snapshot
            if snapshots.problem:
                return None
            time.sleep(0.05)
        pytest.fail("neither a snapshot nor a problem")

    def test_there_is_none_before_the_first_checkpoint(self, snapshots: Snapshots) -> None:
        assert snapshots.poll() is None
        assert snapshots.problem == ""

    def test_a_finished_policy_is_taken_as_it_is_and_once(self, finished: Path, tmp_path: Path) -> None:
        snapshots = Snapshots(finished, tmp_path)
        assert snapshots.poll() == Snapshot(finished / "policy.onnx", None)
        assert snapshots.poll() is None

    def test_checkpoints_are_exported_one_after_another_and_damaged_ones_skipped(
        self, trained: Path, begun: Path, snapshots: Snapshots
    ) -> None:
        (checkpoint,) = (trained / "checkpoints").iterdir()
        folder = begun / "checkpoints"
        folder.mkdir()
        shutil.copy(checkpoint, folder / "00000003.ckpt")
        before = sorted(begun.rglob("*"))
        assert snapshots.poll() is None
        assert snapshots.exporting == 3
        first = self.wait_for(snapshots)
        assert first is not None
        assert first.iteration == 3
        assert snapshots.exporting is None
        assert first.path.read_bytes() == (trained / "policy.onnx").read_bytes()
        assert sorted(begun.rglob("*")) == before  # the run folder is left as it was

        (folder / "00000004.ckpt").write_bytes(checkpoint.read_bytes()[:1000])
        assert self.wait_for(snapshots) is None
        assert "00000004.ckpt" in snapshots.problem
        assert snapshots.poll() is None

        shutil.copy(checkpoint, folder / "00000005.ckpt")
        snapshots.problem = ""
        after = self.wait_for(snapshots)
        assert after is not None
        assert after.iteration == 5

        (folder / "00000003.ckpt").unlink()
        shutil.copy(trained / "policy.onnx", begun)
        assert snapshots.names() == [NEWEST, FINISHED, "iteration 5", "iteration 4", "iteration 3"]
        for chosen, iteration in (("iteration 3", 3), (FINISHED, 5), ("iteration 5", 5)):
            snapshots.chosen = chosen
            shown = snapshots.poll()  # at once: each was exported before
            assert shown is not None
            assert shown.iteration == iteration

    def test_a_checkpoint_that_the_training_dropped_is_passed_over(
        self, trained: Path, begun: Path, snapshots: Snapshots
    ) -> None:
        (checkpoint,) = (trained / "checkpoints").iterdir()
        folder = begun / "checkpoints"
        folder.mkdir()
        dropped = Path(shutil.copy(checkpoint, folder / "00000003.ckpt"))
        assert snapshots.poll() is None  # its export begins, in a process that takes seconds to start
        dropped.unlink()
        shutil.copy(checkpoint, folder / "00000005.ckpt")
        after = self.wait_for(snapshots)
        assert snapshots.problem == ""
        assert after is not None
        assert after.iteration == 5

    def test_a_checkpoint_may_be_dropped_while_it_is_exported(
        self, begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def export_run(run: Path, out: Path, chosen: Path) -> tuple[Path, float]:
            checkpoint.unlink()
            out.write_bytes(chosen.read_bytes())
            return out, 0.0

        monkeypatch.setattr("footfall.train.api.export_run", export_run)
        checkpoint, out = begun / "00000003.ckpt", tmp_path / "00000003.onnx"
        checkpoint.write_bytes(b"weights")
        assert _export(begun, checkpoint, out) == Exported(out)
        assert out.read_bytes() == b"weights"
        assert list(tmp_path.glob("*.ckpt")) == []

    def test_what_was_exported_before_another_choice_is_not_shown(
        self, begun: Path, snapshots: Snapshots
    ) -> None:
        (begun / "checkpoints").mkdir()
        for iteration in (3, 5):
            (begun / "checkpoints" / f"{iteration:08d}.ckpt").touch()
        snapshots._exporter = SimpleNamespace(  # type: ignore[assignment]
            start=lambda *_: None, poll=lambda: Exported(Path("00000003.onnx")), close=lambda: None
        )
        snapshots.chosen = "iteration 3"
        assert snapshots.poll() is None
        assert snapshots.exporting == 3
        snapshots.chosen = NEWEST
        assert snapshots.poll() is None
        assert snapshots.exporting == 5


class TestPace:
    def test_it_keeps_to_the_wall_clock_and_does_not_catch_up_on_lost_time(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        now, slept = [100.0], []

        def sleep(time_s: float) -> None:
            slept.append(time_s)
            now[0] += time_s

        monkeypatch.setattr(
            "footfall.pages.walk.time", SimpleNamespace(monotonic=lambda: now[0], sleep=sleep)
        )
        pace = Pace()
        pace.wait(1.0)
        now[0] += 5.0  # something else took long
        pace.wait(1.5)
        pace.wait(2.0)
        assert slept == pytest.approx([1.0, 0.5])


class TestWalk:
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


@pytest.mark.parametrize(("process", "done"), [(0, ["check", "join", "serve"]), (1, ["join"])])
def test_of_several_processes_the_first_serves_the_page(
    monkeypatch: pytest.MonkeyPatch, process: int, done: list[str]
) -> None:
    def serve(*_: object) -> AbstractContextManager[None]:
        did.append("serve")
        return nullcontext()

    did: list[str] = []
    api = "footfall.train.api"
    monkeypatch.setattr(f"{api}.cluster.join", lambda *_: did.append("join"))
    monkeypatch.setattr(f"{api}.cluster.is_main_process", lambda: process == 0)
    monkeypatch.setattr(f"{api}.begin", lambda _: Path("run"))
    monkeypatch.setattr(f"{api}.resume", lambda _: Path("run"))
    monkeypatch.setattr("footfall.verbs.train._watched", serve)
    monkeypatch.setattr("footfall.pages.page.check_page", lambda *_: did.append("check"))
    options = TrainOptions(watch=True, evaluate=False)
    train(options=options, cluster=ClusterOptions("host:1", 2, process))
    assert did == done


class TestCommand:
    @pytest.fixture(autouse=True)
    def _needs_viser(self) -> None:
        pytest.importorskip("viser")

    def test_a_folder_that_is_no_run_is_told(self, shell: Shell, tmp_path: Path) -> None:
        assert "no run at" in shell.refuses("watch", tmp_path)

    def test_a_port_that_is_taken_is_told(self, shell: Shell, finished: Path, tmp_path: Path) -> None:
        with socket.create_server(("localhost", 0)) as taken:
            port = taken.getsockname()[1]
            for command in (["watch", finished], ["train", "--watch", "--out", tmp_path / "new"]):
                complaint = shell.refuses(*command, "--port", str(port))
                assert f"localhost:{port}" in complaint
                assert "--port" in complaint
        assert not (tmp_path / "new").exists()

    def test_every_address_of_a_name_is_tried(self, monkeypatch: pytest.MonkeyPatch, port: int) -> None:
        """But for those that this machine does not have, such as IPv6's where it is off."""

        def resolves_to(*addresses: tuple[str, int]) -> None:
            found = [(socket.AF_INET, socket.SOCK_STREAM, 0, "", address) for address in addresses]
            monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)

        with socket.create_server(("127.0.0.1", 0)) as taken:
            resolves_to(("127.0.0.1", port), ("203.0.113.1", port))
            check_page("name", port)
            resolves_to(("127.0.0.1", port), taken.getsockname())
            with pytest.raises(UserError, match=f"name:{port}: .*in use"):
                check_page("name", port)

    def test_a_port_that_was_just_let_go_is_free(self) -> None:
        """The system holds it for a while after a connection that the server ended."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
            with socket.create_connection(("127.0.0.1", port)) as visitor:
                server.accept()[0].close()
                assert visitor.recv(1) == b""
        check_page("127.0.0.1", port)

    @pytest.mark.parametrize("host", ["no.such.host.invalid", "203.0.113.1", "a..b"])
    def test_a_host_that_is_not_ours_is_told(self, shell: Shell, finished: Path, host: str) -> None:
        assert host in shell.refuses("watch", finished, "--host", host)

    def test_without_viser_the_extra_is_named(
        self, shell: Shell, finished: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(sys.modules, "viser", None)
        assert "[watch]'" in shell.refuses("watch", finished)
        assert "[watch]'" in shell.refuses("train", "--watch")

    def test_a_policy_of_another_robot_is_told(self, shell: Shell, begun: Path, port: int) -> None:
        onnx = pytest.importorskip("onnx")
        model = onnx.load(POLICY)
        (entry,) = (entry for entry in model.metadata_props if entry.key == "footfall.contract")
        entry.value = entry.value.replace('"robot": "go1"', '"robot": "other"')
        onnx.save(model, begun / "policy.onnx")
        outcome = shell("watch", begun, "--port", str(port))
        assert outcome.status == 2
        assert outcome.err.count("\n") == 1
        assert "does not fit" in outcome.err

    # Early on, packages are imported that swallow a KeyboardInterrupt; later on, a robot walks.
    @pytest.mark.parametrize(
        ("number", "delay_s"), [(signal.SIGINT, 0.1), (signal.SIGINT, 2.0), (signal.SIGTERM, 0.3)]
    )
    def test_it_ends_quietly(self, finished: Path, port: int, number: signal.Signals, delay_s: float) -> None:
        process = subprocess.Popen(
            [*FOOTFALL, "watch", finished, "--port", str(port)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            wait_until(lambda: listens(port))
            time.sleep(delay_s)
            process.send_signal(number)
            out, err = process.communicate(timeout=60)
        finally:
            process.kill()
        assert (process.returncode, err) == (0, "")
        assert out.count("\n") == 1
        assert f"http://localhost:{port}" in out

    def test_beside_a_training_it_lasts_as_long_as_the_training(self, begun: Path, port: int) -> None:
        from footfall.pages.beside import watched

        with watched(begun, "localhost", port):
            wait_until(lambda: listens(port))
        assert not listens(port)

    def test_it_does_not_outlive_a_training_that_is_killed(self, begun: Path, port: int) -> None:
        code = (
            "import sys, time; from pathlib import Path; from footfall.pages.beside import watched\n"
            "if __name__ == '__main__':\n"
            "    with watched(Path(sys.argv[1]), 'localhost', int(sys.argv[2])): time.sleep(60)\n"
        )
        script = begun.parent / "training.py"
        script.write_text(code)
        process = subprocess.Popen([sys.executable, script, begun, str(port)])
        wait_until(lambda: listens(port))
        process.kill()
        process.wait()
        wait_until(lambda: not listens(port))
