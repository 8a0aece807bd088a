"""YAML for settings: PyYAML's safe loader, which here refuses content that is easily misread."""

from typing import Any

import yaml
from yaml.composer import Composer

MAX_NODES = 2**18  # mappings, lists and scalars, with those that aliases repeat
_KEYS = {f"tag:yaml.org,2002:{kind}" for kind in ("str", "int", "merge")}


def parse_yaml(text: str) -> Any:
    """Plain data of a YAML text. Keys of mappings are text or whole numbers, each once.

    Raises:
        ValueError: the text is not YAML, a key is neither text nor a whole number, or is repeated, or aliases
            repeat too much; the message is one line.
    """
    if _FastLoader is not None:
        try:
            return yaml.load(text, _FastLoader)
        except (yaml.YAMLError, ValueError, RecursionError):
            pass  # the loader below reports the error in a uniform way
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except yaml.MarkedYAMLError as error:
        parts = (_at(error.context, error.context_mark), _at(error.problem, error.problem_mark))
        raise ValueError(", ".join(filter(None, parts))) from None
    except (yaml.YAMLError, ValueError) as error:  # ValueError: an impossible date, too many digits
        message = str(error).replace(' in "<unicode string>"', "")  # PyYAML's name for a text
        raise ValueError(" ".join(message.split())) from None


class _Checks(Composer):
    """Checks each mapping and list as soon as it is complete."""

    _sizes: dict[int, int]  # by id() of a node: number of nodes in it, with aliases expanded

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        keys = set()
        for key, _ in node.value:  # checked before merge keys are expanded: own keys may replace merged ones
            if key.tag not in _KEYS:
                raise _refused(f"the key {key.value} is neither text nor a whole number", key)
            if key.value in keys:
                raise _refused(f"the key {key.value} is repeated", key)
            keys.add(key.value)
        self._count(node, [part for pair in node.value for part in pair])
        return node

    def compose_sequence_node(self, anchor: Any) -> yaml.SequenceNode:
        node = super().compose_sequence_node(anchor)
        self._count(node, node.value)
        return node

    def _count(self, node: yaml.Node, parts: list[yaml.Node]) -> None:
        """Refuse aliases inside their own anchor, and aliases that expand to millions of nodes."""
        size = 1
        for part in parts:
            if isinstance(part, yaml.CollectionNode) and id(part) not in self._sizes:
                raise _refused("an alias is inside the value that it repeats", part)
            size += self._sizes.get(id(part), 1)
        if size > MAX_NODES:
            raise _refused(f"its aliases repeat more than {MAX_NODES:,} values", node)
        self._sizes[id(node)] = size


class _Loader(_Checks, yaml.SafeLoader):
    """The safe loader, with checks."""

    def __init__(self, text: str) -> None:
        yaml.SafeLoader.__init__(self, text)
        self._sizes = {}


def _fast_loader() -> type | None:
    """The same loader with libyaml's scanner, three times as fast; None if PyYAML was built without it."""
    if not yaml.__with_libyaml__:
        return None
    from yaml._yaml import CParser

    class FastLoader(_Checks, CParser, yaml.constructor.SafeConstructor, yaml.resolver.Resolver):
        def __init__(self, text: str) -> None:
            CParser.__init__(self, text)
            Composer.__init__(self)
            self._sizes = {}
            yaml.constructor.SafeConstructor.__init__(self)
            yaml.resolver.Resolver.__init__(self)

    return FastLoader


_FastLoader = _fast_loader()


def _refused(why: str, node: yaml.Node) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=why, problem_mark=node.start_mark)


def _at(what: str | None, mark: yaml.Mark | None) -> str:
    """A problem with its line and column; empty without a problem."""
    if what is None:
        return ""
    return what if mark is None else f"{what} (line {mark.line + 1}, column {mark.column + 1})"
