"""An installation adds one import name, which works beside any other modules."""

import json
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from fresh_environment import FreshEnvironment

pytest.importorskip("build")

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "footfall"
ROOMS = [path.name for path in PACKAGE.iterdir() if path.is_symlink()]
USERS_OWN = ("train", "envs", "deploy", "evaluate", "robots", "policies", "common", "pages", "plant")


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package's files in a clone."""
    folder = tmp_path_factory.mktemp("sources")
    for name in ("src", *ROOMS):
        shutil.copytree(
            ROOT / name,
            folder / name,
            symlinks=True,
            ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"),
        )
    for name in ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    return folder


@pytest.fixture(scope="module")
def built(sources: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel made from that."""
    out = tmp_path_factory.mktemp("built")
    build(sources, out)
    return out


def build(sources: Path, out: Path, *options: str) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", *options, "--outdir", out, sources],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr


@pytest.fixture(scope="module")
def wheel(built: Path) -> Path:
    [path] = built.glob("*.whl")
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


@pytest.fixture(scope="module")
def robots_computer(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> FreshEnvironment:
    """An environment with only the required packages."""
    return FreshEnvironment(tmp_path_factory.mktemp("robot"), wheel)


def content(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


def test_the_wheel_holds_every_file_of_the_rooms_under_one_name(wheel: Path) -> None:
    room_files = {
        f"footfall/{path.relative_to(ROOT)}": path for room in ROOMS for path in (ROOT / room).rglob("*")
    }
    room_files |= {
        f"footfall/{path.relative_to(PACKAGE)}": path for path in PACKAGE.rglob("*") if not path.is_symlink()
    }
    expected = {name for name, path in room_files.items() if path.is_file() and path.suffix != ".pyc"}
    assert len(ROOMS) >= 10
    assert content(wheel) == expected


def test_an_editable_install_is_one_folder_on_the_search_path(sources: Path, tmp_path: Path) -> None:
    """Type checkers and editors read it too, and only footfall can be imported from it."""
    build_editable = (
        "import sys; from setuptools.build_meta import build_editable; build_editable(sys.argv[1])"
    )
    subprocess.run(
        [sys.executable, "-c", build_editable, tmp_path], cwd=sources, capture_output=True, check=True
    )
    [editable] = tmp_path.glob("*.whl")
    [line] = content(editable)
    assert zipfile.Path(editable, line).read_text().strip() == str(sources / "src")
    assert [path.name for path in (sources / "src").iterdir() if path.suffix != ".egg-info"] == ["footfall"]


def brief_scenario(environment: FreshEnvironment) -> tuple[str, ...]:
    """Options of an evaluation that takes a moment."""
    file = environment.folder / "brief.yaml"
    file.write_text("scenarios: {brief: {about: Standing, episodes: 1, duration_s: 0.3}}")
    return ("--scenario-file", file.name, "--scenarios", "brief", "--json", "figures.json")


class TestBesideAUsersOwn:
    def test_the_documented_gymnasium_script_runs(self, user: FreshEnvironment) -> None:
        page = (ROOT / "docs" / "gymnasium.md").read_text()
        script = re.search(r"```python\n(import gymnasium\n.*?)```", page, re.DOTALL)
        assert script is not None
        (user.folder / "try_it.py").write_text(
            script[1] + "env.reset(seed=0)\nprint(env.step(env.action_space.sample())[0].dtype)\n"
        )
        done = user.run([user.python, "try_it.py"])
        assert (done.stdout, done.stderr) == ("float32\n", "")

    def test_the_command_is_installed(self, user: FreshEnvironment) -> None:
        user.run(user.footfall("deploy", "go1-flat", "--duration", "1", "--json", "walk.json"))
        assert json.loads((user.folder / "walk.json").read_text())["final_state"] == "IDLE"

    def test_commands_with_several_processes_work(self, user: FreshEnvironment) -> None:
        user.run(user.footfall("evaluate", "stand", "--workers", "2", *brief_scenario(user)))
        assert (user.folder / "figures.json").is_file()


class TestOnARobotsComputer:
    def test_the_required_packages_suffice_to_deploy_and_replay(
        self, robots_computer: FreshEnvironment
    ) -> None:
        robots_computer.run(
            robots_computer.footfall("deploy", "go1-flat", "--duration", "1", "--log", "walk.mcap")
        )
        assert (
            "the same decisions"
            in robots_computer.run(robots_computer.footfall("replay", "walk.mcap")).stdout
        )

    def test_the_error_names_the_extra_for_training(
        self, robots_computer: FreshEnvironment, wheel: Path
    ) -> None:
        done = robots_computer.try_to_run(robots_computer.footfall("train", "--preset", "smoke"))
        assert done.returncode == 2
        assert done.stderr == (
            "footfall: training and export need jax, which is not installed: "
            f"{robots_computer.python} -m pip install '{wheel}[train]'\n"
        )
        assert not (robots_computer.folder / "runs").exists()
