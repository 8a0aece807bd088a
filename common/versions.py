"""Versions of the packages that a result was made with."""

import platform
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, version


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Version of Python and of each installed package, by name."""
    return {"python": platform.python_version()} | {name: _version(name) for name in packages}


@cache  # each takes milliseconds: the package's folder is searched for in all of sys.path
def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed as a package"
