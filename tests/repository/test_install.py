"""An installation adds one import name, which works beside any other modules."""

import json
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from collections.abc import Iterable
from importlib.metadata import Distribution, PathDistribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from quick_relaxed import write_quick

pytest.importorskip("setuptools")

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "footfall"
ROOMS = [path.name for path in PACKAGE.iterdir() if path.is_symlink()]
USERS_OWN = ("train", "envs", "deploy", "evaluate", "robots", "policies", "common", "pages", "plant")

BUILD = """
import os, sys, tarfile, zlib
from setuptools import build_meta
compressor = zlib.compressobj
zlib.compressobj = lambda level, *more: compressor(1, *more)  # quickly
out = sys.argv[1]
name = build_meta.build_sdist(out)
tarfile.open(os.path.join(out, name)).extractall(out, filter="data")
os.chdir(os.path.join(out, name.removesuffix(".tar.gz")))
build_meta.build_wheel(out)
"""


class FreshEnvironment:
    """A fresh environment with a built wheel and the packages that it declares, and a working folder.

    The packages are linked to from the environment that the tests run in: nothing is downloaded.
    """

    def __init__(self, folder: Path, wheel: Path, *extras: str) -> None:
        self.folder = folder / "work"
        self.folder.mkdir(parents=True)
        venv.create(folder / "venv", symlinks=True)
        self.python = folder / "venv" / "bin" / "python"
        [self.packages] = folder.glob("venv/lib/python*/site-packages")
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", self.python]
        self.run([*pip, "install", "--quiet", "--no-index", "--no-deps", "--no-compile", wheel])
        [metadata] = self.packages.glob("footfall-*.dist-info")
        for found in _needed(PathDistribution(metadata), extras):
            self._link(found)

    def run(self, command: list) -> subprocess.CompletedProcess[str]:
        """Run a command without the tests' own search path, and fail with its error output if it fails."""
        options: dict = {"cwd": self.folder, "capture_output": True, "text": True}
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        done = subprocess.run(command, env=environment, check=False, **options)
        assert done.returncode == 0, done.stderr
        return done

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
    waiting, seen = [(package, extra) for extra in ("", *extras)], set()
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


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package's files in a clone."""
    folder, built = tmp_path_factory.mktemp("sources"), shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("src", *ROOMS):
        shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=built)
    for name in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    return folder


@pytest.fixture(scope="module")
def wheel(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel made from the sdist, as `python -m build` makes it, but in one process."""
    out = tmp_path_factory.mktemp("built")
    subprocess.run([sys.executable, "-c", BUILD, out], cwd=sources, check=True)
    [path] = out.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def user(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> FreshEnvironment:
    """An environment with files and packages named like footfall's folders; importing one of them fails."""
    environment = FreshEnvironment(tmp_path_factory.mktemp("user"), wheel, "gym")
    for name in USERS_OWN:
        (environment.folder / f"{name}.py").write_text(f"raise SystemExit('the own {name}.py')\n")
    for folder in (environment.folder / "envs", environment.packages / "evaluate"):
        folder.mkdir()
        (folder / "__init__.py").write_text(f"raise SystemExit('{folder.name} of others')\n")
    return environment


def content(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def test_the_wheel_holds_every_file_of_the_rooms_under_one_name(wheel: Path) -> None:
    paths = {path: path.relative_to(ROOT) for room in ROOMS for path in (ROOT / room).rglob("*")}
    paths |= {path: path.relative_to(PACKAGE) for path in PACKAGE.rglob("*") if not path.is_symlink()}
    files = {path: name for path, name in paths.items() if path.is_file() and path.suffix != ".pyc"}
    assert len(ROOMS) >= 10
    assert content(wheel) == {f"footfall/{name}" for name in files.values()}


def test_an_editable_install_is_one_folder_on_the_search_path(sources: Path, tmp_path: Path) -> None:
    """Type checkers and editors read it too, and only footfall can be imported from it."""
    script = "import sys; from setuptools.build_meta import build_editable; build_editable(sys.argv[1])"
    subprocess.run([sys.executable, "-c", script, tmp_path], cwd=sources, capture_output=True, check=True)
    [editable] = tmp_path.glob("*.whl")
    [line] = content(editable)
    assert zipfile.Path(editable, line).read_text().strip() == str(sources / "src")
    assert [path.name for path in (sources / "src").iterdir() if path.suffix != ".egg-info"] == ["footfall"]


def test_the_documented_gymnasium_script_runs(user: FreshEnvironment) -> None:
    page = (ROOT / "docs" / "gymnasium.md").read_text()
    script = re.search(r"```python\n(import gymnasium\n.*?)```", page, re.DOTALL)
    assert script is not None
    more = "env.reset(seed=0)\nprint(env.step(env.action_space.sample())[0].dtype)\n"
    (user.folder / "try_it.py").write_text(script[1] + more)
    done = user.run([user.python, "try_it.py"])
    assert (done.stdout, done.stderr) == ("float32\n", "")


def test_commands_work_beside_a_users_own_files(user: FreshEnvironment) -> None:
    quick = ("--duration", "0.3", "--config", write_quick(user.folder))
    user.run(user.footfall("deploy", "go1-flat", *quick, "--json", "walk.json"))
    assert json.loads((user.folder / "walk.json").read_text())["final_state"] == "IDLE"
    brief = "scenarios: {brief: {about: Standing, episodes: 1, duration_s: 0.3}}"
    (user.folder / "brief.yaml").write_text(brief)
    options = ("--scenario-file", "brief.yaml", "--scenarios", "brief", "--json", "figures.json")
    user.run(user.footfall("evaluate", "stand", "--workers", "2", *options))
    assert (user.folder / "figures.json").is_file()


def test_the_required_packages_suffice_to_deploy_and_replay_and_an_error_names_the_extra_for_training(
    wheel: Path, tmp_path: Path
) -> None:
    """On a robot's computer."""
    computer = FreshEnvironment(tmp_path, wheel)
    quick = ("--duration", "0.3", "--config", write_quick(computer.folder))
    deploy = ["deploy", "go1-flat", *quick, "--log", "walk.mcap"]
    commands = [deploy, ["replay", "walk.mcap"], ["train", "--preset", "smoke"]]
    code = f"from footfall.cli import main; print([main(each) for each in {commands!r}])"
    done = computer.run([computer.python, "-c", code])
    assert "the same decisions" in done.stdout
    assert done.stdout.splitlines()[-1] == "[0, 0, 2]"
    assert done.stderr == (
        "footfall: training and export need jax, which is not installed: "
        f"{computer.python} -m pip install '{wheel}[train]'\n"
    )
    assert not (computer.folder / "runs").exists()
