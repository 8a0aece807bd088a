"""What the visitor wants to see in the 3-D view."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from viser import GuiApi


def offer_layers(gui: "GuiApi", layers: Mapping[str, Any]) -> None:
    """A checkbox for each layer that hides it: labels and the frames of the scene that layers hang on."""
    with gui.add_folder("Show"):
        for label, frame in layers.items():
            gui.add_checkbox(label, True).on_update(partial(_show, frame))


def _show(frame: Any, event: Any) -> None:
    frame.visible = bool(event.target.value)
