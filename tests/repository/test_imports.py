"""Permitted imports between modules, and the import time of the packages that act."""

import ast
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from import_in_process import ROOT, import_in_process

COMMAND_LINE = "src/footfall"  # this folder has links to the other packages
COMMAND_LINE_MODULES = {path.stem for path in (ROOT / COMMAND_LINE).glob("*.py")} - {"__init__"} | {"verbs"}
LEARNING_ONLY = (
    *("jax", "jaxlib", "brax", "torch", "rsl_rl", "tensordict", "flax", "optax", "mujoco.mjx", "onnx"),
    "tensorboard",
)
DRAWING = ("jinja2", "matplotlib", "imageio_ffmpeg", "PIL", "scipy")  # not installed on a robot's computer

# Each package, and the other packages that it may import. The package footfall may import all.
ALLOWED = {
    "common": set(),
    "robots": {"common"},
    "domain_rand": {"common", "robots"},
    "terrain": {"common"},
    "policies": {"common", "robots"},
    "deploy": {"common", "robots", "policies"},
    "operate": {"common", "robots", "policies", "deploy"},
    "plant": {"common", "robots", "policies", "domain_rand", "terrain", "deploy"},
    "evaluate": {"common", "robots", "policies", "domain_rand", "terrain", "deploy", "plant"},
    "identify": {"common", "robots", "policies", "domain_rand", "deploy", "plant"},
    "envs": {"common", "robots", "policies", "domain_rand", "terrain"},
    "train": {"common", "robots", "policies", "domain_rand", "envs"},
    "pages": {"common", "robots", "policies", "domain_rand", "deploy", "operate", "plant", "train"},
}
ROOMS = (*ALLOWED, COMMAND_LINE)
ACTING = tuple(room for room in ALLOWED if room not in ("envs", "train", "pages"))
# Modules of policies that training may import. `learned` runs an exported file to check it.
POLICIES_FOR_LEARNING = {
    f"footfall.policies.{name}"
    for name in ("contract", "observation", "height_scan", "action", "gaits", "learned")
}
# Modules that need packages which footfall does not install: rclpy of a ROS installation, or an optional
# engine.
OPTIONAL = (
    *("footfall.operate.ros2.rclpy_bridge", "footfall.operate.ros2.cyclone_bridge"),
    *("footfall.plant.engines.drake_engine", "footfall.plant.engines.drake_model"),
    "footfall.plant.engines.motrix_engine",
)
IMPORT_BUDGET_S = 1.0
CI_SLACK = 3.0  # a busy or cold machine imports more slowly; the measured time is printed


def modules(package: str) -> Iterator[tuple[str, Path]]:
    """Dotted name and path of each module of a package."""
    for path in sorted((ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        yield name.removeprefix("src.") if package == COMMAND_LINE else f"footfall.{name}", path


@cache
def imported(path: Path) -> frozenset[str]:
    """Dotted names that a file imports, wherever in it the import stands."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(found)


def belongs_to(name: str, packages: tuple[str, ...] | set[str]) -> bool:
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def imports_of(package: str, packages: tuple[str, ...] | set[str]) -> list[tuple[str, str]]:
    """Modules of a package, each with a name that it imports from other packages."""
    return [
        (module, name)
        for module, path in modules(package)
        for name in sorted(imported(path))
        if belongs_to(name, packages)
    ]


@pytest.mark.parametrize("package", ALLOWED)
def test_packages_import_one_way(package: str) -> None:
    others = (set(ALLOWED) | COMMAND_LINE_MODULES) - ALLOWED[package] - {package}
    assert imports_of(package, {f"footfall.{other}" for other in others}) == []


@pytest.mark.parametrize("room", ROOMS)
def test_no_import_cycles_within_a_room(room: str) -> None:
    """An import inside a function counts too. The error has the names of a cycle."""
    paths = dict(modules(room))
    within = {name: imported(path) & (paths.keys() - {name}) for name, path in paths.items()}
    TopologicalSorter(within).prepare()


@pytest.mark.parametrize("package", ["envs", "train"])
def test_learning_imports_only_the_contract_of_policies(package: str) -> None:
    found = [each for each in imports_of(package, {"footfall.policies"}) if each[1] != "footfall.policies"]
    assert [each for each in found if not belongs_to(each[1], POLICIES_FOR_LEARNING)] == []


def importable(*packages: str) -> list[str]:
    """Names of the modules of packages, except those that run when they are imported."""
    names = [name for package in packages for name, _ in modules(package)]
    return [name for name in names if not name.endswith("__main__") and not belongs_to(name, OPTIONAL)]


def without_report(names: list[str]) -> list[str]:
    """The modules without those that draw reports, which no robot's computer imports."""
    return [name for name in names if not belongs_to(name, ("footfall.evaluate.report",))]


def test_only_the_report_needs_plotting_libraries_and_no_acting_package_needs_jax_or_torch() -> None:
    names = importable(*ACTING, COMMAND_LINE)
    others = without_report(names)
    import_in_process([*others, "footfall.evaluate.report.extra"], (*DRAWING, *LEARNING_ONLY))
    import_in_process(sorted(set(names) - set(others)), LEARNING_ONLY)
    with pytest.raises(AssertionError, match="jax"):
        import_in_process(["jax"], LEARNING_ONLY)


def test_acting_packages_import_fast_and_without_learning(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """CPU time is measured, which depends little on the load; a second try has the files in memory.

    If Python may not write bytecode beside the sources, it is written to `tmp_path`, so that later tries need
    no compilation. Modules of the report are tested above.
    """
    for _ in range(3):
        bytecode = tmp_path if sys.dont_write_bytecode else None
        seconds, loaded = import_in_process(without_report(importable(*ACTING)), bytecode=bytecode)
        if seconds < IMPORT_BUDGET_S:
            break
    with capsys.disabled():
        print(f"\npackages that act import in {seconds:.2f} s of CPU time (budget {IMPORT_BUDGET_S} s)")
    assert seconds < IMPORT_BUDGET_S * CI_SLACK
    assert [name for name in loaded if belongs_to(name, LEARNING_ONLY)] == []
