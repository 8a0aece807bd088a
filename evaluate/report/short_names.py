"""Names of policies as a page has room for them."""

from collections.abc import Sequence

LONGEST = 32  # characters: a column of a table, a line above a plot
_HEAD = 12  # of them before the gap; names of runs differ more at the end


def short_names(names: Sequence[str]) -> dict[str, str]:
    """For each a name of at most `LONGEST` characters, longer ones without their middle; no two are alike."""
    found: dict[str, str] = {}
    for name in names:
        short, count = _shortened(name, ""), 1
        while short in found.values() or (short != name and short in names):
            count += 1
            short = _shortened(name, f" ({count})")
        found[name] = short
    return found


def titled(name: str, what: str) -> str:
    """What stands above a policy's plot: its name and a figure, in two lines where they do not fit one."""
    return f"{name}: {what}" if len(name) + len(what) < LONGEST else f"{name}\n{what}"


def _shortened(name: str, ending: str) -> str:
    if len(name) + len(ending) <= LONGEST:
        return name + ending
    tail = LONGEST - _HEAD - 1 - len(ending)
    return f"{name[:_HEAD]}…{name[-tail:]}{ending}"
