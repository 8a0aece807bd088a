"""A fresh environment with a built wheel and only the packages that the wheel declares.

The packages are linked to from the environment that the tests run in: nothing is downloaded.
"""

import os
import subprocess
import sys
from collections.abc import Iterable
from importlib.metadata import Distribution, PathDistribution, distribution
from pathlib import Path

from packaging.requirements import Requirement


class FreshEnvironment:
    """A virtual environment, and the working folder of its commands."""

    def __init__(self, folder: Path, wheel: Path, *extras: str) -> None:
        self.folder = folder / "work"
        self.folder.mkdir(parents=True)
        self._venv = folder / "venv"
        self.run([sys.executable, "-m", "venv", "--without-pip", self._venv])
        self.python = self._venv / "bin" / "python"
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", self.python]
        self.run([*pip, "install", "--quiet", "--no-index", "--no-deps", wheel])
        [self.packages] = self._venv.glob("lib/python*/site-packages")
        [metadata] = self.packages.glob("footfall-*.dist-info")
        for found in _needed(PathDistribution(metadata), extras):
            self._link(found)

    def run(self, command: list, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a command, and fail with its error output if it fails."""
        done = self.try_to_run(command, **variables)
        assert done.returncode == 0, done.stderr
        return done

    def try_to_run(self, command: list, **variables: str) -> subprocess.CompletedProcess[str]:
        """Run a command, also if it fails. The tests' own search path is left out."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        return subprocess.run(
            command, cwd=self.folder, env=environment | variables, capture_output=True, text=True, check=False
        )

    def footfall(self, *tokens: str) -> list:
        """A command of footfall; modules are looked for in the present folder first, as python -m does."""
        return [self.python, "-m", "footfall", *tokens]

    def _link(self, found: Distribution) -> None:
        tops = {Path(file.parts[0]) for file in found.files or []} - {Path(".."), Path("__pycache__")}
        for top in tops:
            link = self.packages / top
            if top.suffix != ".pth" and not link.exists():
                link.symlink_to(found.locate_file(top))


def _needed(package: Distribution, extras: Iterable[str]) -> list[Distribution]:
    """Direct and indirect requirements of a package with some of its extras."""
    found: dict[str, Distribution] = {}
    waiting = [(package, extra) for extra in ("", *extras)]
    seen = set()
    for needing, extra in waiting:  # the list grows during the loop
        for requirement in map(Requirement, needing.requires or []):
            if requirement.marker is not None and not requirement.marker.evaluate({"extra": extra}):
                continue
            name = requirement.name
            if name != package.name and name not in found:
                found[name] = distribution(name)
            for included in ("", *requirement.extras):
                if (name, included) not in seen:
                    seen.add((name, included))
                    waiting.append((found.get(name, package), included))
    return list(found.values())
