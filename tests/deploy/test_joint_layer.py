"""The joint layer limits commands and decodes readings."""

import numpy as np
import pytest
from frame_robot import ROWS
from some_motors import report

from footfall.deploy.drivers.choice import open_driver, open_imu
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.robots.actuator import JointCommand, limit_torque, pd_torque
from footfall.robots.description import Robot

TICK_S = 0.002
RNG = np.random.default_rng(6)


@pytest.fixture
def layer(go1: Robot) -> JointLayer:
    wiring = wiring_of(go1)
    layer = JointLayer(go1, open_driver(wiring), open_imu(wiring), TICK_S)
    layer.absorb([replies(go1, go1.default_pose)], 0)
    layer.begin_at(go1.default_pose)
    return layer


def replies(robot: Robot, position: np.ndarray, velocity: np.ndarray | float = 0.0) -> Frames:
    values = np.array([position, 0.0 * ROWS + velocity, 0.0 * ROWS])
    return open_motor_end(wiring_of(robot)).reply(slice(None), report(values))


class TestCommands:
    def test_targets_continue_after_damping(self, go1: Robot, layer: JointLayer) -> None:
        requested = JointCommand(go1.default_pose, *np.outer([0.0, 20.0, 0.5, 0.0], np.ones(12)))
        layer.command(requested)  # whose target is reached at once
        layer.absorb([replies(go1, go1.default_pose + 0.3)], 0)
        layer.damping(3.0)
        np.testing.assert_allclose(layer.target, go1.default_pose + 0.3, atol=2e-4)
        layer.command(requested)
        step = go1.description.target_rate_rad_s * TICK_S
        np.testing.assert_allclose(layer.target, go1.default_pose + 0.3 - step, atol=2e-4)

    def test_each_command_is_reduced_to_its_motors_limit(self, go1: Robot, layer: JointLayer) -> None:
        """Readings and commands all differ; half of the requested torques exceed the motors' limits."""
        position = go1.default_pose + RNG.uniform(-0.02, 0.02, 12)
        velocity = RNG.uniform(-8.0, 8.0, 12)
        layer.absorb([replies(go1, position, velocity)], 0)
        sensed = layer.sensed()
        layer.begin_at(go1.default_pose)
        target = go1.default_pose + RNG.uniform(-0.05, 0.05, 12)
        rest = RNG.uniform([[-2.0], [20.0], [0.5]], [[2.0], [60.0], [2.0]], (3, 12))  # velocity, kp, kd
        feed_forward = np.where(ROWS % 2, 24.0, -1.0) * RNG.uniform(0.9, 1.04, 12)
        requested = JointCommand(target, *rest, feed_forward)
        sent = JointCommand(*open_motor_end(wiring_of(go1)).requests(layer.command(requested)).values)
        torque = pd_torque(requested, sensed.joint_position, sensed.joint_velocity)
        share = limit_torque(torque, sensed.joint_velocity, go1.motor) / torque
        assert 2 <= (share < 1.0).sum() < 12
        lowered = JointCommand(*requested[:2], *(share * np.array(requested[2:])))
        for sent_part, lowered_part, atol in zip(sent, lowered, (4e-4, 0.02, 0.13, 2e-3, 0.02), strict=True):
            np.testing.assert_allclose(sent_part, lowered_part, atol=atol)
        cut = share < 1.0  # a lowered gain is rounded down, any other to the nearest
        assert np.all(sent.kp[cut] <= lowered.kp[cut])
        np.testing.assert_allclose(sent.kp[~cut], requested.kp[~cut], atol=0.07)
        np.testing.assert_array_equal(layer.target, requested.position)

    def test_each_target_moves_at_most_its_rate_at_each_tick(self, go1: Robot, layer: JointLayer) -> None:
        """60 rad/s over 2 ms are 0.12 rad; a second tick continues from the first."""
        start = go1.default_pose + 0.01 * ROWS
        layer.begin_at(start)
        start += 5.0  # the layer has a copy
        start -= 5.0
        away = np.where(ROWS % 3, 0.2, -0.3)
        away[5] = 0.05
        for tick in (1, 2):
            layer.command(JointCommand(start + away, *np.zeros((4, 12))))
            moved = np.clip(away, -0.12 * tick, 0.12 * tick)
            np.testing.assert_allclose(layer.target - start, moved, atol=1e-12)

    def test_torques_are_taken_once_and_of_many_the_extremes(self, go1: Robot, layer: JointLayer) -> None:
        for torque in range(500):
            layer.command(JointCommand(go1.default_pose, *np.zeros((3, 12)), np.full(12, 0.01 * torque)))
        torques = layer.take_torques()
        assert len(torques) <= 100
        np.testing.assert_allclose([np.min(torques), np.max(torques)], [0.0, 4.99], atol=1e-12)
        np.testing.assert_allclose(layer.take_torques(), [torques[-1]])

    def test_a_scale_lowers_gains_and_torque_but_not_damping(self, go1: Robot) -> None:
        """Joints rest at zero. Gains are halved; torques are at most half the peak of 23.7 and 35.55 N m."""
        driver, imu = open_driver(wiring_of(go1)), open_imu(wiring_of(go1))
        full, half = (JointLayer(go1, driver, imu, 1.0, scale) for scale in (1.0, 0.5))
        command = np.zeros((5, 12))
        command[0], command[2], command[4] = 1.0, 1.0, 2.0
        for layer in (full, half):
            layer.command(command)
        # A gait's feed-forward torque is halved, too.
        np.testing.assert_allclose(half.sent[[2, 4]], 0.5 * full.sent[[2, 4]])
        command[0], command[2], command[4] = go1.soft_limits[1], 400.0, 0.0
        half.command(command)
        assert (np.abs(half.sent[2] * half.sent[0]) <= 0.5 * go1.motor.peak_torque + 1e-9).all()
        half.damping(3.0)
        assert (half.sent[3] == 3.0).all()
