"""What the simulation knows: the true state in its frames, what motors cost, how far a robot came."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from footfall.deploy.wiring import wire
from footfall.domain_rand.sample import Sample
from footfall.plant.energy import EnergyMeter
from footfall.plant.episode import true_base_state
from footfall.plant.progress import Progress, path_length
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot


def new_body(robot: Robot, sample: Sample | None = None) -> SimulatedRobot:
    wiring = wire(robot)
    return SimulatedRobot(
        robot, wiring, SimulatedWires(wiring.buses), PlantConfig(sample=sample or {}, held=False)
    )


class TestTruth:
    def test_velocities_are_in_the_body_frame(self, go1: Robot) -> None:
        """Turned to the left by 90 degrees, the world's y is forward. Angular velocity is MuJoCo's own."""
        body = new_body(go1)
        body.data.qpos[3:7] = np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)
        body.data.qvel[:6] = 0.0, 1.0, 0.5, 0.1, 0.2, 0.3
        mujoco.mj_forward(body.model, body.data)
        truth = body.truth()
        np.testing.assert_allclose(truth.base_velocity, [1.0, 0.0, 0.5], atol=1e-12)
        np.testing.assert_allclose(truth.base_angular_velocity, [0.1, 0.2, 0.3], atol=1e-12)

    def test_a_foot_moves_as_its_leg_turns(self, go1: Robot) -> None:
        """A thigh that turns at w moves a foot that hangs straight below it at w times its distance."""
        body = new_body(go1)
        body.data.qpos[2] = 1.0
        body.data.qvel[7] = 2.0  # the first leg's thigh, about y
        mujoco.mj_forward(body.model, body.data)
        truth = body.truth()
        thigh = body.data.xanchor[body.model.joint("FR_thigh_joint").id]
        arm = truth.foot_position[0] - thigh
        np.testing.assert_allclose(truth.foot_velocity[0], [2.0 * arm[2], 0.0, -2.0 * arm[0]], atol=0.15)
        np.testing.assert_allclose(truth.foot_velocity[1:], 0.0, atol=1e-12)

    def test_feet_in_the_air_bear_nothing(self, go1: Robot) -> None:
        body = new_body(go1)
        body.data.qpos[2] = 1.0
        mujoco.mj_forward(body.model, body.data)
        truth = body.truth()
        assert not truth.foot_contact.any()
        assert truth.foot_force.tolist() == [0.0] * 4


class TestEnergy:
    def test_power_is_a_mean_since_it_was_last_taken(self, go1: Robot) -> None:
        meter = EnergyMeter(go1)
        torque, velocity = np.zeros(12), np.zeros(12)
        torque[0], velocity[0] = 2.0, 3.0
        torque[5], velocity[5] = 1.0, -4.0
        meter.add(torque, velocity - 1.0, velocity + 1.0)  # the mean of before and after counts
        meter.add(0 * torque, velocity, velocity)
        first = meter.take()
        assert first.mechanical == pytest.approx((6.0 - 4.0) / 2)
        assert first.positive == pytest.approx(6.0 / 2)
        hip, knee = (
            0.17 / (0.105 * gear) ** 2 for gear in (6.0, 9.0)
        )  # winding resistance, as seen at the joint
        assert first.electrical == pytest.approx(1.0 + (hip * 4.0 + knee * 1.0) / 2)
        meter.add(0 * torque, velocity, velocity)
        assert meter.take().electrical == 0.0

    def test_work_becomes_kinetic_energy(self, go1: Robot) -> None:
        """Without weight, friction and ground, what the motors put in is what moves: the mean speed of a step
        gives that to second order, the speed before it would miss a fifth in these five steps."""
        body = new_body(go1, Sample(joint_friction=np.zeros(12)))
        model, data = body.model, body.data
        model.opt.gravity[:] = 0.0
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        data.qpos[2] = 1.0
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        motors = body._motors
        motors.enabled[:] = True
        motors._note_enabled()
        motors._values[4] = np.tile([0.0, 1.0, 0.0], 4)
        body.take_power()
        body.advance(body.time_us + 5000)
        mujoco.mj_forward(model, data)
        assert body.take_power().mechanical * 0.005 == pytest.approx(float(data.energy[1]), rel=0.02)


class TestProgress:
    def test_a_path_is_measured_in_chords_of_half_a_second(self) -> None:
        """Two metres along a line with a sway of 5 cm at 2 Hz, and a corner of one metre to the left."""
        time_s = np.arange(0.0, 2.0, 0.01)
        sway = 0.05 * np.sin(4 * np.pi * time_s)
        along = np.column_stack([time_s, sway, 0.3 + 0 * time_s])
        assert path_length(along, 100.0) == pytest.approx(1.99, abs=0.01)
        corner = np.array([[0.0, 0.0, 0.0]] * 50 + [[2.0, 0.0, 0.0]] * 50 + [[2.0, 1.0, 9.0]] * 50)
        assert path_length(corner, 100.0) == pytest.approx(3.0)

    def test_the_mean_velocity_is_over_all_samples(self) -> None:
        progress = Progress(10.0)
        assert np.isnan(progress.mean_velocity).all()
        assert progress.distance_m == 0.0
        for step in range(4):
            progress.add(np.array([0.1 * step, 0.0, 0.0]), np.array([float(step), 1.0, -step]))
        np.testing.assert_allclose(progress.mean_velocity, [1.5, 1.0, -1.5])
        assert progress.distance_m == pytest.approx(0.3)


def test_a_robot_whose_wires_carry_nothing_lies_still_in_the_end(go1: Robot) -> None:
    """No frame, no torque: it sinks, and its joints come to rest by friction alone."""
    wiring = wire(go1)
    wires = SimulatedWires(wiring.buses)
    body = SimulatedRobot(go1, wiring, wires)
    body.advance(1_500_000)
    truth = body.truth()
    assert not truth.motor_torque.any()
    assert np.abs(truth.joint_velocity).max() < 0.3
    assert wires.receive(Side.HOST, 1_500_000)  # the IMU reports all the same


def test_a_policys_true_height_is_above_the_feet_that_stand() -> None:
    """Feet at 2 and 4 cm stand, one at 20 cm swings, and one is not known."""
    foot_position = np.array([[0.0, 0.0, 0.02], [0.0, 0.0, 0.2], [0.0, 0.0, 0.04], [np.nan] * 3])
    truth = SimpleNamespace(
        base_velocity=np.array([0.5, 0.0, 0.0]),
        base_position=np.array([9.0, 9.0, 0.33]),
        foot_position=foot_position,
        foot_contact=np.array([True, False, True, False]),
    )
    velocity, height = true_base_state(SimpleNamespace(truth=lambda: truth))()  # type: ignore[arg-type]
    np.testing.assert_array_equal(velocity, truth.base_velocity)
    assert height == pytest.approx(0.30)
