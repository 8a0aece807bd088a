"""Names of policies, shortened to fit a page."""

from collections.abc import Sequence

MAX_CHARS = 32  # characters: a column of a table, a line above a plot
_HEAD_CHARS = 12  # characters before the ellipsis; names of runs differ more at the end


def short_names(names: Sequence[str]) -> dict[str, str]:
    """A unique name of at most `MAX_CHARS` characters for each; longer names lose their middle."""
    unique: dict[str, str] = {}
    for name in names:
        short, count = _shortened(name, ""), 1
        while short in unique.values() or (short != name and short in names):
            count += 1
            short = _shortened(name, f" ({count})")
        unique[name] = short
    return unique


def titled(name: str, what: str) -> str:
    """Title of a policy's plot: its name and a figure, in two lines if they do not fit in one."""
    return f"{name}: {what}" if len(name) + len(what) < MAX_CHARS else f"{name}\n{what}"


def _shortened(name: str, ending: str) -> str:
    if len(name) + len(ending) <= MAX_CHARS:
        return name + ending
    tail = MAX_CHARS - _HEAD_CHARS - 1 - len(ending)
    return f"{name[:_HEAD_CHARS]}…{name[-tail:]}{ending}"
