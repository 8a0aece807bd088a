"""Hooks of the documentation site: generated sections, and links to files outside `docs/`.

mkdocs reads this file by its path (`hooks` in mkdocs.yml). A page asks for a generated section with the line
`<!-- generated: NAME -->`; NAME is a key of `reference.SECTIONS`. A link that leaves `docs/` leads to a page
with the file's text, so that the site works without GitHub and without a network.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path
from posixpath import dirname, join, normpath, relpath

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

sys.path.insert(0, str(Path(__file__).parent))  # mkdocs does not add this file's folder to sys.path

import reference

ROOT = Path(__file__).parents[1]
DOCS = "docs/"
LINK = re.compile(r"(\]\()([^)\s#]+)((?:#[^)\s]*)?\))")
FENCE = re.compile(r"(```.*?```|`[^`\n]*`)", re.DOTALL)
GENERATED = re.compile(r"^<!-- generated: ([\w-]+) -->$", re.MULTILINE)
STATES = re.compile(r"^```mermaid\nstateDiagram-v2\n(.*?)^```", re.DOTALL | re.MULTILINE)
TRANSITION = re.compile(r"^\s*(\S+) --> (\S+?): (.*)$", re.MULTILINE)
LANGUAGES = {".py": "python", ".yaml": "yaml", ".xml": "xml", ".json": "json", ".cpp": "cpp", ".toml": "toml"}
EXCLUDED = "---\nsearch:\n  exclude: true\n---\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page for each file outside `docs/` that a page links to, and for those that these link to."""
    pending = [(DOCS + file.src_uri, Path(str(file.abs_src_path)).read_text("utf-8"))
               for file in files.documentation_pages()]  # fmt: skip
    seen: set[str] = set()
    while pending:
        origin, text = pending.pop()
        for target in _targets(origin, text) - seen:
            seen.add(target)
            content = _content(target)
            files.append(File.generated(config, _source_uri(target), content=EXCLUDED + content))
            if target.endswith(".md"):
                pending.append((target, content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Insert generated sections, and redirect links that leave `docs/` to the pages generated for them."""
    uri = page.file.src_uri
    origin = _origin(uri)
    filled = STATES.sub(_as_table, GENERATED.sub(lambda match: reference.SECTIONS[match[1]](), markdown))

    def redirected(match: re.Match[str]) -> str:
        target = _target(origin, match[2])
        if target is None or (target.startswith(DOCS) and uri.startswith(DOCS)):
            return match[0]
        to = target.removeprefix(DOCS) if target.startswith(DOCS) else _source_uri(target)
        return f"{match[1]}{relpath(to, dirname(uri) or '.')}{match[3]}"

    return _outside_code(filled, lambda text: LINK.sub(redirected, text))


def _as_table(diagram: re.Match[str]) -> str:
    """A state diagram's transitions as a table, since mermaid would load a script from another server."""
    rows = [("from", "to", "when"), ("---", "---", "---")]
    rows += [(start.replace("[*]", "start"), end.replace("[*]", "end"), when)
             for start, end, when in TRANSITION.findall(diagram[1])]  # fmt: skip
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _outside_code(text: str, change: Callable[[str], str]) -> str:
    parts = FENCE.split(text)
    return "".join(part if index % 2 else change(part) for index, part in enumerate(parts))


def _targets(origin: str, text: str) -> set[str]:
    prose = "".join(FENCE.split(text)[::2])
    found = {_target(origin, link) for _, link, _ in LINK.findall(prose)}
    return {target for target in found if target and not target.startswith(DOCS)}


def _target(origin: str, link: str) -> str | None:
    """Path of a linked file or folder in the repository; None for other addresses."""
    if "://" in link or link.startswith("mailto:"):
        return None
    target = normpath(join(dirname(origin), link))
    return target if (ROOT / target).exists() else None


def _source_uri(target: str) -> str:
    return f"source/{target}" if target.endswith(".md") else f"source/{target}.md"


def _origin(uri: str) -> str:
    """Path of a page's text in the repository."""
    return uri.removeprefix("source/") if uri.startswith("source/") else DOCS + uri


def _content(target: str) -> str:
    path = ROOT / target
    if path.is_dir():
        names = sorted(p.name + "/" * p.is_dir() for p in path.iterdir() if p.name != "__pycache__")
        return f"# {target}/\n\n" + "\n".join(f"- `{name}`" for name in names) + "\n"
    text = path.read_text(encoding="utf-8")
    if target.endswith(".md"):
        return text
    return f"# {target}\n\n````{LANGUAGES.get(path.suffix, '')}\n{text}\n````\n"
