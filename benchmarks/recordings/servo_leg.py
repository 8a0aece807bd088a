"""A servo with a pendulum as a leg for identify/: one hinge with the joint law's voltage-driven motor."""

from collections.abc import Mapping

import mujoco
import numpy as np

from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import Parameter
from footfall.identify.recording import Recording
from footfall.robots.actuator import Motor
from footfall.robots.stability import PLANT_TIMESTEP_S
from recordings.servo_logs import Log
from recordings.servo_pendulum import GRAVITY

RAMP_RAD_S = 0.05  # stable with explicit steps; `servo_pendulum` has implicit ones, and 0.01
JOINT = "servo"
PENDULUM = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" gravity="0 0 -{gravity}"/>
  <worldbody>
    <body name="pendulum">
      <joint name="servo" axis="0 1 0" armature="{armature}"/>
      <inertial pos="0 0 -{length}" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>
    </body>
  </worldbody>
</mujoco>
"""


def servo_leg(value: Mapping[str, float], log: Log) -> FixedLeg:
    """The pendulum of a recording, with fitted numbers of `servo_pendulum.NUMBERS`."""
    mass, length, supply = log.inputs[0, 3:]
    text = PENDULUM.format(
        step=PLANT_TIMESTEP_S, gravity=GRAVITY, armature=value["armature"], length=length, mass=mass
    )
    motor = Motor(
        peak_torque=np.array([1e3]),
        stall_torque=np.array([value["kt"] * supply / value["resistance"]]),
        no_load_speed=np.array([supply / value["kt"]]),
        friction=np.array([value["coulomb"]]),
        friction_speed=np.array([RAMP_RAD_S]),
        damping=np.array([value["viscous"]]),
        strength=np.ones(1),
        stribeck=np.array([value["stribeck"]]),
        stribeck_speed=np.array([value["stribeck_speed"]]),
        load_friction=np.array([value["load_friction"]]),
        voltage_gain=np.ones(1),
        duty_resistance=np.array([value["duty_resistance"]]),
    )
    model = mujoco.MjModel.from_xml_string(text)
    armature = np.array([value["armature"]])
    return FixedLeg("pendulum", model, np.array([0]), (JOINT,), ("pendulum",), armature, motor)


def delay_of(leg: FixedLeg, value: Mapping[str, float]) -> dict[Parameter, float]:
    """Delay and encoder bias in the form of a leg's fit."""
    (joint,) = leg.joint_names
    return {Parameter("delay_s", joint): value["delay"], Parameter("encoder_bias", joint): -value["offset"]}


def servo_recording(log: Log, stiffness: float) -> Recording:
    """A recording in the form used by the fit of a robot.

    Args:
        log: recording of the servo.
        stiffness: N m/rad at gain 1.
    """
    rows = len(log.time_s)
    command = np.zeros((rows, 5, 1))
    command[:, 0, 0], command[:, 2, 0] = log.inputs[:, 0], stiffness * log.gain
    return Recording(
        source=log.name,
        time_s=log.time_s,
        command=command,
        read_s=log.time_s[:, None],
        position=log.position[:, None],
        torque=np.full((rows, 1), np.nan),
        turn_rad_s=0.0,
        gravity=np.array([0.0, 0.0, -1.0]),
    )
