"""How many small faults the tests of the pure modules notice: mutation testing with mutmut.

    pip install mutmut
    python benchmarks/mutations.py                            # every module of the table below
    python benchmarks/mutations.py --modules robots/actuator.py --show

mutmut changes one operator, number or argument of a function at a time and runs the module's tests. A change
that no test notices is a hole in the tests, or a change that makes no difference. Module-level constants and
what only the whole suite holds are not counted; a module's tests are the ones named here.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

ROOT = Path(__file__).parents[1]
MODULES: dict[str, tuple[str, ...]] = {
    "common/rotations.py": ("common/test_rotations.py",),
    "robots/actuator.py": ("robots/test_actuator.py",),
    "robots/targets.py": ("deploy/test_joint_layer.py", "robots/test_description.py"),
    "domain_rand/distributions.py": ("domain_rand/test_declaration.py",),
    "policies/action.py": ("policies/test_observation.py", "policies/test_contract.py"),
    "policies/observation.py": ("policies/test_observation.py",),
    "envs/rewards.py": ("envs/test_rewards.py",),
    "envs/delays.py": ("envs/test_env_parts.py",),
    "deploy/drivers/mit.py": ("deploy/test_mit.py",),
    "deploy/drivers/imu.py": ("deploy/test_imu.py",),
    "deploy/safety.py": ("deploy/test_safety.py",),
    "evaluate/statistics.py": ("evaluate/test_statistics.py",),
    "evaluate/metrics.py": ("evaluate/test_metrics.py",),
}
SETTINGS = """
[tool.mutmut]
source_paths = ["footfall"]
only_mutate = ["footfall/{module}"]
pytest_add_cli_args_test_selection = [{tests}]
pytest_add_cli_args = ["-q", "-x", "-p", "no:cacheprovider"]
"""


class Score(NamedTuple):
    """What became of a module's mutants."""

    noticed: int
    total: int
    missed: list[str]  # names of mutants


def main() -> None:
    """Mutate, test, print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--modules", nargs="*", default=list(MODULES), help="of the table in this file")
    parser.add_argument("--show", action="store_true", help="print the changes that were not noticed")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    unknown = [module for module in options.modules if module not in MODULES]
    if unknown:
        parser.error(f"no module {unknown[0]}: there are {', '.join(MODULES)}")
    if shutil.which(mutmut()) is None:
        parser.error("mutmut is missing: pip install mutmut")
    scores = {}
    for module in options.modules:
        with tempfile.TemporaryDirectory() as folder:
            scores[module] = score(module, Path(folder), options.workers, options.show)
        noticed, total, _ = scores[module]
        print(f"{module}: {noticed} of {total} noticed", flush=True)
    show(scores)
    if options.json:
        content = {module: found._asdict() for module, found in scores.items()}
        options.json.write_text(json.dumps(content, indent=1) + "\n")


def score(module: str, folder: Path, workers: int, show_missed: bool) -> Score:
    """Mutate one module in a copy of the package, whose links become folders."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "footfall", folder / "footfall", ignore=ignored)
    shutil.copytree(ROOT / "tests", folder / "tests", ignore=ignored)
    tests = ", ".join(f'"tests/{name}"' for name in MODULES[module])
    (folder / "pyproject.toml").write_text(SETTINGS.format(module=module, tests=tests))
    run = subprocess.run(
        [mutmut(), "run", "--max-children", str(workers)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    ask(folder, "export-cicd-stats")
    stats_file = folder / "mutants" / "mutmut-cicd-stats.json"
    if not stats_file.exists():
        raise SystemExit(f"{module}: mutmut failed\n{(run.stdout + run.stderr)[-2000:]}")
    stats = json.loads(stats_file.read_text())
    lines = ask(folder, "results").splitlines()
    missed = [name for name, _, state in (line.strip().partition(": ") for line in lines) if "surv" in state]
    if show_missed:
        for name in missed:
            print(ask(folder, "show", name))
    return Score(stats["killed"] + stats["timeout"] + stats["segfault"], stats["total"], missed)


def ask(folder: Path, *arguments: str) -> str:
    """What a command of mutmut prints."""
    return subprocess.run(
        [mutmut(), *arguments], cwd=folder, capture_output=True, text=True, check=False
    ).stdout


def mutmut() -> str:
    """The command beside this Python, or on the path."""
    beside = Path(sys.executable).with_name("mutmut")
    return str(beside) if beside.exists() else "mutmut"


def show(scores: dict[str, Score]) -> None:
    """The table."""
    table = Table("module", "noticed", "of", "share", box=None)
    total = Score(sum(s.noticed for s in scores.values()), sum(s.total for s in scores.values()), [])
    for name, found in [*scores.items(), ("all", total)]:
        share = f"{found.noticed / found.total:.0%}" if found.total else "-"
        table.add_row(name, str(found.noticed), str(found.total), share)
    Console().print(table)


if __name__ == "__main__":
    main()
