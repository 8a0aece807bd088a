"""The page's server, panel and processes: what each is made with, in a world that only takes notes."""

import errno
import logging
import multiprocessing
import os
import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("viser")

from footfall.common.errors import UserError
from footfall.pages import beside, handshake, page, snapshots
from footfall.pages.metrics_file import MetricsFile
from footfall.pages.panel import Panel
from footfall.pages.scene import Scene
from footfall.pages.snapshots import FINISHED, Exported, Exporter, Snapshot, Snapshots
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


class Notes:
    """Takes note of each call; what a call returns takes notes too, under the call's name and first word."""

    def __init__(self, log: list[Any], name: str = "") -> None:
        self.__dict__ |= {"_log": log, "_name": name}

    def __getattr__(self, name: str) -> Any:
        def call(*given: Any, **named: Any) -> "Notes":
            self._log.append((self._name, name, given, named))
            return Notes(self._log, str(given[0]) if given else name)

        return call

    def __enter__(self) -> "Notes":
        self._log.append((self._name, "within", (), {}))
        return self

    def __exit__(self, *_: object) -> None:
        self._log.append((self._name, "without", (), {}))


def calls(log: list[Any], name: str) -> list[tuple[tuple, dict[str, Any]]]:
    return [(given, named) for _, called, given, named in log if called == name]


class TestServing:
    @pytest.fixture
    def log(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        log: list[Any] = []
        logging.getLogger("websockets").setLevel(logging.NOTSET)

        class Server(SimpleNamespace):
            def __init__(self, *given: Any, **named: Any) -> None:
                print("a library's greeting")
                log.append(("made", given, named))
                super().__init__(gui=SimpleNamespace(main_panel=Notes(log, "panel")))
                self.gui.configure_theme = lambda **how: log.append(("theme", how))

            def stop(self) -> None:
                print("a library's farewell")
                log.append("stopped")

        @contextmanager
        def own_handshake(host: str) -> Iterator[None]:
            log.append(("ours", host))
            yield
            log.append("ours no more")

        monkeypatch.setattr("viser.ViserServer", Server)
        monkeypatch.setattr(page, "own_handshake", own_handshake)
        monkeypatch.setattr(page, "check_page", lambda *given: log.append(("checked", *given)))
        return log

    def test_a_page_is_checked_made_ours_and_stopped_without_a_word_of_the_library(
        self, log: list[Any], capsys: pytest.CaptureFixture[str]
    ) -> None:
        with page.serving("there", 123, "a label"):
            print("it is served")
            log.append("served")
        assert log == [
            ("checked", "there", 123), ("ours", "there"),
            ("made", ("there", 123), {"label": "a label", "verbose": False}), "ours no more",
            ("panel", "dock_right", (), {}),
            ("theme", {"show_logo": False, "show_share_button": False, "brand_color": (224, 112, 26)}),
            "served", "stopped",
        ]  # fmt: skip
        assert capsys.readouterr().out == "it is served\n"
        assert logging.getLogger("websockets").level == logging.CRITICAL

    def test_it_is_stopped_whatever_ends_it(self, log: list[Any]) -> None:
        with pytest.raises(KeyboardInterrupt), page.serving("there", 123, "x"):
            raise KeyboardInterrupt
        assert log[-1] == "stopped"

    def test_both_the_library_and_the_address_are_checked(self, monkeypatch: pytest.MonkeyPatch) -> None:
        checked: list[Any] = []
        monkeypatch.setattr(page, "_check_viser", lambda: checked.append("viser"))
        monkeypatch.setattr(page, "_check_address", lambda *given: checked.append(given))
        page.check_page("there", 123)
        assert checked == ["viser", ("there", 123)]

    def test_a_name_that_nobody_knows_is_told_with_the_reason(self, monkeypatch: pytest.MonkeyPatch) -> None:
        asked: list[Any] = []

        def unknown(*given: Any, **named: Any) -> None:
            asked.append((given, named))
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

        monkeypatch.setattr(socket, "getaddrinfo", unknown)
        with pytest.raises(UserError) as caught:
            page._check_address("there", 123)
        assert str(caught.value) == (
            "cannot serve a page at there:123: Name or service not known; give another --host or --port"
        )
        assert asked == [(("there", 123), {"type": socket.SOCK_STREAM})]

    def test_each_address_is_tried_as_it_was_found(self, monkeypatch: pytest.MonkeyPatch) -> None:
        tried: list[Any] = []
        found = [(socket.AF_INET, socket.SOCK_STREAM, 6, "its name", ("127.0.0.1", 123))]
        monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: found)
        monkeypatch.setattr(page, "_refusal", lambda *given: tried.append(given))
        page._check_address("there", 123)
        assert tried == [(socket.AF_INET, socket.SOCK_STREAM, 6, ("127.0.0.1", 123))]

    def test_no_address_of_this_machine_or_family_is_what_is_not_here(self) -> None:
        assert set(page.NOT_HERE) == {errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT}


class TestHandshake:
    def process(self, host: str | None, origin: str | None, path: str = "/x") -> list[Any]:
        """What is done with a request to a server at `lab.example`."""
        from websockets.asyncio import server

        log: list[Any] = []
        headers = {"Accept-Encoding": "gzip"}
        headers |= {k: v for k, v in (("Host", host), ("Origin", origin)) if v is not None}
        request = SimpleNamespace(headers=headers, path=path)
        connection = SimpleNamespace(respond=lambda *given: log.append(("refused", *given)))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(server, "serve", lambda *given, **named: log.append((given, named)))
            before = server.serve
            with handshake.own_handshake("lab.example"):
                server.serve("handler", 123, process_request=lambda *_: log.append("viser's"), option=7)
            assert server.serve is before
        (given, named) = log.pop(0)
        process = named.pop("process_request")
        assert (given, named) == (("handler", 123), {"option": 7})
        process(connection, request)
        log.append("Accept-Encoding" in headers)
        return log

    def test_what_is_allowed_is_left_to_viser(self) -> None:
        assert self.process("lab.example:123", None) == ["viser's", True]
        assert self.process("lab.example:123", "http://lab.example:123", "/index.htm") == ["viser's", True]

    def test_the_page_alone_is_asked_for_as_it_is(self) -> None:
        for path in ("/", "/index.html", "/?a=b"):
            assert self.process("localhost", None, path) == ["viser's", False]

    def test_what_is_not_is_refused_with_the_reason(self) -> None:
        assert self.process("evil.example", None)[0] == (
            "refused", 403,
            "this page is not served as 'evil.example': start it with --host evil.example,"
            " or use localhost\n",
        )  # fmt: skip
        assert self.process(None, None)[0][2] == (
            "this page is not served as '': start it with --host NAME, or use localhost\n"
        )
        assert self.process("localhost", "http://evil.example")[0][1:] == (
            403, "the page from http://evil.example may not connect to this server\n",
        )  # fmt: skip


class TestPanel:
    @pytest.fixture
    def log(self) -> list[Any]:
        return []

    @pytest.fixture
    def panel(self, log: list[Any]) -> Panel:
        return Panel(SimpleNamespace(gui=Notes(log)))  # type: ignore[arg-type]

    def test_what_is_on_it_before_there_is_a_policy(self, panel: Panel, log: list[Any]) -> None:
        assert calls(log, "add_folder") == [(("Command",), {"visible": False})]
        assert calls(log, "add_markdown") == [
            (("",), {}),
            (
                ("The policy was trained on these ranges; a number beyond one is clipped to it.",),
                {"order": -0.5},
            ),
            (("No curves yet: they begin with the second iteration.",), {}),
        ]
        ((words, how),) = calls(log, "add_dropdown")
        assert words == ("Policy", ("newest",))
        assert how == {"hint": "Checkpoints that the run keeps, and those shown before"}
        assert calls(log, "add_checkbox") == [(("Pause", False), {}), (("Follow", True), {})]
        assert calls(log, "add_slider") == [(("Push, m/s", 0.2, 4.0, 0.1, 1.0), {})]
        assert calls(log, "add_button") == [(("Push it",), {}), (("Start again",), {"color": "gray"})]
        assert calls(log, "add_tab") == [(("Curves",), {})]
        assert calls(log, "dock_left") == [((), {})]
        assert calls(log, "set_width") == [((320,), {})]

    def test_controls_are_in_the_folder_of_commands_and_curves_in_theirs(
        self, panel: Panel, log: list[Any]
    ) -> None:
        names = [name if kind in ("within", "without") else kind for name, kind, *_ in log]
        controls = names[names.index("Command") + 1 :]
        assert controls[: controls.index("Command")] == [
            "add_markdown", "add_dropdown", "add_checkbox", "add_checkbox", "add_slider", "add_button",
            "add_button",
        ]  # fmt: skip
        curves = names[names.index("Curves") + 1 :]
        assert curves[: curves.index("Curves")] == ["add_markdown"]

    def test_sliders_go_by_twentieths_above_the_rest_and_all_are_clipped(
        self, panel: Panel, log: list[Any]
    ) -> None:
        log.clear()
        panel.offer_commands(CommandRange((-1.0, 1.5), (-0.5, 0.5), (-0.9, 0.9)))
        assert calls(log, "add_slider") == [
            (("Forward, m/s", -1.0, 1.5, 0.05, 0.5), {"order": -1.0}),
            (("Left, m/s", -0.5, 0.5, 0.05, 0.0), {"order": -1.0}),
            (("Yaw, rad/s", -0.9, 0.9, 0.05, 0.0), {"order": -1.0}),
        ]
        assert [log[0][:2], log[4][:2]] == [("Command", "within"), ("Command", "without")]
        clipped = [(name, given[0]) for name, called, given, _ in log if called == "on_update"]
        assert [name for name, _ in clipped] == ["Forward, m/s", "Left, m/s", "Yaw, rad/s", "Push, m/s"]
        for _, clip in clipped:
            for typed, kept in ((9.0, 2.0), (-9.0, -1.0), (0.5, 0.5)):
                slider = SimpleNamespace(value=typed, min=-1.0, max=2.0)
                clip(SimpleNamespace(target=slider))
                assert slider.value == kept

    def test_a_chart_is_small_in_our_colour_and_tells_its_numbers(
        self, panel: Panel, log: list[Any], tmp_path: Path
    ) -> None:
        path = tmp_path / "metrics.jsonl"
        path.write_text('{"step": 1, "reward/total": 1}\n{"step": 2, "reward/total": 2}\n')
        metrics = MetricsFile(path)
        metrics.refresh()
        log.clear()
        panel.draw(metrics)
        ((_, series), how) = calls(log, "add_uplot")[0]
        assert [log[0][:2], log[-1][:2]] == [("Curves", "within"), ("Curves", "without")]
        assert series == (
            {"label": "million steps"},
            {"label": "value", "stroke": "#e0701a", "width": 2, "points": {"show": False}},
        )
        assert how == {
            "title": "Reward per second",
            "scales": {"x": {"time": False, "auto": True}, "y": {"auto": True}},
            "axes": ({"size": 28}, {"size": 44, "space": 20}),
            "legend": {"show": True, "live": True},
            "height": 100,
            "padding": (9, 18, 0, 0),
        }
        assert panel._axis.content == "Over million environment steps:"


def test_what_the_scene_is_made_of(go1: Robot) -> None:
    log: list[Any] = []
    server: Any = SimpleNamespace(
        scene=Notes(log), initial_camera=SimpleNamespace(), on_client_connect=lambda _: None
    )
    Scene(server, go1, plant_model(go1))
    height = go1.description.standing_height_m
    assert calls(log, "configure_default_lights") == [((), {"enabled": True, "cast_shadow": True})]
    frames = calls(log, "add_frame")
    assert frames[0] == (("/world",), {"show_axes": False})
    assert all(how == {"show_axes": False} for _, how in frames)
    ((name, grid),) = calls(log, "add_grid")
    assert name == ("/world/ground",)
    assert (grid["width"], grid["height"], grid["cell_size"], grid["section_size"]) == (200, 200, 0.5, 2.5)
    for (arrow, points, _), how in calls(log, "add_arrows"):
        assert arrow in ("/world/command", "/world/velocity")
        assert points.shape == (1, 2, 3)
        assert not points.any()
        sizes = [how[f"{part}"] / height for part in ("shaft_radius", "head_radius", "head_length")]
        np.testing.assert_allclose(sizes, [0.035, 0.08, 0.16])
        assert how["visible"] is False


class TestBeside:
    @pytest.fixture
    def log(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """What became of the process that serves the page."""
        log: list[Any] = []

        def context(kind: str) -> Any:
            log.append(kind)
            return SimpleNamespace(Process=lambda **how: log.append(how) or Notes(log, "process"))

        monkeypatch.setattr(beside.multiprocessing, "get_context", context)
        return log

    def test_a_process_serves_the_page_for_as_long_as_the_training_lasts(self, log: list[Any]) -> None:
        with beside.watched(Path("run"), "there", 123):
            log.append("training")
        how = {"target": beside._serve, "args": (Path("run"), "there", 123), "name": "watch"}
        assert [log[0], log[1], log[3]] == ["spawn", how, "training"]
        assert [log[k][1] for k in (2, 4, 5)] == ["start", "terminate", "join"]

    def test_it_ends_with_a_training_that_fails(self, log: list[Any]) -> None:
        with pytest.raises(ZeroDivisionError), beside.watched(Path("run"), "there", 123):
            raise ZeroDivisionError
        assert [each[1] for each in log[-2:]] == ["terminate", "join"]

    def test_in_it_the_page_is_served_at_low_priority_until_told_to_stop(
        self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
    ) -> None:
        log: list[Any] = []
        monkeypatch.setattr("footfall.pages.walk.watch", lambda *given: log.append(given))
        monkeypatch.setattr(beside, "_end_with_parent", lambda: None)
        monkeypatch.setattr(os, "nice", log.append)
        beside._serve(tmp_path, "there", 123)
        nice, (*given, stop) = log
        assert (nice, given) == (10, [tmp_path, "there", 123])
        assert stop.requested is False

    def test_when_the_training_is_gone_it_tells_itself_to_end(self, monkeypatch: pytest.MonkeyPatch) -> None:
        log: list[Any] = []
        parent = SimpleNamespace(join=lambda: log.append("gone"))
        monkeypatch.setattr(multiprocessing, "parent_process", lambda: parent)
        monkeypatch.setattr(os, "kill", lambda *given: log.append(given))
        beside._end_with_parent()
        assert log == ["gone", (os.getpid(), signal.SIGTERM)]


class TestExporter:
    def test_its_process_is_started_once_and_ended_with_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        log: list[Any] = []

        def context(kind: str) -> Any:
            log.append(kind)
            return SimpleNamespace(
                Pipe=lambda: (Notes(log, "ours"), Notes(log, "theirs")),
                Process=lambda **how: log.append(how) or Notes(log, "process"),
            )

        monkeypatch.setattr(snapshots.multiprocessing, "get_context", context)
        exporter = Exporter(Path("run"))
        exporter.close()  # nothing to end yet
        exporter.wake()
        exporter.wake()
        exporter.close()
        exporter.close()
        kind, how, *rest = log
        assert (kind, how["target"], how["daemon"]) == ("spawn", snapshots._export_on_demand, True)
        assert [end._name for end in how["args"]] == ["theirs"]
        assert [each[:2] for each in rest] == [
            ("process", "start"), ("theirs", "close"), ("ours", "close"), ("process", "terminate"),
            ("process", "join"),
        ]  # fmt: skip

    def test_who_asks_is_answered_until_he_is_gone(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("JAX_PLATFORMS", "cpu")
        monkeypatch.setattr("footfall.train.entry.learning_libraries", nullcontext)
        monkeypatch.setattr(snapshots.signal, "signal", lambda *_: None)
        monkeypatch.setattr(snapshots.os, "nice", lambda by: 12 if by == 0 else pytest.fail("nicer yet"))
        monkeypatch.setattr(snapshots, "_export", lambda *given: ("exported", *given))
        sent: list[Any] = []
        for end in (EOFError(), KeyboardInterrupt()):
            requests = iter([("run", "a", "b"), ("run", "c", "d"), end])

            def recv(requests: Iterator[Any] = requests) -> Any:
                request = next(requests)
                if isinstance(request, BaseException):
                    raise request
                return request

            ends: Any = SimpleNamespace(recv=recv, send=sent.append)
            snapshots._export_on_demand(ends)
        assert sent == [("exported", "run", "a", "b"), ("exported", "run", "c", "d")] * 2

    def test_a_full_disk_is_told_and_leaves_no_copy(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(*_: Any) -> None:
            raise OSError(errno.ENOSPC, "No space\n left")

        monkeypatch.setattr(snapshots, "_take", full)
        told = snapshots._export(tmp_path, tmp_path / "1.ckpt", tmp_path / "out" / "1.onnx")
        assert told == Exported(None, "[Errno 28] No space left")

    def test_a_checkpoint_is_taken_by_another_name_or_copied(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        file, copy = tmp_path / "1.ckpt", tmp_path / "copy"
        file.write_text("new")
        copy.write_text("old")
        snapshots._take(file, copy)
        assert copy.samefile(file)

        def elsewhere(*_: Any) -> None:
            raise OSError(errno.EXDEV, "another file system")

        monkeypatch.setattr(Path, "hardlink_to", elsewhere)
        snapshots._take(file, copy)
        assert (copy.read_text(), copy.samefile(file)) == ("new", False)
        monkeypatch.undo()
        file.unlink()
        with pytest.raises(FileNotFoundError):
            snapshots._take(file, copy)
        assert not copy.exists()


class TestSnapshots:
    def test_a_finished_policy_without_checkpoints_has_no_iteration(self, tmp_path: Path) -> None:
        (tmp_path / FINISHED).touch()
        found = Snapshots(tmp_path, tmp_path / "out")
        assert found.poll() == Snapshot(tmp_path / FINISHED, None)
        assert found.exporting is None

    def test_they_end_with_their_exporter(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        found, ended = Snapshots(tmp_path, tmp_path / "out"), []
        monkeypatch.setattr(found._exporter, "close", lambda: ended.append("ended"))
        assert found._exporter._run == tmp_path
        found.close()
        assert ended == ["ended"]
