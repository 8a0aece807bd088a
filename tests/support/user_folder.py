"""A user's folder outside the repository: examples copied into it beside the user's own modules."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"

# Names of footfall's own rooms. Importing one of them instead of footfall's would end the command.
OWN_MODULES = ("train.py", "envs/__init__.py", "deploy/__init__.py", "policies/__init__.py", "common.py")


class UserFolder:
    """Runs a user's commands in this folder, in separate processes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        for name in OWN_MODULES:
            file = path / name
            file.parent.mkdir(exist_ok=True)
            file.write_text(f'raise SystemExit("the user\'s own {name} was imported")\n')

    def copy(self, *names: str) -> None:
        """Copy files or folders of `examples/` here."""
        for name in names:
            source = EXAMPLES / name
            if source.is_dir():
                shutil.copytree(source, self.path / name)
            else:
                shutil.copy(source, self.path)

    def python(self, *arguments: str) -> str:
        """The output of `python ARGUMENTS`, which must succeed."""
        done = self._run(*arguments)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    def footfall(self, *arguments: str) -> str:
        """The output of `footfall ARGUMENTS`, which must succeed."""
        return self.python("-P", "-m", "footfall", *arguments)

    def refused(self, *arguments: str) -> str:
        """The line with which `footfall ARGUMENTS` is refused."""
        done = self._run("-P", "-m", "footfall", *arguments)
        assert done.returncode == 2, done.stdout + done.stderr
        (line,) = done.stderr.splitlines()
        return line

    def _run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        command, environment = [sys.executable, *arguments], os.environ | {"OMP_NUM_THREADS": "1"}
        return subprocess.run(
            command, cwd=self.path, env=environment, capture_output=True, text=True, check=False
        )
