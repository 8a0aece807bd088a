"""Names of policies, shortened to fit a page."""

from collections.abc import Sequence

LONGEST = 32  # characters: a column of a table, a line above a plot
_HEAD = 12  # characters before the ellipsis; names of runs differ more at the end


def short_names(names: Sequence[str]) -> dict[str, str]:
    """A unique name of at most `LONGEST` characters for each; longer names lose their middle."""
    found: dict[str, str] = {}
    for name in names:
        short, count = _shortened(name, ""), 1
        while short in found.values() or (short != name and short in names):
            count += 1
            short = _shortened(name, f" ({count})")
        found[name] = short
    return found


def titled(name: str, what: str) -> str:
    """Title of a policy's plot: its name and a figure, in two lines if they do not fit in one."""
    return f"{name}: {what}" if len(name) + len(what) < LONGEST else f"{name}\n{what}"


def _shortened(name: str, ending: str) -> str:
    if len(name) + len(ending) <= LONGEST:
        return name + ending
    tail = LONGEST - _HEAD - 1 - len(ending)
    return f"{name[:_HEAD]}…{name[-tail:]}{ending}"
