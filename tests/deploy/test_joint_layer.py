"""The joint layer limits what goes out and reads what comes in."""

import numpy as np
import pytest

from footfall.deploy.drivers import imu, mit, mit_driver
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import NEVER, JointLayer
from footfall.deploy.wiring import Wiring, wire
from footfall.robots.actuator import JointCommand, pd_torque
from footfall.robots.description import Robot

TICK_S = 0.002


@pytest.fixture
def wiring(go1: Robot) -> Wiring:
    return wire(go1)


@pytest.fixture
def layer(go1: Robot, wiring: Wiring) -> JointLayer:
    layer = JointLayer(go1, open_driver(wiring), wiring.imu_channel, TICK_S)
    layer.absorb([replies(wiring, go1.default_pose)], 0)
    layer.begin_at(go1.default_pose)
    return layer


def replies(wiring: Wiring, position: np.ndarray, velocity: float = 0.0, error: int = 0) -> Frames:
    n = len(position)
    values = np.array([position, np.full(n, velocity), np.zeros(n)])
    head, tail = wiring.motor_id.astype(np.uint64) << np.uint64(56), np.full(n, error, dtype=np.uint64)
    data = mit.Codec(wiring.models).encode_replies(slice(None), head, values, tail)
    return Frames(wiring.channel, mit_driver.REPLY_ID + wiring.motor_id, data, np.full(n, 8))


def command(robot: Robot, position: np.ndarray, kp: float = 20.0, torque: float = 0.0) -> JointCommand:
    one = np.ones(len(position))
    return JointCommand(position, 0 * one, kp * one, 0.5 * one, torque * one)


def sent(robot: Robot, wiring: Wiring, frames: Frames) -> JointCommand:
    codec = mit.Codec(wiring.models)
    return JointCommand(*codec.decode(mit.words(frames.data), slice(None)))


class TestOut:
    def test_frames_go_to_each_motor_on_its_own_bus(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        frames = layer.command(command(go1, go1.default_pose))
        assert frames.channel.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3]
        assert frames.id.tolist() == [1, 2, 3] * 4
        back = sent(go1, wiring, frames)
        np.testing.assert_allclose(back.position, go1.default_pose, atol=2e-4)
        np.testing.assert_allclose(back.kp, 20.0, atol=0.07)

    def test_targets_begin_at_the_soft_limit_where_a_joint_is_beyond_it(
        self, go1: Robot, layer: JointLayer
    ) -> None:
        beyond = go1.upper_rad.copy()
        layer.begin_at(beyond)
        np.testing.assert_array_equal(layer.target, go1.soft_limits[1])
        layer.command(command(go1, beyond))
        np.testing.assert_array_equal(layer.target, go1.soft_limits[1])

    def test_what_motors_should_report_is_the_smaller_of_what_the_last_two_commands_ask_for(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        """In between, a joint has moved by 0.04 rad, which is 0.8 N m with 20 N m/rad."""
        pose = go1.default_pose
        for torque in (0.4, -0.4, 2.0, 1.2):
            layer.command(command(go1, pose, torque=torque))
        layer.absorb([replies(wiring, pose - 0.04)], 2000)
        np.testing.assert_allclose(layer.expected_torque(), 1.2 + 0.8, atol=0.01)
        layer.command(command(go1, pose, torque=-2.0))  # asks for -1.2 N m here, the one before for 2
        np.testing.assert_array_equal(layer.expected_torque(), 0.0)

    @pytest.mark.parametrize("side", [-1.0, 1.0])
    def test_what_is_asked_for_twice_alike_in_direction_is_expected_by_the_smaller(
        self, go1: Robot, wiring: Wiring, layer: JointLayer, side: float
    ) -> None:
        """2.0 and 1.2 N m, beside 0.8 N m of a joint that is 0.04 rad behind: 2.0 N m either way."""
        for torque in (2.0 * side, 1.2 * side):
            layer.command(command(go1, go1.default_pose, torque=torque))
        layer.absorb([replies(wiring, go1.default_pose - 0.04 * side)], 2000)
        np.testing.assert_allclose(layer.expected_torque(), 2.0 * side, atol=0.02)

    def test_targets_stay_inside_the_soft_limits(self, go1: Robot, layer: JointLayer) -> None:
        _, upper = go1.soft_limits
        for _ in range(200):
            layer.command(command(go1, go1.upper_rad + 5.0))
        np.testing.assert_allclose(layer.target, upper)

    def test_targets_move_no_faster_than_the_rate_limit(self, go1: Robot, layer: JointLayer) -> None:
        layer.command(command(go1, go1.default_pose + 1.0))
        step = go1.description.target_rate_rad_s * TICK_S
        np.testing.assert_allclose(np.abs(layer.target - go1.default_pose).max(), step)

    def test_predicted_torque_stays_within_what_the_motor_can_do(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        frames = layer.command(command(go1, go1.default_pose, torque=60.0))
        predicted = pd_torque(sent(go1, wiring, frames), go1.default_pose, np.zeros(12))
        assert np.all(predicted <= go1.motor.peak_torque + 0.05)
        assert np.all(predicted >= go1.motor.peak_torque - 0.05)

    def test_predicted_torque_falls_with_speed(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        layer.absorb([replies(wiring, go1.default_pose, velocity=15.0)], 0)
        frames = layer.command(command(go1, go1.default_pose, torque=60.0))
        predicted = pd_torque(sent(go1, wiring, frames), go1.default_pose, np.full(12, 15.0))
        available = go1.motor.stall_torque * (1 - 15.0 / go1.motor.no_load_speed)
        assert np.all(predicted <= available + 0.1)

    def test_torque_within_limits_is_left_alone(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        frames = layer.command(command(go1, go1.default_pose + 0.01, torque=2.0))
        np.testing.assert_allclose(sent(go1, wiring, frames).torque, 2.0, atol=0.02)

    def test_damping_has_no_stiffness(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        layer.command(command(go1, go1.default_pose + 0.1, torque=2.0))  # nothing is left of it
        back = sent(go1, wiring, layer.damping(3.0))
        assert np.array_equal(back.kp, np.zeros(12))
        np.testing.assert_allclose(back.kd, 3.0, atol=1e-3)
        np.testing.assert_allclose(back.torque, 0.0, atol=0.02)

    def test_after_damping_targets_go_on_from_where_the_joints_are(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        wanted = command(go1, go1.default_pose)
        layer.command(wanted)  # whose target is reached at once
        layer.absorb([replies(wiring, go1.default_pose + 0.3)], 0)
        layer.damping(3.0)
        np.testing.assert_allclose(layer.target, go1.default_pose + 0.3, atol=2e-4)
        layer.command(wanted)
        step = go1.description.target_rate_rad_s * TICK_S
        np.testing.assert_allclose(layer.target, go1.default_pose + 0.3 - step, atol=2e-4)

    def test_what_had_to_be_lowered_is_whole_again_as_soon_as_it_may(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        wanted = command(go1, go1.default_pose, torque=20.0)
        first = sent(go1, wiring, layer.command(wanted)).torque
        layer.absorb([replies(wiring, go1.default_pose, velocity=25.0)], 2000)
        assert np.all(sent(go1, wiring, layer.command(wanted)).torque < 0.8 * first)
        layer.absorb([replies(wiring, go1.default_pose)], 4000)
        np.testing.assert_array_equal(sent(go1, wiring, layer.command(wanted)).torque, first)


class TestIn:
    def test_replies_become_joint_readings(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        layer.absorb([replies(wiring, go1.default_pose + 0.1, 1.0)], 4000)
        sensed = layer.sensed()
        np.testing.assert_allclose(sensed.joint_position, go1.default_pose + 0.1, atol=2e-4)
        np.testing.assert_allclose(sensed.joint_velocity, 1.0, atol=0.02)
        assert layer.last_heard().motor_us.tolist() == [4000] * 12

    def test_readings_handed_out_do_not_change_later(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        before = layer.sensed()
        kept = before.joint_position.copy()
        layer.absorb([replies(wiring, go1.default_pose + 0.3)], 4000)
        assert np.array_equal(before.joint_position, kept)

    def test_a_motor_is_known_by_its_bus_and_byte_zero(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        batch = replies(wiring, go1.default_pose + 0.1)
        layer.absorb([batch.take(np.array([7]))], 4000)
        assert np.flatnonzero(layer.last_heard().motor_us == 4000).tolist() == [7]

    def test_replies_on_the_shared_id_and_of_six_bytes_count(
        self, go1: Robot, wiring: Wiring, layer: JointLayer
    ) -> None:
        batch = replies(wiring, go1.default_pose + 0.1, error=5)
        data = batch.data.copy()
        data[:, 6:] = 0
        short = Frames(batch.channel, np.full(12, mit_driver.SHARED_REPLY_ID), data, np.full(12, 6))
        layer.absorb([short], 4000)
        assert layer.last_heard().motor_us.tolist() == [4000] * 12
        assert not layer.last_heard().motor_error.any()

    def test_foreign_frames_are_left_aside(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        batch = replies(wiring, go1.default_pose + 0.1)
        unknown_motor = batch.data.copy()
        unknown_motor[:, 0] = 99
        for foreign in (
            batch._replace(data=unknown_motor, id=np.full(12, mit_driver.REPLY_ID + 99)),
            batch._replace(length=np.full(12, 3)),
            batch._replace(id=np.full(12, 0x2AA)),
            batch._replace(id=np.full(12, 0x7FF)),
        ):
            layer.absorb([foreign], 4000)
        assert layer.last_heard().motor_us.tolist() == [0] * 12

    def test_error_codes_are_kept(self, go1: Robot, wiring: Wiring, layer: JointLayer) -> None:
        layer.absorb([replies(wiring, go1.default_pose, error=2)], 0)
        assert layer.last_heard().motor_error.tolist() == [2] * 12

    def test_only_a_new_imu_reading_counts_as_heard(self, wiring: Wiring, layer: JointLayer) -> None:
        def frames(counter: int) -> Frames:
            reading = imu.Inertial([0.1, 0.2, 0.3], [0.0, 0.0, 9.81], [1.0, 0.0, 0.0, 0.0])
            data = imu.encode(reading, counter)
            return Frames(np.full(3, wiring.imu_channel), np.array(imu.IDS), data, np.full(3, 8))

        assert layer.last_heard().imu_us == NEVER
        layer.absorb([frames(1)], 1000)
        layer.absorb([frames(1)], 2000)
        assert layer.last_heard().imu_us == 1000
        layer.absorb([frames(2)], 3000)
        assert layer.last_heard().imu_us == 3000
        np.testing.assert_allclose(layer.sensed().gyro, [0.1, 0.2, 0.3])
