"""The command sources by name."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

from footfall.common.config import load, structure
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.common.outside import shipped
from footfall.common.yaml_text import parse_yaml
from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.open_source import OpenSource

PAGE_SOURCES = ("cockpit",)  # sources that are opened together with a run's pages
YAML = (".yaml", ".yml")


class Source(NamedTuple):
    """A command source. Its module is imported when it is selected."""

    import_path: str  # MODULE:FUNCTION, context manager of inbox, abilities and settings; yields `OpenSource`
    settings: str  # MODULE:NAME of its settings' dataclass
    about: str


SOURCES = {
    "keyboard": Source(
        "footfall.operate.keyboard:steered_by_keyboard",
        "footfall.operate.keyboard:KeyboardConfig",
        "keys of this terminal",
    ),
    "gamepad": Source(
        "footfall.operate.gamepad:steered_by_gamepad",
        "footfall.operate.gamepad:GamepadConfig",
        "a gamepad on this computer",
    ),
    "udp": Source(
        "footfall.operate.udp:steered_by_udp",
        "footfall.operate.udp:UdpConfig",
        "a program on this computer or another one",
    ),
    "ros2": Source(
        "footfall.operate.ros2.run:steered_by_ros2",
        "footfall.operate.ros2.bridge_process:Ros2Config",
        "topics, services and an action of ROS 2",
    ),
}


def is_mission(name: str) -> bool:
    """Whether a name is a mission file."""
    return Path(name).suffix.lower() in YAML and name.partition(":")[0] not in SOURCES


def check_source(name: str) -> None:
    """Raise UserError unless the name is a source or a mission file."""
    kind = name.partition(":")[0]
    if kind not in SOURCES and not is_mission(name):
        known = [*SOURCES, *PAGE_SOURCES]
        raise UserError(
            f"--from {name}: give one of {', '.join(known)}, or a mission's YAML file"
            f"{did_you_mean(kind, known)}"
        )


@contextmanager
def open_source(name: str, inbox: Inbox, abilities: Callable[[str], Abilities]) -> Iterator[OpenSource]:
    """Open a source that sends requests to the inbox, while the context is open.

    Args:
        name: name of the source; after a colon a YAML file with its settings, or the value of the first
            setting: `gamepad:/dev/input/js1`.
        inbox: gets the requests.
        abilities: returns the abilities of a policy of the run by its name.

    Raises:
        UserError: the source does not exist, or cannot be opened.
    """
    check_source(name)
    kind, _, argument = name.partition(":")
    source = SOURCES[kind]
    context: AbstractContextManager[OpenSource] = shipped(source.import_path)(
        inbox, abilities, _settings(shipped(source.settings), argument, f"--from {name}")
    )
    with context as opened:
        yield opened


def _settings(cls: Any, argument: str, where: str) -> Any:
    if Path(argument).suffix.lower() in YAML:
        return load(Path(argument), cls)
    if not argument:
        return cls()
    first = fields(cls)[0]
    try:
        value = argument if first.type is str else parse_yaml(argument)
    except ValueError as error:
        raise UserError(f"{where}: {error}") from None
    return structure({first.name: value}, cls, where)
