"""A robot whose parts are in other positions than go1's."""

from pathlib import Path

import pytest
from edited import content_of, edit

from footfall.robots.description import Robot, load_robot

# No joint is at its old position or beside its old neighbour.
ORDER = [7, 2, 11, 0, 5, 9, 4, 1, 10, 3, 8, 6]


@pytest.fixture
def altered(own_folder: Path) -> Robot:
    """go1 with joints in another order and a foot of two spheres; its MJCF begins with a swinging gate."""
    gate = '<body pos="3 0 1"><joint name="gate" axis="0 0 1" ref="0.7"/><geom size="0.2"/></body>'
    # The heel is three centimetres behind the foot in the default pose.
    heel = '<geom name="FR_foot" class="foot"/><geom name="FR_heel" class="foot" pos="-0.01865 0 -0.1895"/>'
    edit(own_folder, "robot.xml", "<worldbody>", f"<worldbody>{gate}")
    edit(own_folder, "robot.xml", '<geom name="FR_foot" class="foot"/>', heel)
    with content_of(own_folder / "robot.yaml") as content:
        content["joints"] = [content["joints"][k] for k in ORDER]
        content["feet"][0]["geoms"] = ["FR_foot", "FR_heel"]
    return load_robot(own_folder)
