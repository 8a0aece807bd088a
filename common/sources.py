"""footfall's own source files on the disk."""

from collections.abc import Iterable
from pathlib import Path

# Packages that training imports.
TRAINING = ("common", "domain_rand", "envs", "policies", "robots", "terrain", "train")


def read_sources(
    root: Path, packages: Iterable[str], kinds: Iterable[str] = ("*.py",)
) -> list[tuple[Path, bytes]]:
    """The files of some packages, sorted, with their content.

    Args:
        root: folder of the packages; paths are relative to it.
        packages: their names.
        kinds: patterns of file names.
    """
    found = {path for package in packages for kind in kinds for path in (root / package).rglob(kind)}
    return [(path.relative_to(root), path.read_bytes()) for path in sorted(found)]
