"""Checkboxes that show and hide layers of the 3-D view."""

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from viser import GuiApi


def offer_layers(gui: "GuiApi", layers: Mapping[str, Any]) -> None:
    """Add a checkbox for each layer; `layers` maps labels to the layers' frames in the scene."""
    with gui.add_folder("Show"):
        for label, frame in layers.items():
            gui.add_checkbox(label, True).on_update(partial(_show, frame))


def _show(frame: Any, event: Any) -> None:
    frame.visible = bool(event.target.value)
