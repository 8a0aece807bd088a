"""Physics of a robot's motors: joint law, lag, windings, gearbox friction and the learned part of the law."""

import numpy as np

from footfall.domain_rand.sample import Sample, randomised_motor, randomised_winding
from footfall.robots.actuator import (
    JointCommand,
    Motor,
    at_supply,
    friction_torque,
    lag_over,
    lagged,
    motor_torque,
)
from footfall.robots.actuator_net import ActuatorNet, inputs_of, learned_torque
from footfall.robots.winding import Winding, at_temperature, warmed


class Drivetrain:
    """Motors and gearboxes of all joints. Torques are N m at the joint, (n,), angles rad, velocities rad/s.

    Args:
        motor: limits and losses of the nominal motors.
        joints: number of motors.
        sample: differences from nominal motors.
        step_s: the physics step.
        winding: thermal parameters; None for windings of constant temperature.
        net: the learned part of the joint law; None for none.

    Attributes:
        winding_c: temperature of the windings, degrees Celsius, (n,); None if it is constant.
    """

    def __init__(
        self,
        motor: Motor,
        joints: int,
        sample: Sample,
        step_s: float,
        winding: Winding | None,
        net: ActuatorNet | None,
    ) -> None:
        self._motor = _without_unit_strength(randomised_motor(motor, sample))
        self._lag = None if self._motor.lag_s is None else lag_over(self._motor.lag_s, step_s)
        self._winding, self._step_s = randomised_winding(winding, sample), step_s
        self.winding_c = None if self._winding is None else np.array(self._winding.start_c)
        self._lagged = np.zeros(joints)  # torque at the end of the last step, of motors with lag
        self._net, self._memory = net, None if net is None else net.rest()

    def demand(self, command: JointCommand, measured: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Torque by the joint law, at the position that the encoders measure."""
        motor = at_temperature(self._motor, self.winding_c, self._winding)
        return motor_torque(command, measured, velocity, motor)

    def delivered(self, demand: np.ndarray) -> np.ndarray:
        """Mean torque over this step after the motors' lag. The torque warms the motors' windings."""
        mean = demand
        if self._lag is not None:
            mean, self._lagged = lagged(demand, self._lagged, self._lag)
        if self._winding is not None:
            self.winding_c = warmed(self.winding_c, mean * mean, self._winding, self._step_s)
        return mean

    def friction(self, velocity: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Friction of gearboxes that transmit a torque."""
        return friction_torque(velocity, self._motor, torque)

    def behind_gearbox(
        self,
        command: JointCommand,
        enabled: np.ndarray,
        position: np.ndarray,
        encoder_bias: np.ndarray,
        velocity: np.ndarray,
        torque: np.ndarray,
    ) -> np.ndarray:
        """Torque behind gearboxes that transmit a torque; the learned part's memory advances by a step."""
        joint_torque = torque + self.friction(velocity, torque)
        if self._net is None:
            return joint_torque
        command = command._replace(kp=enabled * command.kp)
        inputs = inputs_of(self._net, command, position + encoder_bias, velocity, torque)
        learned = learned_torque(self._net, inputs, self._memory, self._step_s)
        self._memory = learned.memory
        result: np.ndarray = joint_torque + learned.torque
        return result

    def weaken(self, strength: np.ndarray) -> None:
        """Scale the delivered torque of each motor from now on, (n,)."""
        before = 1.0 if self._motor.strength is None else self._motor.strength
        self._motor = self._motor._replace(strength=before * strength)

    def sag(self, share: float) -> None:
        """Scale the supply voltage by `share` (see `at_supply`)."""
        self._motor = at_supply(self._motor, share)


def _without_unit_strength(motor: Motor) -> Motor:
    """The motor, with `strength` None if it is 1: multiplying by it would take time at each physics step."""
    return motor._replace(strength=None) if np.all(motor.strength == 1.0) else motor
