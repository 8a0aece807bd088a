"""Import modules in a fresh interpreter."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


SCRIPT = """
import importlib, json, sys, time

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if any(name == b or name.startswith(b + ".") for b in {blocked!r}):
            raise ImportError(f"{{name}} is out of reach")

sys.meta_path.insert(0, Blocker())
began = time.process_time()
for name in {names!r}:
    importlib.import_module(name)
print(json.dumps([time.process_time() - began, sorted(sys.modules)]))
"""


def import_in_process(
    names: list[str], blocked: tuple[str, ...] = (), bytecode: Path | None = None
) -> tuple[float, list[str]]:
    """Import modules in a fresh interpreter in which some packages cannot be imported.

    Args:
        names: the modules.
        blocked: packages that cannot be imported.
        bytecode: folder for compiled modules, instead of those beside the sources.

    Returns:
        CPU seconds that it took, and the names of all modules that are loaded then.
    """
    environment = dict(os.environ)
    if bytecode is not None:
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        environment["PYTHONPYCACHEPREFIX"] = str(bytecode)
    command = [sys.executable, "-c", SCRIPT.format(blocked=blocked, names=names)]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    seconds, loaded = json.loads(done.stdout.splitlines()[-1])
    return seconds, loaded
