"""The command line: parses, runs a verb, and turns an error into one line and an exit status."""

import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from importlib.metadata import version
from itertools import takewhile

from cyclopts import App, CycloptsError, UnknownOptionError, UnusedCliTokensError

from footfall.common.blocking_threads import any_call_blocked
from footfall.common.errors import UserError
from footfall.exit_status import BAD_INPUT, BROKEN_PIPE, INTERRUPTED, TERMINATED
from footfall.output import discard_output

VERBS = (
    "train", "sweep", "watch", "evaluate", "export", "deploy", "compare", "replay", "log", "identify",
    "robot", "can", "bring_up", "demo", "diagnose", "doctor", "list",
)  # fmt: skip
FUNCTION_NAMES = {"list": "list_names"}  # a verb's function, if its name differs from the verb's
MIN_SIMILARITY = 0.75  # similarity of two option names above which one is suggested

app = App(
    name="footfall",
    help="Legged robots: train a policy, evaluate it, run it over CAN, compare it with other controllers.",
    version=lambda: version("footfall"),
    suppress_keyboard_interrupt=False,
)
for verb in VERBS:  # a verb's module is imported when the verb is used
    app.command(f"footfall.verbs.{verb}:{FUNCTION_NAMES.get(verb, verb)}", name=app.name_transform(verb))
_import_verbs = app.resolved_commands


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.

    Bad input ends in one line on stderr and status 2. Any other exception is a defect of footfall and keeps
    its traceback.
    """
    arguments = list(sys.argv[1:] if tokens is None else tokens)
    _replace_closed_streams()
    _escape_unencodable()
    if "" in arguments:
        return _print_error(f"an empty argument: give a value, or leave it out {_help_hint(arguments)}")
    try:
        if not arguments or arguments[0].startswith("-"):
            _import_verbs()  # the help describes all of them
        with _interrupted_by_sigterm():
            status = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
            if not any_call_blocked():
                sys.stdout.flush()
    except CycloptsError as error:
        return _print_error(f"{_parse_error(error, arguments)} {_help_hint(arguments)}")
    except UserError as error:
        return _print_error(_one_line(error))
    except (BrokenPipeError, SystemExit):  # the reader of the output has closed it; rich raises SystemExit
        discard_output()
        return BROKEN_PIPE
    except OSError as error:  # a full disk, a file that was removed
        discard_output()
        return _print_error(_one_line(error))
    except _TerminatedError:
        return _print_error("terminated", TERMINATED)
    except KeyboardInterrupt:
        return _print_error("interrupted", INTERRUPTED)
    return status if isinstance(status, int) else 0


class _TerminatedError(KeyboardInterrupt):
    """SIGTERM: the verb ends as after Ctrl-C, with another exit status."""


@contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """Let SIGTERM unwind open contexts, such as process pools, as Ctrl-C does."""

    def terminate(*_: object) -> None:
        # `timeout` sends two signals; the second one would interrupt the clean-up.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise _TerminatedError

    if threading.current_thread() is not threading.main_thread():  # signals reach only the main thread
        yield
        return
    previous = signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def _replace_closed_streams() -> None:
    """Replace a standard stream that was closed before the start (`>&-`), which is None in Python."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115


def _escape_unencodable() -> None:
    """Print characters that the terminal's encoding lacks as escape codes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _print_error(reason: str, status: int = BAD_INPUT) -> int:
    print(f"footfall: {reason}", file=sys.stderr)
    return status


def _parse_error(error: CycloptsError, arguments: list[str]) -> str:
    if isinstance(error, UnusedCliTokensError) and error.unused_tokens:
        return _unexpected(error.unused_tokens[0], arguments)
    if isinstance(error, UnknownOptionError):
        return _unknown_option(error)
    return _one_line(error).removesuffix(".")


def _unknown_option(error: UnknownOptionError) -> str:
    """Message about an unknown option, with a suggestion if a similar one exists."""
    name = (error.token.keyword or error.token.value).partition("=")[0]
    known = {each for argument in error.argument_collection for each in argument.names}
    similar = get_close_matches(
        name.lstrip("-"), [each.lstrip("-") for each in known], n=1, cutoff=MIN_SIMILARITY
    )
    hint = "".join(f". Did you mean --{each}?" for each in similar)
    if not similar and {"--preset", "--set"} <= known:
        hint = "; change a setting by --set KEY=VALUE"
    return f"Unknown option: {name}{hint}"


def _unexpected(argument: str, arguments: list[str]) -> str:
    """Message about a superfluous argument. After an option's value it may be meant as another value."""
    *_, option, _ = ["", "", *takewhile(lambda earlier: earlier != argument, arguments)]
    hint = f"; to give {option} several values, join them with commas" if option.startswith("--") else ""
    return f"unexpected argument '{argument}'{hint}"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _help_hint(arguments: list[str]) -> str:
    commands, *_ = app.parse_commands(arguments)
    return f"(see {' '.join(('footfall', *commands))} --help)"
