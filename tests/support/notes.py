"""An object that records its calls."""

from typing import Any


class Notes:
    """Records each call; the returned object records, too, under the call's name and first word."""

    def __init__(self, log: list[Any], name: str = "") -> None:
        self.__dict__ |= {"_log": log, "_name": name}

    def __getattr__(self, name: str) -> Any:
        def call(*given: Any, **named: Any) -> "Notes":
            self._log.append((self._name, name, given, named))
            return Notes(self._log, str(given[0]) if given else name)

        return call

    def __enter__(self) -> "Notes":
        self._log.append((self._name, "within", (), {}))
        return self

    def __exit__(self, *_: object) -> None:
        self._log.append((self._name, "without", (), {}))
