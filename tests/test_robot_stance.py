"""The standing height: where the feet touch, and refused where they do not."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_robot, load_spec
from footfall.robots.model import joint_addresses
from footfall.robots.stance import touching_height

# Thigh and shank of 0.213 m at 0.9 rad, then the hip's 0.08 m, all turned by 0.1 rad.
FOOT_BELOW_BASE_M = 2 * 0.213 * np.cos(0.9) * np.cos(0.1) + 0.08 * np.sin(0.1)


def test_go1_stands_where_its_feet_touch(go1: Robot) -> None:
    by_hand = FOOT_BELOW_BASE_M + 0.023  # a ball's radius
    assert touching_height(go1.description, load_spec(go1.xml_path).compile()) == pytest.approx(by_hand)
    assert go1.description.standing_height_m == pytest.approx(by_hand, abs=1e-4)


@pytest.mark.parametrize(
    "foot",
    [
        'type="sphere" size="0.03"',
        'type="capsule" size="0.02 0.01"',
        'type="capsule" size="0.02 0.01" quat="0 1 0 0"',  # its axis points down
        'type="cylinder" size="0.02 0.01"',
        'type="ellipsoid" size="0.03 0.02 0.01"',
        'type="box" size="0.03 0.02 0.01"',
        'type="mesh" mesh="wedge"',
    ],
)
def test_feet_of_any_shape_touch_with_their_lowest_point(go1: Robot, own_folder: Path, foot: str) -> None:
    """MuJoCo finds contact a tenth of a millimetre lower, and none a tenth higher."""
    text = (own_folder / "robot.xml").read_text()
    wedge = '<mesh name="wedge" vertex="0 0 0 0.05 0 0 0 0.04 0 0 0 -0.03"/>'
    text = text.replace('type="sphere" size="0.023"', foot).replace("<asset>", f"<asset>{wedge}")
    text = text.replace("<worldbody>", '<worldbody><geom type="plane" size="0 0 1"/>')
    (own_folder / "robot.xml").write_text(text)
    model = load_spec(own_folder / "robot.xml").compile()
    height = touching_height(go1.description, model)
    for lifted, touches in ((-1e-4, True), (1e-4, False)):
        data = mujoco.MjData(model)
        data.qpos[:7] = (0, 0, height + lifted, 1, 0, 0, 0)
        data.qpos[joint_addresses(model, go1)[0]] = go1.default_pose
        mujoco.mj_forward(model, data)
        assert (data.ncon > 0) is touches


def test_the_lowest_foot_decides(go1: Robot, own_folder: Path) -> None:
    xml = own_folder / "robot.xml"
    text = xml.read_text()
    short = '<geom name="RL_foot" class="foot"/>'
    assert short in text
    xml.write_text(text.replace(short, '<geom name="RL_foot" class="foot" pos="0 0 -0.15"/>'))
    touching = touching_height(go1.description, load_spec(xml).compile())
    assert touching == pytest.approx(FOOT_BELOW_BASE_M + 0.023)


@pytest.mark.parametrize(("said", "true"), [(0.278, False), (2.0, False), (0.299, True), (0.290, True)])
def test_a_height_at_which_no_foot_touches_is_refused(own_folder: Path, said: float, true: bool) -> None:
    declaration = own_folder / "robot.yaml"
    declaration.write_text(declaration.read_text().replace("height_m: 0.2945", f"height_m: {said}"))
    if true:
        load_robot(own_folder)
        return
    with pytest.raises(UserError, match=r"standing_height_m: .* at 0\.2945 m") as caught:
        load_robot(own_folder)
    assert "\n" not in str(caught.value)
