"""The command line: options, their limits, and the exit status for each result of a verb."""

import io
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from recorder import Recorder
from shell import Shell

from footfall import cli
from footfall.common.errors import UserError
from footfall.machine import Finding


class TestLimits:
    """The last accepted value and the first refused value."""

    @pytest.mark.parametrize(
        ("option", "taken", "refused"),
        [
            ("--seed", "2147483647", "2147483648"), ("--seed", "0", "-1"), ("--episodes", "1", "0"),
            ("--workers", "1", "0"), ("--episodes", "3", "1e3"),
        ],
    )  # fmt: skip
    def test_of_numbers(self, shell: Shell, called: Recorder, option: str, taken: str, refused: str) -> None:
        called.replace("footfall.evaluate.api.evaluate_policy", {"scenarios": {}})
        assert shell("evaluate", "stand", option, taken).status == 0
        assert getattr(called.of("evaluate_policy")[0][1], option[2:]) == int(taken)
        assert option in shell.refuses("evaluate", "stand", option, refused)

    def test_of_ports(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.pages.walk.watch")
        for port in (1, 65535):
            called.calls.clear()
            assert shell("watch", "run", "--host", "there", "--port", str(port)).status == 0
            assert called.of("watch")[0][:3] == (Path("run"), "there", port)
        for port in ("0", "65536", "80.5"):
            assert "--port" in shell.refuses("watch", "run", "--port", port)

    def test_of_a_velocity(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.plant.episode.run_episode", refuse)
        assert shell.refuses("deploy", "stand", "--command", "-100,99.5,100") == "enough"
        (_, _, episode), _ = called.of("run_episode")
        request = episode.command_source.poll(SimpleNamespace(walking_s=3.0))
        assert request.velocity.tolist() == [-100.0, 99.5, 100.0]
        for command in ("0.5", "0.5,0", "0.5,0,0,0", "nan,0,0", "a,0,0", "0,0,101", "0,-100.1,0"):
            assert "expected three numbers" in shell.refuses("deploy", "stand", f"--command={command}")

    def test_a_page_is_served_on_this_machine_alone_by_default(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.pages.walk.watch")
        assert shell("watch", "run").status == 0
        assert called.of("watch")[0][:3] == (Path("run"), "localhost", 8080)
        called.calls.clear()
        assert shell("watch", "go1-flat").status == 0  # a policy of the zoo
        assert (called.of("watch")[0][0] / "config.yaml").is_file()


def refuse(*_: Any, **__: Any) -> None:
    raise UserError("enough")


class TestEndings:
    @pytest.mark.parametrize(
        ("verb", "status", "result"),
        [
            (lambda: None, 0, ""), (lambda: 3, 3, ""), (lambda: "text", 0, ""),
            (UserError("a\n  b"), 2, "footfall: a b\n"), (OSError(28, "No space left"), 2, "No space left"),
            (KeyboardInterrupt(), 130, "footfall: interrupted\n"),
            (BrokenPipeError(32, "Broken pipe"), 141, ""), (SystemExit(1), 141, ""),
        ],
    )  # fmt: skip
    def test_status_and_line(
        self,
        shell: Shell,
        monkeypatch: pytest.MonkeyPatch,
        verb: Callable | BaseException,
        status: int,
        result: str,
    ) -> None:
        def app(*_: Any, **__: Any) -> Any:
            if isinstance(verb, BaseException):
                raise verb
            return verb()

        monkeypatch.setattr(cli, "app", app)
        outcome = shell("train")
        assert outcome.status == status
        assert result in outcome.err
        assert outcome.err.count("\n") == (1 if result else 0)

    def test_a_defect_keeps_its_traceback(self, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(cli, "app", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            shell("train")

    @pytest.mark.parametrize(
        ("error", "status"), [(BrokenPipeError(), 141), (OSError(28, "No space left on device"), 2)]
    )
    def test_output_that_reaches_no_reader_is_noticed_before_the_end(
        self, monkeypatch: pytest.MonkeyPatch, error: OSError, status: int
    ) -> None:
        """Printed text may wait in a buffer until the process ends, and its failure with it."""

        class Pipe(io.StringIO):
            def flush(self) -> None:
                raise error

        monkeypatch.setattr(cli, "app", lambda *_, **__: 0)
        monkeypatch.setattr(sys, "stdout", Pipe())
        assert cli.main(["doctor"]) == status

    def test_sigterm_lets_a_verb_close_all(self, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
        closed: list[str] = []

        def verb(*_: object, **__: object) -> None:
            try:
                signal.raise_signal(signal.SIGTERM)
            finally:
                closed.append("pool")

        before = signal.getsignal(signal.SIGTERM)
        monkeypatch.setattr(cli, "app", verb)
        outcome = shell("train")
        assert (outcome.status, outcome.err) == (143, "footfall: terminated\n")
        assert closed == ["pool"]
        assert signal.getsignal(signal.SIGTERM) is before

    def test_a_verb_may_run_in_a_thread_without_signals(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(cli, "app", lambda *_, **__: 7)
        statuses: list[int] = []
        thread = threading.Thread(target=lambda: statuses.append(cli.main(["doctor"])))
        thread.start()
        thread.join()
        assert statuses == [7]

    def test_characters_missing_in_the_terminals_encoding_become_codes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def verb(*_: Any, **__: Any) -> None:
            print("caf\xe9")

        for name, tokens in (("stdout", []), ("stderr", ["doctor", "caf\xe9"])):
            with monkeypatch.context() as patch:
                written = io.BytesIO()
                patch.setattr(sys, name, io.TextIOWrapper(written, "ascii", write_through=True))
                if name == "stdout":
                    patch.setattr(cli, "app", verb)
                cli.main(tokens)
                assert b"caf\\xe9" in written.getvalue()

    @pytest.mark.parametrize("name", ["stdout", "stderr"])
    def test_a_closed_output_is_ignored(self, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
        monkeypatch.setattr(cli, "app", lambda *_, **__: print("x", file=getattr(sys, name), flush=True))
        monkeypatch.setattr(sys, name, None)
        assert cli.main(["doctor"]) == 0

    def test_an_unknown_option_differs_from_a_misspelt_one(self, shell: Shell) -> None:
        assert "Did you mean --seed?" in shell.refuses("train", "--sed", "3")
        assert "Did you mean --episodes?" in shell.refuses("evaluate", "stand", "--epsiodes=3")
        terrain = shell.refuses("train", "--terrain", "rough")
        assert "--set KEY=VALUE" in terrain
        assert "mean" not in terrain


class TestSmallVerbs:
    def test_every_verb_explains_itself(self, shell: Shell) -> None:
        for verb in (
            "train", "sweep", "watch", "evaluate", "export", "deploy", "compare", "replay", "log", "demo",
            "diagnose", "doctor",
        ):  # fmt: skip
            explained = shell(verb, "--help")
            assert (explained.status, f"footfall {verb}" in explained.out) == (0, True), verb
        assert shell("--version").out.strip().count(".") == 2

    def test_export_writes_to_the_given_path(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.train.api.export_run", (Path("x.onnx"), 1.25e-7))
        for options, out in ((("--out", "mine.onnx"), Path("mine.onnx")), ((), None)):
            called.calls.clear()
            outcome = shell("export", "run", *options)
            assert called.of("export_run") == ((Path("run"), out), {})
            assert "x.onnx" in outcome.out
            assert "1.2e-07" in outcome.out

    @pytest.mark.parametrize(("reason", "status"), [("nan again", 0), (None, 1)])
    def test_diagnose_names_the_first_non_finite_value(
        self, shell: Shell, called: Recorder, reason: str | None, status: int
    ) -> None:
        found = SimpleNamespace(
            failure=SimpleNamespace(iteration=12, reason="nan then"), differences=["another JAX", "a CPU"],
            reason=reason, finding="the reward", saved=Path("s.npz"),
        )  # fmt: skip

        def diagnose(_: Path, say: Callable[[str], None]) -> Any:
            say("iteration 11 is sound")
            return found

        called.replace("footfall.train.api.diagnose", diagnose)
        outcome = shell("diagnose", "run")
        assert outcome.status == status
        for fact in ("11 is sound", "another JAX; a CPU", "nan then", reason or "no", "the reward", "s.npz"):
            assert fact in outcome.out
        found.differences, found.saved = [], None
        assert len(shell("diagnose", "run").out.splitlines()) == 4

    def test_a_recovered_log_is_beside_its_file(self, shell: Shell, called: Recorder, tmp_path: Path) -> None:
        recovered = SimpleNamespace(messages=42, damaged=0)
        called.replace("footfall.deploy.recover.recover", recovered)
        assert "there is no folder" in shell.refuses("log", "recover", "a.mcap", "--out", "absent/b.mcap")
        assert called.names == []
        (tmp_path / "logs").mkdir()
        outcome = shell("log", "recover", "logs/walk.mcap")
        assert called.of("recover") == ((Path("logs/walk.mcap"), Path("logs/walk.recovered.mcap")), {})
        assert outcome.out == f"42 messages in {Path('logs/walk.recovered.mcap')}\n"
        called.calls.clear()
        recovered.damaged = 3
        assert "3 damaged parts skipped" in shell("log", "recover", "logs/walk.mcap", "--out", "none").out
        assert called.of("recover")[0][1] == Path("none")

    def test_doctor_shows_problems_and_remedies(self, shell: Shell, called: Recorder) -> None:
        advice = "pip install 'footfall[everything]' and much more besides, in one line " + "to copy " * 9
        found = [Finding("processors", True, "2 cores"), Finding("packages", False, "jax is missing", advice)]
        called.replace("footfall.machine.findings", found)
        lines = shell("doctor").out.splitlines()
        assert "2 cores" in lines[0]
        assert "jax is missing" in lines[1]
        assert [line.strip() for line in lines[2:]] == [f"packages: {advice}".strip()]
