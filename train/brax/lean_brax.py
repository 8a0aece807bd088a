"""brax, imported without its simulator.

Reason: `brax/__init__.py` imports brax's own physics, and with it MJX, trimesh and SciPy: a third of the time
that all imports take. Only `brax.training` is used here. The package's `__init__` runs on first access to one
of its names. Remove this module once brax imports its simulator lazily; tests/envs/test_workarounds.py
fails for a release that was not tried.
"""

import sys
from importlib.machinery import ModuleSpec
from importlib.util import find_spec, module_from_spec
from types import ModuleType
from typing import Any


class _LazyInit(ModuleType):
    """A package whose submodules can be imported before its `__init__` runs."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or self.__spec__ is None or self.__spec__.loader is None:
            raise AttributeError(name)
        self.__class__ = ModuleType  # type: ignore[assignment]  # from here on, an ordinary package
        self.__spec__.loader.exec_module(self)
        return getattr(self, name)


def import_lean(name: str) -> None:
    """Put a package into `sys.modules` without running its `__init__`; does nothing if it is there.

    Raises:
        ModuleNotFoundError: it is not installed.
    """
    if name in sys.modules:
        return
    spec: ModuleSpec | None = find_spec(name)
    if spec is None:
        raise ModuleNotFoundError(f"No module named '{name}'", name=name)
    module = module_from_spec(spec)
    module.__class__ = _LazyInit
    sys.modules[name] = module


import_lean("brax")
