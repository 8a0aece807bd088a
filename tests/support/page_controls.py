"""A fake server of a page that stores its controls and drawings by label and name."""

from types import SimpleNamespace
from typing import Any


class Control(SimpleNamespace):
    """A slider, a checkbox, a button, a text: a visitor sets `value`, clicks and sees `content`."""

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *_: object) -> None: ...

    def on_click(self, action: Any) -> None:
        self.click = lambda: action(None)

    def on_update(self, action: Any) -> None:
        self.type = lambda value: (setattr(self, "value", value), action(SimpleNamespace(target=self)))


class PageControls:
    """Stands in for viser's server."""

    def __init__(self) -> None:
        self.by_label: dict[str, Control] = {}
        self.charts: dict[str, Control] = {}
        self.visitors: dict[int, str] = {}
        self.gui = self
        self.connected: list[Any] = []  # called when a visitor connects
        self.disconnected: list[Any] = []
        self.on_client_connect, self.on_client_disconnect = self.connected.append, self.disconnected.append
        self.get_clients = lambda: self.visitors
        self.add_button = lambda label, **_: self._add(label)
        self.add_checkbox = lambda label, value: self._add(label, value=value)
        self.add_folder = lambda label, visible=True: self._add(label, visible=visible)

    def __getitem__(self, label: str) -> Control:
        return self.by_label[label]

    def _add(self, label: str, **facts: Any) -> Control:
        return self.by_label.setdefault(label, Control(label=label, **facts))

    def add_markdown(self, content: str, **_: Any) -> Control:
        return self._add(f"text {len(self.by_label)}", content=content)

    def add_dropdown(self, label: str, options: tuple[str, ...], **_: Any) -> Control:
        return self._add(label, options=options, value=options[0])

    def add_slider(self, label: str, low: float, high: float, _: float, value: float, **__: Any) -> Control:
        return self._add(label, min=low, max=high, value=value)

    def add_panel(self) -> Any:
        layout = SimpleNamespace(dock_left=lambda: None, set_width=lambda _: None)
        return SimpleNamespace(add_tab=self._add, **vars(layout))

    def add_uplot(self, data: Any, *_: Any, title: str, **__: Any) -> Control:
        return self.charts.setdefault(title, Control(title=title, data=data))
