"""A user's own objects, named MODULE:NAME.

Modules in the working folder can be imported.
"""

import re
import sys
import traceback
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from footfall.common.errors import UserError

_IMPORT_PATH = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")
# Folders of installed modules, which are not the user's own.
_LIBRARY_FOLDERS = {"site-packages", "dist-packages"}


def is_import_path(spec: str) -> bool:
    """Whether a text has the form MODULE:NAME."""
    return _IMPORT_PATH.fullmatch(spec) is not None


def find(import_path: str, what: str) -> Any:
    """The object at MODULE:NAME.

    Args:
        import_path: MODULE:NAME.
        what: the kind of object, for the message: "policy", "reward".

    Raises:
        UserError: there is no such module or no such name in it.
    """
    module_name, _, name = import_path.partition(":")
    module = _imported(module_name)
    try:
        return getattr(module, name)
    except AttributeError:
        raise UserError(f"no {what} '{import_path}': {module.__file__} has no '{name}'") from None


def one_line(error: Exception) -> str:
    """The error of a user's own code in one line, with the line of the code that raised it."""
    text, *_ = str(error).splitlines() or [""]
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {text} ({Path(frame.filename).name}:{frame.lineno})"


def sources(import_paths: list[str]) -> list[tuple[str, bytes]]:
    """Source of the modules in these import paths, and of every imported module in the same folders.

    A program compiled from them depends on no other code of the user.

    Returns:
        Names of modules and the content of their files, sorted.

    Raises:
        UserError: a module cannot be imported.
    """
    if not import_paths:
        return []
    modules = [_imported(path.partition(":")[0]) for path in import_paths]
    roots = {_root(module) for module in modules}
    found = {}
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        path = Path(file) if file and file.endswith(".py") else None
        if path is None or name.partition(".")[0] == "footfall":
            continue
        installed = bool(_LIBRARY_FOLDERS.intersection(path.parts))
        is_beside = not installed and any(root in path.parents for root in roots)
        if is_beside or module in modules:
            found[name] = path.read_bytes()
    return sorted(found.items())


def _root(module: ModuleType) -> Path:
    """The folder of a module, or of the package that it belongs to."""
    package = sys.modules[module.__name__.partition(".")[0]]
    return Path(package.__file__ or module.__file__ or "").parent


def shipped(import_path: str) -> Any:
    """The object at MODULE:NAME in footfall itself."""
    module, _, name = import_path.partition(":")
    return getattr(import_module(module), name)


def _imported(name: str) -> ModuleType:
    folder = str(Path.cwd())
    if folder not in sys.path:
        sys.path.append(folder)  # last, so that no file in it hides a library
    try:
        return import_module(name)
    except Exception as error:  # any error is the module's
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is None or not f"{name}.".startswith(f"{missing}."):
            raise UserError(f"importing '{name}': {one_line(error)}") from error
    raise UserError(f"no module '{missing}': it is neither in {folder} nor installed")
