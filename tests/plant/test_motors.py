"""Simulated motors: each follows its own commands, and reports."""

from typing import Any

import jax
import numpy as np
from one_motor import THREE_MOTORS as MOTOR
from some_net import some_net

from footfall.deploy.drivers.driver import Motors
from footfall.deploy.frames import Frames
from footfall.domain_rand.sample import Sample
from footfall.envs.physics.interface import Drive, joint_effort
from footfall.plant.drivetrain import Drivetrain
from footfall.plant.motor_ends.motor_end import Report, Request, Requests
from footfall.plant.motors import SimulatedMotors
from footfall.robots.actuator import JointCommand, friction_torque, motor_torque
from footfall.robots.actuator_net import ActuatorNet

VALUES = np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0], [10.0, 20.0, 30.0], [0.5, 0.6, 0.7], [1.5, 2.5, 3.5]])
POSITION, VELOCITY = np.array([0.3, -0.2, 0.5]), np.array([0.5, -1.0, 2.0])
READINGS = np.array([[0.3, -0.2, 0.5], [0.5, -1.0, 2.0], [7.0, 8.0, 9.0]])
NO_FRAMES = Frames(*np.zeros((4, 0), dtype=int))


class End:
    """A motor protocol whose frames are given as requests; the errors of the last reply are kept."""

    filters, broadcasts, timeout_s = (), False, np.full(3, np.nan)
    timeout_error, timeout_latches = 13, False

    def __init__(self) -> None:
        self.next: Requests | None = None
        self.error: list[int] = []
        self.requests = lambda _: self.next
        self.settings_replies = self.broadcast = lambda *_: None

    def reply(self, motor: Motors, report: Report) -> Frames:
        self.error = report.error.tolist()
        return NO_FRAMES


class Stand:
    """Three motors on a test stand, stepped by hand."""

    def __init__(self, net: ActuatorNet | None = None, **sample: Any) -> None:
        self.end = End()
        self.motors = SimulatedMotors(self.end, MOTOR, 3, Sample(**sample), 0.001, timeout_s=0.02, net=net)

    def ask(self, step: int, motor: Motors, kind: list[Request] | None, values: np.ndarray) -> None:
        self.end.next = Requests(motor, values.copy(), None if kind is None else np.array(kind))
        self.motors.answer(step, NO_FRAMES, READINGS)

    def on(self, step: int = 0, *motors: int) -> None:
        which = np.array(motors or (0, 1, 2))
        self.ask(step, which, [Request.ENABLE] * len(which), np.zeros((5, len(which))))

    def torque(self, step: int) -> np.ndarray:
        return self.motors.torque(step, POSITION, VELOCITY)


def torque_of(values: np.ndarray) -> np.ndarray:
    return motor_torque(JointCommand(*values), POSITION, VELOCITY, MOTOR)


class TestMotors:
    def test_each_motor_follows_its_own_command_until_the_next(self) -> None:
        stand = Stand()
        assert not stand.torque(0).any()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        np.testing.assert_allclose(stand.torque(0), torque_of(VALUES))
        other = VALUES[:, [2, 0]] * 1.1
        stand.ask(1, np.array([2, 0]), None, other)
        expected = VALUES.copy()
        expected[:, [2, 0]] = other
        np.testing.assert_allclose(stand.torque(1), torque_of(expected))
        friction = stand.motors.drivetrain.friction(VELOCITY, np.zeros(3))
        np.testing.assert_allclose(friction, friction_torque(VELOCITY, MOTOR))

    def test_each_weakening_adds_to_those_before(self) -> None:
        nominal = MOTOR._replace(strength=np.ones(3))
        drivetrain = Drivetrain(nominal, 3, Sample(), 0.001, winding=None, net=None)
        for strength, total in ((0.5, 0.5), (0.8, 0.4)):
            drivetrain.weaken(np.full(3, strength))
            weak = nominal._replace(strength=total)
            expected = motor_torque(JointCommand(*VALUES), POSITION, VELOCITY, weak)
            np.testing.assert_allclose(drivetrain.demand(JointCommand(*VALUES), POSITION, VELOCITY), expected)

    def test_a_learned_part_of_the_law_acts_as_in_training(self) -> None:
        """The steps are so long that the memory has an effect."""
        net = some_net(3)
        values = VALUES * np.array([1.0, 0.0, 1.0, 1.0, 0.0])[:, None]
        stand = Stand(net)
        stand.motors.encoder_bias[:] = 0.01
        stand.on()
        stand.ask(0, slice(None), None, values)
        drive = Drive(values[:1], values[2], values[3], MOTOR, stand.motors.encoder_bias)
        effort = jax.jit(lambda *now: joint_effort(drive, values[0], *now[:2], 0.001, None, net, now[2]))
        memory, learned = net.rest(), np.zeros(3)
        for step in range(4):
            position, velocity = POSITION + 0.01 * step, (1.0 - 0.5 * step) * VELOCITY
            torque = stand.motors.torque(step, position, velocity)
            simulated = stand.motors.at_joint(position, velocity, torque)
            trained = effort(position, velocity, memory)
            np.testing.assert_allclose(simulated, trained.torque, rtol=1e-4, atol=1e-4)
            memory = trained.net_memory
            learned = simulated - torque - stand.motors.drivetrain.friction(velocity, torque)
        assert (np.abs(learned) > 0.01).all()

    def test_a_delay_holds_back_commands_but_not_switching(self) -> None:
        """A delay of 2.6 ms is three steps, so two commands are under way at the same time."""
        stand = Stand(action_delay_s=0.0026)
        stand.on()
        assert not stand.torque(0).any()
        assert stand.motors.enabled.all()
        stand.ask(1, slice(None), None, VALUES)
        stand.ask(2, slice(None), None, 0.5 * VALUES)
        assert not stand.torque(3).any()
        np.testing.assert_allclose(stand.torque(4), torque_of(VALUES))
        np.testing.assert_allclose(stand.torque(5), torque_of(0.5 * VALUES))
        kinds = [Request.COMMAND, Request.DISABLE]
        stand.ask(6, np.array([1, 0]), kinds, VALUES[:, [1, 0]])
        found = stand.torque(8)
        assert found[0] == 0.0
        np.testing.assert_allclose(found[1:], torque_of(0.5 * VALUES)[1:])
        mixed = 0.5 * VALUES
        mixed[:, 1] = VALUES[:, 1]
        np.testing.assert_allclose(stand.torque(9)[1:], torque_of(mixed)[1:])

    def test_a_motor_enabled_again_continues_and_a_disabled_motor_is_limp(self) -> None:
        stand = Stand()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        stand.torque(0)
        stand.ask(1, np.array([1]), [Request.DISABLE], VALUES[:, :1])
        stand.on(2)
        found = stand.torque(2)
        np.testing.assert_allclose(found[[0, 2]], torque_of(VALUES)[[0, 2]])
        assert found[1] == 0.0

    def test_a_motor_without_commands_disables_itself_and_reports_it_until_enabled(self) -> None:
        """The motor disables itself after 20 steps; every fifth step is checked."""
        stand = Stand()
        stand.on()
        stand.ask(0, slice(None), None, VALUES)
        for step in range(1, 26):
            stand.ask(step, np.array([0, 2]), None, VALUES[:, [0, 2]])
            found = stand.torque(step)
            assert (found[1] == 0.0) == (step >= 25), step
            assert found[[0, 2]].all()
        assert stand.motors.enabled.tolist() == [True, False, True]
        stand.motors.faults.error[:] = [2, 0, 0]
        stand.ask(26, slice(None), None, VALUES)
        assert stand.end.error == [2, 13, 0]
        stand.on(27, 1)
        stand.ask(28, np.array([2, 1, 0]), None, VALUES)
        assert stand.end.error == [0, 0, 2]
