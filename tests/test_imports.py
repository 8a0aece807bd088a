"""Who may import whom, and what those that act may weigh."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COMMAND_LINE = "footfall"  # whose folder links to the others
COMMAND_LINE_MODULES = {path.stem for path in (ROOT / COMMAND_LINE).glob("*.py")} - {"__init__"} | {"verbs"}
LEARNING_ONLY = (
    "jax",
    "jaxlib",
    "brax",
    "torch",
    "rsl_rl",
    "tensordict",
    "flax",
    "optax",
    "mujoco.mjx",
    "onnx",
    "tensorboard",
)
DRAWING = ("jinja2", "matplotlib", "imageio_ffmpeg", "PIL", "scipy")  # not on a robot's small computer

# Each package, and those that it may import; itself always. footfall's own files may import all.
ALLOWED = {
    "common": set(),
    "robots": {"common"},
    "domain_rand": {"common", "robots"},
    "policies": {"common", "robots"},
    "deploy": {"common", "robots", "policies"},
    "plant": {"common", "robots", "policies", "domain_rand", "deploy"},
    "evaluate": {"common", "robots", "policies", "domain_rand", "deploy", "plant"},
    "envs": {"common", "robots", "policies", "domain_rand"},
    "train": {"common", "robots", "policies", "domain_rand", "envs"},
    "pages": {"common", "robots", "policies", "domain_rand", "deploy", "plant", "train"},
}
ACTING = ("common", "robots", "domain_rand", "policies", "deploy", "plant", "evaluate")
# What of policies those that learn may know. `learned` runs an exported file to check it.
POLICIES_FOR_LEARNING = {
    "footfall.policies.contract",
    "footfall.policies.observation",
    "footfall.policies.action",
    "footfall.policies.gaits",
    "footfall.policies.learned",
}
IMPORT_BUDGET_S = 1.0
CI_SLACK = 3.0  # a busy or cold machine imports slower; the figure itself is printed


def modules(package: str) -> Iterator[tuple[str, Path]]:
    """Dotted name and path of each module of a package."""
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        yield name if package == COMMAND_LINE else f"footfall.{name}", path


def imported(path: Path) -> set[str]:
    """Dotted names that a file imports, wherever in it the import stands."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return found


def belongs_to(name: str, packages: tuple[str, ...] | set[str]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


@pytest.mark.parametrize("package", ALLOWED)
def test_packages_import_one_way(package: str) -> None:
    forbidden = {
        f"footfall.{other}" for other in (set(ALLOWED) | COMMAND_LINE_MODULES) - ALLOWED[package] - {package}
    }
    wrong = [
        f"{module} imports {name}"
        for module, path in modules(package)
        for name in sorted(imported(path))
        if belongs_to(name, forbidden)
    ]
    assert wrong == []


@pytest.mark.parametrize("package", ["envs", "train"])
def test_learning_knows_policies_by_their_contract(package: str) -> None:
    wrong = [
        f"{module} imports {name}"
        for module, path in modules(package)
        for name in sorted(imported(path))
        if belongs_to(name, ("footfall.policies",))
        and name != "footfall.policies"
        and not belongs_to(name, POLICIES_FOR_LEARNING)
    ]
    assert wrong == []


@pytest.mark.parametrize("package", ACTING)
def test_acting_source_names_no_learning_library(package: str) -> None:
    wrong = [
        f"{module} imports {name}"
        for module, path in modules(package)
        for name in sorted(imported(path))
        if belongs_to(name, LEARNING_ONLY)
    ]
    assert wrong == []


IMPORT_WITHOUT_LEARNING = """
import importlib, json, sys, time

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if any(name == b or name.startswith(b + ".") for b in {blocked!r}):
            raise ImportError(f"{{name}} is for training alone")

sys.meta_path.insert(0, Blocker())
began = time.process_time()
for name in {names!r}:
    importlib.import_module(name)
print(json.dumps(time.process_time() - began))
"""


def import_apart(names: list[str], blocked: tuple[str, ...] = LEARNING_ONLY) -> float:
    """Import modules in a fresh interpreter, some packages cannot be imported; returns CPU seconds."""
    done = subprocess.run(
        [sys.executable, "-c", IMPORT_WITHOUT_LEARNING.format(blocked=blocked, names=names)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return float(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("package", [*ACTING, COMMAND_LINE])
def test_acting_modules_import_without_jax_and_torch(package: str) -> None:
    import_apart([name for name, _ in modules(package) if not name.endswith("__main__")])


@pytest.mark.parametrize("package", [*ACTING, COMMAND_LINE])
def test_only_the_report_needs_what_draws(package: str) -> None:
    names = [name for name, _ in modules(package) if not belongs_to(name, ("footfall.evaluate.report",))]
    outside = [name for name in names if not name.endswith("__main__")]
    import_apart([*outside, "footfall.evaluate.report.extra"] if package == "evaluate" else outside, DRAWING)


def test_the_blocker_blocks() -> None:
    with pytest.raises(AssertionError, match="for training alone"):
        import_apart(["jax"])


def test_packages_that_act_import_in_a_second(capsys: pytest.CaptureFixture[str]) -> None:
    """CPU time, which a busy machine does not lengthen much; best of three, when its files are in memory."""
    names = [name for package in ACTING for name, _ in modules(package)]
    seconds = min(import_apart(names, blocked=()) for _ in range(3))
    with capsys.disabled():
        print(f"\npackages that act import in {seconds:.2f} s of CPU time (budget {IMPORT_BUDGET_S} s)")
    assert seconds < IMPORT_BUDGET_S * CI_SLACK


def test_importing_packages_that_act_loads_no_learning_library() -> None:
    names = [name for package in ACTING for name, _ in modules(package)]
    code = (
        f"import importlib, sys\nfor n in {names!r}: importlib.import_module(n)\nprint(sorted(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = ast.literal_eval(done.stdout)
    assert [name for name in loaded if belongs_to(name, LEARNING_ONLY)] == []


DEPLOY_ON_SOCKETCAN = """
import sys
from footfall.cli import main
status = main(["deploy", "stand", "--bus", "socketcan"])
print(status, sorted(name for name in sys.modules if name.startswith("footfall.plant")))
"""


def test_deploying_on_a_robot_imports_no_simulated_one() -> None:
    done = subprocess.run(
        [sys.executable, "-c", DEPLOY_ON_SOCKETCAN], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert "cannot open bus 'can0' on socketcan" in done.stderr
    assert done.stdout.strip() == "2 []"
