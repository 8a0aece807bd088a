"""Contents of the 3-D view: bodies, arrows, camera."""

from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
import pytest
from ports import free_port
from scipy.spatial.transform import Rotation

from footfall.pages.page import serving
from footfall.pages.scene import Scene
from footfall.pages.walk import standing
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


@pytest.fixture(scope="module")
def server() -> Iterator[Any]:
    with serving("localhost", free_port(), "test") as server:
        yield server


TILTED = Rotation.from_euler("ZYX", [2.0, -0.4, 0.3])  # a heading of 2 rad, then pitch and roll


class TestScene:
    @pytest.fixture(scope="class")
    @classmethod
    def scene(cls, server: Any, go1: Robot) -> Scene:
        return Scene(server, go1, plant_model(go1))

    @pytest.fixture
    def data(self, go1: Robot) -> mujoco.MjData:
        """The robot at some position, tilted about all axes."""
        model = plant_model(go1)
        data = mujoco.MjData(model)
        data.qpos[:7] = [3.0, -2.0, 0.5, *TILTED.as_quat()[[3, 0, 1, 2]]]
        mujoco.mj_kinematics(model, data)
        return data

    def test_arrows_are_level_above_the_robot(self, scene: Scene, data: mujoco.MjData, go1: Robot) -> None:
        scene.show(data, np.array([0.5, -0.25, 0.9]), np.array([-0.1, 0.3, 0.8]), follow=False)
        height = go1.description.standing_height_m
        turned = Rotation.from_euler("Z", 2.0)
        for name, vector, above in (("command", [0.5, -0.25, 0], 0.75), ("velocity", [-0.1, 0.3, 0], 0.95)):
            arrow = scene._arrows[name]
            assert arrow.visible
            np.testing.assert_allclose(arrow.points, [[np.zeros(3), 0.4 * turned.apply(vector)]], atol=1e-6)
            np.testing.assert_allclose(arrow.position, [3.0, -2.0, 0.5 + above * height], atol=1e-6)

    def test_bodies_are_drawn_by_frames_not_by_centres(self, scene: Scene, data: mujoco.MjData) -> None:
        scene.show(data, np.zeros(3), np.zeros(3), follow=False)
        for body, frame in scene.bodies.items():
            np.testing.assert_allclose(frame.position, data.xpos[body], atol=1e-6)
            np.testing.assert_allclose(frame.wxyz, data.xquat[body], atol=1e-6)
        bodies = list(scene.bodies)
        assert np.abs(data.xpos[bodies] - data.xipos[bodies]).max() > 0.01

    def test_without_a_policy_the_robot_stands(self, go1: Robot) -> None:
        """The robot is drawn in its default pose, and its lowest foot is on the ground."""
        body = standing(go1)
        model, data = body.model, body.data
        mujoco.mj_kinematics(model, data)
        feet = [model.geom(foot.geoms[0]).id for foot in go1.description.feet]
        soles = data.geom_xpos[feet, 2] - model.geom_size[feet, 0]
        assert np.abs(soles).max() < 0.01
        assert data.body(go1.description.base).xpos[2] == pytest.approx(
            go1.description.standing_height_m, abs=0.02
        )
