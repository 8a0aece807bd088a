"""Install commands for missing packages and extras."""

import re
import shlex
import sys
import tomllib
from importlib.metadata import PathDistribution
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from footfall import machine
from footfall.common import installation, versions
from footfall.common.errors import UserError
from footfall.common.installation import extras_command, install_command, needs_extra
from footfall.common.sources import read_sources

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
METADATA = """\
Metadata-Version: 2.4
Name: footfall
Version: 0.1.0
Requires-Dist: numpy>=2.0
Requires-Dist: nosuchpackage>=1; sys_platform == "nosuchsystem"
Requires-Dist: pytest>=999
Provides-Extra: train
Requires-Dist: nosuchpackage[cpu]>=1,<2; extra == "train"
Provides-Extra: sweep
Requires-Dist: footfall[train]; extra == "sweep"
Requires-Dist: numpy>=1; extra == "sweep"
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Has footfall installed from a URL, or from an index without one; the environment is not active."""

    def install_from(url: str | None, about: str = "") -> None:
        folder = tmp_path / "footfall-0.1.0.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(METADATA)
        if url is not None:
            (folder / "direct_url.json").write_text(f'{{"url": "{url}", {about}}}')
        monkeypatch.setattr(installation, "distribution", lambda _: PathDistribution(folder))
        monkeypatch.setenv("PATH", "/nowhere")

    return install_from


PIP = f"{shlex.quote(sys.executable)} -m pip install"


@pytest.mark.parametrize(
    ("name", "about", "expected"),
    [
        ("clone", '"dir_info": {"editable": true}', "--editable '{at}[gym,watch]'"),
        (".", '"dir_info": {"editable": true}', "--editable '.[gym,watch]'"),
        ("my robots", '"dir_info": {}', "'{at}[gym,watch]'"),
        ("footfall-0.1.0-py3-none-any.whl", '"archive_info": {}', "'{at}[gym,watch]'"),
    ],
)
def test_extras_are_installed_from_the_same_source(
    installed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, about: str, expected: str
) -> None:
    at = tmp_path if name == "." else tmp_path / name
    if name == ".":
        monkeypatch.chdir(tmp_path)
    at.mkdir(exist_ok=True)
    installed(at.as_uri(), about)
    assert extras_command("gym", "watch") == f"{PIP} {expected.format(at=at)}"


@pytest.mark.parametrize("url", [None, "file:///nowhere/footfall-0.1.0-py3-none-any.whl", "https://x/y.whl"])
def test_extras_of_a_missing_or_remote_source_are_named_package_by_package(
    installed, url: str | None
) -> None:
    installed(url, '"archive_info": {}')
    assert extras_command("sweep") == f"{PIP} 'nosuchpackage[cpu]<2,>=1' 'numpy>=1'"


def test_this_environments_pip_has_a_short_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("mine", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "pip").touch(mode=0o755)
    (tmp_path / "mine" / "python").symlink_to(tmp_path / "other" / "python3")  # as environments have it
    monkeypatch.setattr(sys, "executable", str(tmp_path / "mine" / "python"))
    monkeypatch.setenv("PATH", str(tmp_path / "mine"))
    assert install_command("jax[cuda12]") == "pip install 'jax[cuda12]'"
    monkeypatch.setenv("PATH", str(tmp_path / "other"))
    assert install_command("jax[cuda12]") == f"{tmp_path}/mine/python -m pip install 'jax[cuda12]'"


def test_a_package_of_an_extra_that_is_missing_is_one_line(installed, tmp_path: Path) -> None:
    installed(tmp_path.as_uri(), '"dir_info": {}')
    with pytest.raises(UserError) as caught, needs_extra("sweep", "sweeps need"):
        import nosuchpackage.part  # noqa: F401
    missing = "sweeps need nosuchpackage, which is not installed"
    assert str(caught.value) == f"{missing}: {PIP} '{tmp_path}[sweep]'"
    # A failing import inside footfall is not reported as a missing package.
    with pytest.raises(ModuleNotFoundError), needs_extra("sweep", "sweeps need"):
        import footfall.nosuchroom  # noqa: F401


def test_doctor_names_one_command_for_all_missing_packages(
    installed, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def version(name: str) -> str:
        if name == "mujoco":
            return "3.3.0"
        raise machine.PackageNotFoundError(name)

    installed(tmp_path.as_uri(), '"dir_info": {}')
    monkeypatch.setattr(machine, "version", version)
    monkeypatch.setattr(machine.importlib.util, "find_spec", lambda name: None)
    advice = {machine.check_simulators().advice, machine.check_accelerator().advice}
    assert advice == {f"to train: {PIP} '{tmp_path}[train]'"}


def test_pages_install_from_the_clone() -> None:
    pages = (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
    texts = "\n".join(page.read_text() for page in pages)
    for line in re.findall(r"pip install (?:-q )?([^`\n]+)", texts):
        for expected in shlex.split(line, comments=True):
            if expected.startswith("-") or expected.endswith(".whl"):
                continue
            found = re.fullmatch(r"\.\[([a-z,-]+)\]", expected)
            assert "footfall" not in expected, line
            assert found is None or set(found[1].split(",")) <= set(EXTRAS), line


def test_sources_are_all_files_of_their_kinds_at_any_depth_of_their_packages(tmp_path: Path) -> None:
    files = ("b/two.py", "a/one.py", "a/deep/er/three.py", "a/own.yaml", "a/notes.md", "c/four.py", "five.py")
    for file in files:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(f"of {file}")

    python = ["a/deep/er/three.py", "a/one.py", "b/two.py"]
    for kinds, expected in ((), python), ((("*.py", "*.yaml", "*.*ml"),), sorted([*python, "a/own.yaml"])):
        found = [
            (str(path), content.decode()) for path, content in read_sources(tmp_path, ("b", "a"), *kinds)
        ]
        assert found == [(file, f"of {file}") for file in expected]


def test_versions_of_python_and_of_each_package() -> None:
    assert versions.versions(["numpy", "no-such-package"]) == {
        "python": ".".join(map(str, sys.version_info[:3])),
        "numpy": np.__version__,
        "no-such-package": "not installed as a package",
    }


def test_an_extra_has_its_own_and_included_requirements_and_those_missing_are_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A package with nested extras; a missing package is absent or of another version."""
    requires = [
        "numpy>=1.26", "mujoco; python_version >= '3'", "winonly; sys_platform == 'nowhere'",
        "jax; extra == 'train'", "footfall[train,video]; extra == 'all'", "av>=10; extra == 'video'",
        "pytest; extra == 'dev'",
    ]  # fmt: skip
    there = {"numpy": "1.25", "jax": "0.4", "av": "11.0rc1"}

    def find(name: str) -> str:
        if name not in there:
            raise installation.PackageNotFoundError(name)
        return there[name]

    metadata = SimpleNamespace(get_all=lambda name: ["all", "train"] if name == "Provides-Extra" else None)
    found = SimpleNamespace(requires=requires, metadata=metadata)
    monkeypatch.setattr(installation, "distribution", lambda _: found)
    monkeypatch.setattr(installation, "version", find)
    for extra, expected in (
        ([], ["numpy>=1.26", "mujoco"]),
        (["train"], ["jax"]),
        (["all"], ["jax", "av>=10"]),
    ):
        assert [str(package) for package in installation.requirements(*extra)] == expected
    assert installation.extras() == ["all", "train"]
    assert [package.name for package in installation.missing()] == ["numpy", "mujoco"]
    assert installation.missing("all") == []
    there["av"] = "9.9"
    assert [package.name for package in installation.missing("all")] == ["av"]
