"""Footholds, forces and balance in the 3-D view."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from page_controls import PageControls
from scipy.spatial.transform import Rotation

from footfall.pages.layers import offer_layers
from footfall.pages.marks import Marks
from footfall.pages.moment import Moment
from footfall.robots.description import Robot
from footfall.robots.readings import Sensed

PLACE = np.array([3.0, -2.0, 0.30])


class Drawing:
    """Stands in for viser's server and its scene: each object that was added, by its name."""

    def __init__(self) -> None:
        self.scene = self
        self.objects: dict[str, SimpleNamespace] = {}

    def __getattr__(self, method: str) -> Any:
        def add(name: str, *_: Any, visible: bool = True, **__: Any) -> SimpleNamespace:
            return self.objects.setdefault(name, SimpleNamespace(visible=visible, position=np.zeros(3)))

        return add

    def position(self, name: str) -> np.ndarray:
        """Position of an object in the world frame, which includes that of its layer."""
        layer = "/".join(name.split("/")[:2])
        return self.objects[layer].position + self.objects[name].position


def test_marks_are_where_the_robot_is(go1: Robot) -> None:
    """The robot is turned by 90 degrees to the left, on two feet; a swinging foot has a planned foothold."""
    still, pose = np.zeros(3), go1.default_pose
    level = Rotation.from_euler("Z", 90, degrees=True).as_quat()[[3, 0, 1, 2]]
    sensed = Sensed(still, np.array([0, 0, 9.81]), level, pose, np.zeros(12), np.full(12, 2.0))
    footholds = np.full((4, 3), np.nan)
    footholds[1] = 0.2, 0.1, -0.3
    velocity, contact = np.array([0.5, 0.0, 0.0]), np.array([1, 0, 0, 1])
    drawing = Drawing()
    Marks(drawing, go1, "w").show(Moment(1.0, PLACE, level, velocity, still, sensed, contact, footholds))
    shown = drawing.objects
    assert [shown[f"w/forces/contact_{k}"].visible for k in range(4)] == [True, False, False, True]
    assert [shown[f"w/feet/goal_{k}"].visible for k in range(4)] == [False, True, False, False]
    np.testing.assert_allclose(drawing.position("w/feet/goal_1"), [2.9, -1.8, 0.0], atol=1e-9)
    centre, capture = drawing.position("w/balance/centre"), drawing.position("w/balance/capture")
    np.testing.assert_allclose(centre[:2], PLACE[:2], atol=0.02)
    assert capture[1] - centre[1] == pytest.approx(0.5 * np.sqrt(centre[2] / 9.81), abs=0.01)  # forward is +y
    feet = np.array([drawing.position(f"w/forces/contact_{k}") for k in (0, 3)])
    ground = shown["w/balance/support"].vertices + shown["w/balance"].position
    np.testing.assert_allclose(np.sort(np.unique(ground[:, 0])), np.sort(feet[:, 0]), atol=1e-6)
    forces = shown["w/forces/arrows"].points
    length = np.linalg.norm(forces[:, 1] - forces[:, 0], axis=1)
    assert (length[[0, 3]] > 0.01).all()
    assert length[[1, 2]].max() == 0.0


def test_a_visitor_hides_a_layer(go1: Robot) -> None:
    page, drawing = PageControls(), Drawing()
    offer_layers(page, Marks(drawing, go1, "w").layers)  # type: ignore[arg-type]
    page["Balance"].type(False)
    layers = ("feet", "forces", "balance")
    assert [drawing.objects[f"w/{layer}"].visible for layer in layers] == [True, True, False]
