"""`footfall log`: what can be done with a run's log."""

from pathlib import Path

from cyclopts import App

from footfall.common.outputs import check_outputs
from footfall.options import OptionalPath

log = App(name="log", help="Work on the log of a run.")


@log.command
def recover(file: Path, /, *, out: OptionalPath = None) -> int:
    """Give a log that was cut short or damaged its end, so that tools which need a file's index open it.

    Parameters
    ----------
    file
        The log.
    out
        Where to write the whole copy (default: FILE.recovered.mcap, beside it).
    """
    whole = file.parent / f"{file.stem}.recovered{file.suffix}" if out is None else out
    check_outputs(whole)
    from footfall.deploy.recover import recover as recover_log

    found = recover_log(file, whole)
    lost = f", {found.damaged} damaged parts left out" if found.damaged else ""
    print(f"{found.messages} messages in {whole}{lost}")
    return 0
