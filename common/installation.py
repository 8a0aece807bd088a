"""Installed packages, and commands that install missing ones into this environment."""

import json
import shlex
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

from footfall.common.errors import UserError

if TYPE_CHECKING:
    from packaging.markers import Marker
    from packaging.requirements import Requirement

DISTRIBUTION = "footfall"


def install_command(*arguments: str) -> str:
    """An install command for this environment's pip; `pip` alone if a shell finds the same pip."""
    found = shutil.which("pip")
    same_pip = found is not None and Path(found).parent == Path(sys.executable).parent
    pip = ["pip"] if same_pip else [sys.executable, "-m", "pip"]
    return shlex.join([*pip, "install", *arguments])


def extras_command(*extras: str) -> str:
    """The command that adds extras of footfall to this environment.

    It names the clone or the wheel that footfall was installed from. If that is gone, or footfall came from
    an index, it names the packages of the extras.
    """
    origin = _recorded_origin()
    path = _local_path(origin.get("url", ""))
    if path is None:
        packages = dict.fromkeys(str(package) for extra in extras for package in requirements(extra))
        return install_command(*packages)
    where = "." if path == Path.cwd() else str(path)
    editable = ("--editable",) if origin.get("dir_info", {}).get("editable") else ()
    return install_command(*editable, f"{where}[{','.join(extras)}]")


@contextmanager
def needs_extra(extra: str, task: str) -> Iterator[None]:
    """Context for imports of an extra's libraries.

    Raises:
        UserError: one of them is not installed; the text begins with the task ("training needs").
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").split(".")[0]
        if library == DISTRIBUTION:
            raise
        raise UserError(f"{task} {library}, which is not installed: {extras_command(extra)}") from None


def extras() -> list[str]:
    """Names of footfall's extras."""
    return distribution(DISTRIBUTION).metadata.get_all("Provides-Extra") or []


def requirements(extra: str = "") -> "Iterator[Requirement]":
    """Requirements of an extra, included extras resolved; without a name, footfall's own."""
    from packaging.requirements import Requirement  # seldom needed, and the import would delay each start

    for text in distribution(DISTRIBUTION).requires or []:
        requirement = Requirement(text)
        if not _belongs_to(extra, requirement.marker):
            continue
        requirement.marker = None
        if requirement.name == DISTRIBUTION:
            for included in sorted(requirement.extras):  # a set's order differs between processes
                yield from requirements(included)
        else:
            yield requirement


def _belongs_to(extra: str, marker: "Marker | None") -> bool:
    if marker is None or marker.evaluate({"extra": ""}):
        return extra == ""
    return extra != "" and marker.evaluate({"extra": extra})


def missing(extra: str = "") -> "list[Requirement]":
    """Requirements that are not installed, or in a wrong version."""
    return [requirement for requirement in requirements(extra) if not _installed(requirement)]


def _installed(requirement: "Requirement") -> bool:
    try:
        return requirement.specifier.contains(version(requirement.name), prereleases=True)
    except PackageNotFoundError:
        return False


def _recorded_origin() -> dict:
    """Where footfall was installed from, as installers record it (PEP 610); empty for an index."""
    return json.loads(distribution(DISTRIBUTION).read_text("direct_url.json") or "{}")


def _local_path(url: str) -> Path | None:
    """The folder or file of a URL, if it is on this machine and still there."""
    parts = urlsplit(url)
    path = Path(unquote(parts.path))
    return path if parts.scheme == "file" and path.exists() else None
