"""Pages are correct: links and paths exist, command lines parse, snippets run."""

import ast
import importlib
import json
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import make_table
import pytest
import reference
import yaml

from footfall.cli import app
from footfall.common.config import load, structure, with_changes
from footfall.deploy.bring_up.config import BringUpConfig
from footfall.deploy.config import deploy_config
from footfall.deploy.log_analysis.recorded_csv import ColumnMap
from footfall.domain_rand.randomisation import Randomisation
from footfall.evaluate.scenarios import load_scenarios
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.foot_test import FootTestConfig
from footfall.identify.gain_search import GainConfig
from footfall.operate.gamepad import GamepadConfig
from footfall.operate.missions.mission import load_mission
from footfall.operate.ros2.bridge_process import Ros2Config
from footfall.robots.description import ROBOTS, load_robot
from footfall.robots.robot_yaml import Description
from footfall.train.config import PRESETS, load_preset
from footfall.train.sweeps.sweep import SweepConfig

ROOT = Path(__file__).parents[2]
PATTERNS = ("*.md", "docs/**/*.md", "examples/*.md", "policies/zoo/*/*.md")
PAGES = [page for pattern in PATTERNS for page in sorted(ROOT.glob(pattern))]
LINK = re.compile(r"\]\(([^)\s]+)\)")
FILE = re.compile(r"(?<![\w./-])((?:[\w-]+/)+[\w-]+\.(?:py|yaml|md|xml|json|html|png|webp))(?![\w/])")
OF_THE_READER = ("runs/", "path/to/", "my_robot/", "robots/NAME/")  # files that a reader creates
CODE = re.compile(r"```\w*\n(.*?)```|`([^`\n]+)`", re.DOTALL)
PYTHON = re.compile(r"(<!-- not run: [^\n]*-->\n)?```python\n(.*?)```", re.DOTALL)
YAML = re.compile(r"(?:<!-- read as: ([\w-]+) -->\n)?```yaml\n(.*?)```", re.DOTALL)
SCRIPT = re.compile(r"python ((?:benchmarks|tools|tests/support)/\w+\.py)((?: [^\n#;]*)?)")


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def codes(page: Path) -> Iterator[str]:
    """Each line of code on a page, in blocks and within sentences, without its comment and prompt."""
    for block, inline in CODE.findall(page.read_text(encoding="utf-8")):
        for line in (block or inline).splitlines():
            yield re.sub(r"\s+#.*", "", line).removeprefix("$ ").removesuffix(" &").strip()


def commands(page: Path) -> list[list[str]]:
    """The command lines of footfall on a page, as words."""
    found = [shlex.split(code) for code in codes(page) if re.match(r"footfall [a-z]", code)]
    return [words[1:] for words in found]


def has_anchor(page: Path, anchor: str) -> bool:
    """Whether a link may point there: to a heading, as GitHub writes it, or to what the site generates."""
    text = page.read_text(encoding="utf-8")
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    written = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return anchor in written or "<!-- generated: " in text  # the strict build of the site looks at those


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_and_named_files_exist(page: Path) -> None:
    broken, text = [], page.read_text(encoding="utf-8")
    for link in LINK.findall(text):
        if link.startswith(("http://", "https://")):
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        if not target.exists() or (anchor and not has_anchor(target, anchor)):
            broken.append(link)
    for path in FILE.findall(LINK.sub("]", text)):
        if not any((path.startswith(OF_THE_READER), (ROOT / path).exists(), (page.parent / path).exists())):
            broken.append(path)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_command_lines_are_found_and_can_be_parsed(page: Path) -> None:
    wrong = []
    for words in commands(page):
        named, _, rest = app.parse_commands(words)
        try:
            assert named, "no such command"
            if rest and "…" not in words:  # otherwise the command is only mentioned
                app.parse_args(words, exit_on_error=False, print_error=False)
        except Exception as error:
            wrong.append(f"{' '.join(words)}: {error}")
    assert wrong == []
    if page == ROOT / "README.md":
        assert {words[0] for words in commands(page)} >= {"train", "deploy", "compare", "doctor", "watch"}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_options_of_scripts_exist(page: Path) -> None:
    for code in codes(page):
        for script, arguments in SCRIPT.findall(code):
            source = (ROOT / script).read_text(encoding="utf-8")
            if "add_options(parser)" in source:
                source += (ROOT / "benchmarks/resumable_runs.py").read_text(encoding="utf-8")
            assert [o for o in re.findall(r"--[a-z-]+", arguments) if f'"{o}"' not in source] == [], code


def with_python(page: Path) -> bool:
    return any(not left_out for left_out, _ in PYTHON.findall(page.read_text(encoding="utf-8")))


@pytest.mark.parametrize("page", [*filter(with_python, PAGES)], ids=name_of)
def test_python_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page run in order in one process, in their own folder."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": page.stem}
    for left_out, block in PYTHON.findall(page.read_text(encoding="utf-8")):
        if not left_out:
            exec(compile(block, name_of(page), "exec"), names)


GO1 = yaml.safe_load((ROBOTS / "go1" / "robot.yaml").read_text())
READERS: dict[str, Callable[[Path], object]] = {
    "bring-up": lambda path: load(path, BringUpConfig),
    "columns": lambda path: load(path, ColumnMap),
    "excitation": lambda path: load(path, ExcitationConfig),
    "foot-test": lambda path: load(path, FootTestConfig),
    "gain-search": lambda path: load(path, GainConfig),
    "loop": lambda path: deploy_config(load_robot("go1"), path),
    "gamepad": lambda path: load(path, GamepadConfig),
    "mission": load_mission,
    "preset": lambda path: load_preset(str(path), load_robot("go1")),
    "scenarios": lambda path: load_scenarios(load_robot("go1"), path),
    "randomisation": lambda path: load(path, Randomisation),
    "ros2": lambda path: load(path, Ros2Config),
    "robot": lambda path: structure(with_changes(GO1, path), Description, str(path)),
    "sweep": lambda path: load(path, SweepConfig),
    "training": lambda path: with_changes(yaml.safe_load((PRESETS / "gpu.yaml").read_text()), path),
}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_settings_on_pages_can_be_read(page: Path, tmp_path: Path) -> None:
    for reader, block in YAML.findall(page.read_text(encoding="utf-8")):
        (tmp_path / "settings.yaml").write_text(block, encoding="utf-8")
        READERS[reader](tmp_path / "settings.yaml")


def test_the_python_reference_names_existing_objects() -> None:
    for name in re.findall(r"^::: ([\w.]+)$", (ROOT / "docs/reference/api.md").read_text(), re.MULTILINE):
        module, _, member = name.rpartition(".")
        assert hasattr(importlib.import_module(module), member), name


@pytest.mark.parametrize("section", reference.SECTIONS)
def test_generated_sections_are_on_a_page_and_not_empty(section: str) -> None:
    assert any(f"<!-- generated: {section} -->" in page.read_text(encoding="utf-8") for page in PAGES)
    assert len(reference.SECTIONS[section]().split()) > 50


@pytest.mark.parametrize("file", ["robot.yaml", "controllers.yaml"])
def test_every_field_of_a_robot_is_explained(file: str) -> None:
    def fields(content: Any) -> Iterator[str]:
        for part in content if isinstance(content, list) else [content]:
            if isinstance(part, dict):
                for name, inner in part.items():
                    yield from [name] if not isinstance(inner, dict) else fields(inner)
                    yield from fields(inner) if isinstance(inner, list) else []

    content = yaml.safe_load((ROOT / "robots/go1" / file).read_text(encoding="utf-8"))
    explained = set(re.findall(r"\w+", " ".join(codes(ROOT / f"docs/reference/{file.replace('.', '_')}.md"))))
    assert set(fields(content)) - explained == set()


def test_the_readmes_table_shows_the_comparison_beside_it_without_errors_of_fallen_robots() -> None:
    """A fallen robot has small errors: the pushed trot would have the smallest velocity error."""
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = make_table.table(json.loads((ROOT / "docs/comparison.json").read_text(encoding="utf-8")))
    assert make_table.insert(readme, table) == readme
    assert "\n| Nominal: velocity error" in table
    assert "\n| Push: velocity error" not in table


def shown_texts(module: Path) -> Iterator[str]:
    """Strings of a module, with … for the parts of an f-string that vary; without docstrings."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "…" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.value


def test_messages_in_troubleshooting_are_those_of_the_code() -> None:
    """The fixed words of a message, between …, numbers and quoted names, stand in one string of the code."""
    package = ROOT / "src/footfall"
    modules = [
        *package.glob("*.py"),
        *(module for room in package.glob("*/") for module in room.rglob("*.py")),
    ]
    texts = [text for module in modules for text in shown_texts(module)]
    texts.append((ROOT / "Makefile").read_text(encoding="utf-8"))
    page = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
    quoted = re.findall("`([^`\n]+)`", "\n".join(re.findall(r"^\| ([^|]*) \|", page, re.MULTILINE)))
    assert len(quoted) > 20
    pieces = {piece.strip() for each in quoted for piece in re.split(r"…|\d+|'\w+'", each)}
    assert [piece for piece in sorted(pieces) if not any(piece in text for text in texts)] == []


@pytest.mark.parametrize(("page", "words"), [("results", 2_000), ("journal", 4_000), ("faults", 800)])
def test_long_pages_keep_to_a_number_of_words(page: str, words: int) -> None:
    assert len((ROOT / f"docs/{page}.md").read_text().split()) <= words
