"""The true state of the simulated robot: positions, velocities, contacts, falls."""

import mujoco
import numpy as np
import pytest
from plant_bodies import body_of, lift, throw
from scipy.spatial.transform import Rotation

from footfall.plant.engines.engine import MujocoEngine
from footfall.plant.ground_truth import GroundTruth
from footfall.plant.sensors import Layout
from footfall.robots.description import Robot
from footfall.robots.model import read_plant


class TestTruth:
    def test_every_part_of_the_state_is_found_in_a_plant_of_more_than_the_robot(self, altered: Robot) -> None:
        body = body_of(altered)
        throw(body)
        data, model = body.data, body.model
        truth = body.truth()
        turn = Rotation.from_quat(data.qpos[4:8], scalar_first=True)
        np.testing.assert_array_equal(truth.base_position, [1.0, -2.0, 6.0])
        np.testing.assert_array_equal(truth.base_quaternion, data.qpos[4:8])
        np.testing.assert_allclose(truth.base_velocity, turn.inv().apply(data.qvel[1:4]), atol=1e-12)
        np.testing.assert_array_equal(truth.base_angular_velocity, data.qvel[4:7])
        for k, name in enumerate(altered.joint_names):
            assert truth.joint_position[k] == data.joint(name).qpos[0]
            assert truth.joint_velocity[k] == data.joint(name).qvel[0]
        np.testing.assert_array_equal(truth.qpos, data.qpos)
        positions = []
        for dt in (-1e-6, 0.0, 1e-6):
            moved = mujoco.MjData(model)
            moved.qpos[:] = data.qpos
            mujoco.mj_integratePos(model, moved.qpos, data.qvel, dt)
            mujoco.mj_kinematics(model, moved)
            positions.append(
                [
                    np.mean([moved.geom(g).xpos for g in foot.geoms], axis=0)
                    for foot in altered.description.feet
                ]
            )
        np.testing.assert_allclose(truth.foot_position, positions[1], atol=1e-12)
        velocity = np.subtract(positions[2], positions[0]) / 2e-6
        np.testing.assert_allclose(truth.foot_velocity, velocity, atol=1e-6)
        assert np.abs(truth.foot_velocity).min() > 0.01

    def test_legs_touch_where_two_of_them_press_on_each_other(self, go1: Robot) -> None:
        """Legs of a standing robot do not touch.

        The robot is in the air; its front or its rear feet are moved together.
        """
        body = body_of(go1)
        data, model = body.data, body.model
        mujoco.mj_forward(model, data)
        assert body.truth().foot_contact.all()
        assert not body.truth().legs_touch
        for leg in (0, 2):
            lift(body, go1.default_pose * np.tile((-1.0, 1.0, 1.0), 4))
            assert not body.truth().legs_touch
            inwards = go1.default_pose.copy()
            inwards[[3 * leg, 3 * leg + 3]] = 0.45, -0.45
            lift(body, inwards)
            assert body.truth().legs_touch
            assert len({model.geom_bodyid[geom] for geom in data.contact.geom.ravel()}) == 2

    @pytest.mark.parametrize(("share", "sunk"), [(0.39, True), (0.41, False)])
    def test_a_base_below_0_4_of_the_standing_height_has_sunk(
        self, go1: Robot, share: float, sunk: bool
    ) -> None:
        body = body_of(go1)
        body.data.qpos[2] = 7.0
        body.data.qpos[9] += 0.2  # one foot is higher than the others
        mujoco.mj_forward(body.model, body.data)
        above = 7.0 - body.truth().foot_position[:, 2].min()
        layout = Layout(slice(7, 19), slice(6, 18), 0, 0)
        truth = GroundTruth(
            read_plant(go1, visual=False),
            body.data,
            MujocoEngine(body.model, body.data),
            layout,
            above / share,
        )
        assert truth.fall() == ("the base sank to the height of the feet" if sunk else None)

    def test_only_contact_of_the_base_with_the_ground_is_a_fall(self, go1: Robot) -> None:
        """Thighs on the ground are no fall, nor are contacts of the base with the robot itself."""
        body = body_of(go1)
        data, model = body.data, body.model
        data.qpos[7:] = np.tile([0.0, 1.57, -0.9], 4)
        heights = np.arange(0.4, 0.0, -0.001)
        thigh, trunk = model.body("FR_thigh").id, model.body("trunk").id
        for height in heights:
            data.qpos[2] = height
            mujoco.mj_forward(model, data)
            touching = {frozenset(model.geom_bodyid[pair].tolist()) for pair in data.contact.geom}
            reason = body.fall()
            if frozenset({0, trunk}) in touching:
                assert reason == "the base touched the ground"
                break
            assert reason != "the base touched the ground"
            assert reason is None or frozenset({0, thigh}) in touching
        else:
            pytest.fail("the trunk never touched")

    @pytest.mark.parametrize("kind", ["BADQPOS", "BADQVEL", "BADQACC", "CONTACTFULL"])
    def test_nan_warnings_differ_from_other_warnings(self, go1: Robot, kind: str) -> None:
        body = body_of(go1)
        assert not body.diverged()
        body.data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{kind}")].number = 1
        assert body.diverged() is (kind != "CONTACTFULL")
