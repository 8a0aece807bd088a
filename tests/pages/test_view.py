"""Contents of the 3-D view, also from the feed of a run: bodies, arrows, shapes, footholds, forces."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from page_controls import PageControls
from ports import free_port
from scipy.spatial.transform import Rotation
from walking_run import eventually

from footfall import Episode, Robot, load_policy, run_episode
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.pages.cockpit.joints import JointNames, joint_figures
from footfall.pages.geometry import COLLISION_GROUP, visible_shapes
from footfall.pages.layers import offer_layers
from footfall.pages.live import PosedModel
from footfall.pages.marks import Marks
from footfall.pages.moment import Moment
from footfall.pages.page import serving
from footfall.pages.run_feed import RunFeed, newest_moment, sensed
from footfall.pages.scene import Scene
from footfall.pages.walk import standing
from footfall.plant.robot import SimulatedRobot
from footfall.robots.model import plant_model
from footfall.robots.readings import Sensed


def test_bodies_are_drawn_by_frames_and_arrows_are_level_above_the_robot(go1: Robot) -> None:
    model = plant_model(go1)
    data = mujoco.MjData(model)
    tilted = Rotation.from_euler("ZYX", [2.0, -0.4, 0.3])  # a heading of 2 rad, then pitch and roll
    data.qpos[:7] = [3.0, -2.0, 0.5, *tilted.as_quat()[[3, 0, 1, 2]]]
    mujoco.mj_kinematics(model, data)
    with serving("localhost", free_port(), "test") as server:
        scene = Scene(server, go1, model)
        scene.show(data, np.array([0.5, -0.25, 0.9]), np.array([-0.1, 0.3, 0.8]), follow=False)
    height = go1.description.standing_height_m
    turned = Rotation.from_euler("Z", 2.0)
    for name, vector, above in (("command", [0.5, -0.25, 0], 0.75), ("velocity", [-0.1, 0.3, 0], 0.95)):
        arrow = scene._arrows[name]
        assert arrow.visible
        np.testing.assert_allclose(arrow.points, [[np.zeros(3), 0.4 * turned.apply(vector)]], atol=1e-6)
        np.testing.assert_allclose(arrow.position, [3.0, -2.0, 0.5 + above * height], atol=1e-6)
    for body, frame in scene.bodies.items():
        np.testing.assert_allclose(frame.position, data.xpos[body], atol=1e-6)
        np.testing.assert_allclose(frame.wxyz, data.xquat[body], atol=1e-6)
    bodies = list(scene.bodies)
    assert np.abs(data.xpos[bodies] - data.xipos[bodies]).max() > 0.01  # frames are not at centres of mass


@pytest.mark.parametrize("follow", [True, False])
def test_an_episode_begins_with_the_view_at_the_origin(go1: Robot, follow: bool) -> None:
    model = plant_model(go1)
    data, still = mujoco.MjData(model), np.zeros(3)
    with serving("localhost", free_port(), "test") as server:
        scene = Scene(server, go1, model)
        for x_m in (0.0, 5.0):
            data.qpos[:3] = x_m, 0.0, 0.3
            mujoco.mj_kinematics(model, data)
            scene.show(data, still, still, follow=True)
        assert scene._world.position[0] < 0.0
        mujoco.mj_resetData(model, data)
        mujoco.mj_kinematics(model, data)
        scene.begin()
        scene.show(data, still, still, follow=follow)
        np.testing.assert_allclose(scene._world.position, 0.0, atol=1e-9)


def test_without_a_policy_the_robot_stands(go1: Robot) -> None:
    """The robot is drawn in its default pose, and its lowest foot is on the ground."""
    body = standing(go1)
    model, data = body.model, body.data
    mujoco.mj_kinematics(model, data)
    feet = [model.geom(foot.geoms[0]).id for foot in go1.description.feet]
    soles = data.geom_xpos[feet, 2] - model.geom_size[feet, 0]
    assert np.abs(soles).max() < 0.01
    height = data.body(go1.description.base).xpos[2]
    assert height == pytest.approx(go1.description.standing_height_m, abs=0.02)


def test_each_mesh_has_its_own_shape() -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3))
    vertices = {"box": corners} | {f"m{k}": f"0 0 0 {k} 0 0 0 {2 * k} 0 0 0 {3 * k}" for k in (1, 2)}
    meshes = "".join(f'<mesh name="{name}" vertex="{points}"/>' for name, points in vertices.items())
    geoms = "".join(f'<geom type="mesh" mesh="{name}"/>' for name in ("box", "m2", "m1"))
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{meshes}</asset><worldbody><body>{geoms}</body></worldbody></mujoco>"
    )
    edged, two, one = visible_shapes(model)
    assert len(edged.faces) == 12
    for shape, size in ((one, 1.0), (two, 2.0)):
        turned = Rotation.from_quat(shape.quaternion[[1, 2, 3, 0]]).apply(shape.vertices)
        np.testing.assert_allclose(np.ptp(turned, axis=0), [size, 2 * size, 3 * size], rtol=1e-5)
        assert shape.faces.max() == len(shape.vertices) - 1


def test_every_visible_geom_has_its_size_position_and_colour(go1: Robot) -> None:
    model = plant_model(go1)
    shapes = {shape.geom: shape for shape in visible_shapes(model)}
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    seen = np.flatnonzero((model.geom_group < COLLISION_GROUP) & ~planes)
    assert sorted(shapes) == seen.tolist()
    assert len(seen) > 30
    for geom, shape in shapes.items():
        middle, half = model.geom_aabb[geom].reshape(2, 3)
        assert shape.vertices.min(axis=0) == pytest.approx(middle - half, abs=2e-4)
        assert shape.vertices.max(axis=0) == pytest.approx(middle + half, abs=2e-4)
    accent = model.mat_rgba[model.material("accent").id]
    assert any(np.array_equal(shape.rgba, accent) for shape in shapes.values())


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


def test_state_from_a_runs_feed_is_the_simulated_robots(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "feed"
    feed, policy, seen = RunFeed(path), load_policy("trot", go1), SimpleNamespace()
    names = JointNames(go1.joint_names, go1.motor.peak_torque.tolist())

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        def is_read() -> bool:
            read = sensed(feed)
            return read is not None and np.array_equal(read.joint_position, loop.sensed.joint_position)

        if loop.walking and loop.walking_s >= 0.59 and not vars(seen):
            seen.truth, seen.footholds = body.truth(), policy.footholds()
            assert eventually(is_read)
            assert eventually(lambda: feed.newest("/footholds", feed.time_ns - 25_000_000))
            seen.moment, seen.joints = newest_moment(feed, 4), joint_figures(feed, names)
            seen.policy = feed.fact("policy")

    command = np.array([0.4, 0.0, 0.2])
    config = replace(deploy_config(go1), odometry=True, stand_s=0.2)
    run_episode(go1, policy, Episode(lambda _: command, 0.7, feed=path, config=config), watch)
    assert eventually(lambda: feed.ended)
    now, truth = seen.moment, seen.truth
    assert seen.policy == "trot"
    np.testing.assert_allclose(now.command, [0.4, 0.0, 0.2])
    np.testing.assert_allclose(now.position[:2], truth.base_position[:2], atol=0.03)
    np.testing.assert_allclose(now.quaternion, truth.base_quaternion, atol=0.03)
    np.testing.assert_allclose(now.velocity, truth.base_velocity, atol=0.2)
    np.testing.assert_allclose(now.sensed.joint_position, truth.joint_position, atol=0.05)
    assert (now.contact[truth.foot_force > 20.0] > 0.5).all()
    np.testing.assert_allclose(now.footholds, seen.footholds, atol=0.03)
    assert np.isfinite(now.footholds).any()
    joints = seen.joints["joints"]
    assert joints["names"] == list(go1.joint_names)
    load = 100.0 * np.abs(truth.motor_torque) / go1.motor.peak_torque
    np.testing.assert_allclose(joints["load"], load, atol=25.0)
    assert np.isfinite([*joints["temperature_c"], *joints["error_rad"], seen.joints["yaw_rate"]]).all()
    pose = PosedModel(go1)  # its feet are on the ground
    placed = pose.set_moment(now)
    assert placed.position[2] == pytest.approx(truth.base_position[2], abs=0.02)
    np.testing.assert_allclose(pose.data.body(go1.description.base).xpos, placed.position)
    assert feed.newest("/footholds") is not None
    assert feed.newest("/footholds", feed.time_ns + 1) is None  # no message is as new as that
