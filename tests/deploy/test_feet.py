"""Where spheres and soles touch the ground."""

from itertools import product

import mujoco
import numpy as np
import pytest
from moments import UP, about
from scipy.spatial.transform import Rotation

from footfall.deploy.estimation.feet import ContactPoints
from footfall.robots.description import load_robot
from footfall.robots.feet import foot_spheres

ROBOT = load_robot("go1")
G1 = load_robot("g1")


class TestContactPoints:
    def test_a_sphere_touches_with_its_lowest_point(self) -> None:
        """Pitched or rolled, a sphere touches the ground below its centre."""
        up = about("x", 0.4).T @ UP
        arms = ContactPoints(ROBOT.legs, 0.002).arms(ROBOT.default_pose, up)
        np.testing.assert_allclose(arms, -0.023 * np.tile(up, (4, 1)))

    @pytest.mark.parametrize(
        ("axis", "angle", "expected"),
        [
            ("y", 0.0, [0.0, 0.0]),  # level: below its middle
            ("y", 0.06, [0.085, 0.0]),  # nose down: the toes
            ("y", -0.06, [-0.085, 0.0]),  # nose up: the heel
            ("x", 0.3, [0.0766, -0.0297]),  # rolled: the edge, which is 1.48 mm higher at the heel
        ],
    )
    def test_a_sole_touches_with_its_low_edge(self, axis: str, angle: float, expected: list[float]) -> None:
        """Corners are 0.085 m ahead of the sole's middle and behind it, 0.03 and 0.025 m to the sides."""
        up = about(axis, angle).T @ UP
        arms = ContactPoints(G1.legs, 0.0005).arms(G1.default_pose, up)
        atol = 1e-3 if angle else 1e-6
        np.testing.assert_allclose(arms[:, :2] + 0.005 * up[:2], [expected] * 2, atol=atol)
        assert angle or arms[:, 2] == pytest.approx([-0.005] * 2, abs=1e-6)

    def test_soles_follow_their_ankles(self) -> None:
        """The base level, ankles bent by 0.1 rad: one foot on its toes, one on its heel."""
        pose = G1.default_pose.copy()
        left, right = (G1.joint_index(f"{side}_ankle_pitch_joint") for side in ("left", "right"))
        pose[left], pose[right] = pose[left] + 0.1, pose[right] - 0.1
        arms = ContactPoints(G1.legs, 0.001).arms(pose, UP)
        np.testing.assert_allclose(arms[:, 0], [0.085 * np.cos(0.1), -0.085 * np.cos(0.1)], atol=1e-4)

    def test_spheres_of_spheres_capsules_and_boxes(self) -> None:
        """Spheres are at both ends of a tilted capsule and at the corners of a turned box, by scipy."""
        model = mujoco.MjModel.from_xml_string(
            """<mujoco><worldbody><body><freejoint/>
            <geom type="sphere" size="0.02" pos="0.1 0 0" mass="1"/>
            <geom type="capsule" size="0.01" fromto="-0.01 -0.05 0.18 0.03 0.05 0.22"/>
            <geom type="box" size="0.03 0.02 0.01" euler="20 0 50"/>
            </body></worldbody></mujoco>"""
        )
        tip = np.array([0.1, 0.0, 0.0])
        sphere, ends, corners = (foot_spheres(model, np.array([geom]), tip) for geom in range(3))
        np.testing.assert_allclose(sphere.centre, [[0.0, 0.0, 0.0]])
        assert sphere.radius.tolist() == [0.02]
        np.testing.assert_allclose(sorted(ends.centre.tolist()), [[-0.11, -0.05, 0.18], [-0.07, 0.05, 0.22]])
        assert ends.radius.tolist() == [0.01, 0.01]
        turn = Rotation.from_euler("XYZ", [20, 0, 50], degrees=True)
        edges = turn.apply(list(product((-0.03, 0.03), (-0.02, 0.02), (-0.01, 0.01)))) - tip
        np.testing.assert_allclose(sorted(corners.centre.tolist()), sorted(edges.tolist()), atol=1e-12)
        assert not corners.radius.any()
        together = foot_spheres(model, np.arange(3), tip)
        assert together.radius.tolist() == [0.02, 0.01, 0.01, *[0.0] * 8]

    def test_spheres_of_a_mesh_are_corners_of_its_box(self) -> None:
        """The box has the axes of the mesh's inertia and is the smallest that holds all vertices."""
        model = mujoco.MjModel.from_xml_string(
            """<mujoco><asset><mesh name="wedge" vertex="0.1 0 0  0.4 0 0  0.1 0.2 0  0.1 0 0.3"/></asset>
            <worldbody><body><freejoint/><geom type="mesh" mesh="wedge" pos="1 2 3" euler="20 0 50"/>
            </body></worldbody></mujoco>"""
        )
        turn = Rotation.from_quat(model.geom_quat[0], scalar_first=True)
        corners = foot_spheres(model, np.array([0]), np.zeros(3)).centre - model.geom_pos[0]
        across = turn.inv().apply(corners)
        np.testing.assert_allclose(across.min(axis=0), model.mesh_vert.min(axis=0), atol=1e-7)
        np.testing.assert_allclose(across.max(axis=0), model.mesh_vert.max(axis=0), atol=1e-7)
