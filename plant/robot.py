"""The simulated robot behind the bus: a body in a physics engine whose motors receive frames.

Frames take effect, and readings are taken, at the nearest physics step.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.arrays import as_slice
from footfall.common.engines import DEFAULT_ENGINE
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.deploy.config import DeployConfig
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.domain_rand.bodies import apply_to_model, body_map
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import QUANTITIES, require_parts
from footfall.domain_rand.sample import Sample, battery_charge
from footfall.plant.battery import SimulatedBattery
from footfall.plant.connection import Connection
from footfall.plant.energy import EnergyMeter, Power
from footfall.plant.engines.choice import open_engine
from footfall.plant.foot_sensors import SimulatedFootSensors
from footfall.plant.ground import replaced_by
from footfall.plant.ground_truth import GroundTruth, Snapshot, Truth
from footfall.plant.holder import Support, holder
from footfall.plant.imu_ends import SimulatedImu
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motors import MotorFaults, SimulatedMotors
from footfall.plant.placing import initial_pose, put_down
from footfall.plant.sensors import Layout, SimulatedSensors
from footfall.plant.wires import SimulatedWires
from footfall.robots import kinds
from footfall.robots.description import Robot
from footfall.robots.model import Plant, joint_addresses, read_plant
from footfall.terrain.ground import Ground

HELD_UP_S = DeployConfig().held_up_s
BROADCAST_PERIOD_US = 1000  # of frames that motors send without a request


@dataclass
class Faults:
    """Injected faults."""

    motors: MotorFaults
    imu_silent: bool = False
    imu_stuck: bool = False  # repeats its last reading
    on_wire: Callable[[Frames], Frames] | None = None  # changes the frames that the robot sends


@dataclass(frozen=True)
class PlantConfig:
    """Differences between the simulated robot and the robot that the controller assumes."""

    plant: Path | None = None  # another MJCF
    engine: str = DEFAULT_ENGINE  # physics engine, see plant/engines/choice.py
    ground: Ground | None = None  # None: the MJCF's own ground, flat if it has none
    sample: Sample = field(default_factory=dict)
    noise: Noise | None = None
    motor_timeout_s: float | None = None  # of all motors; None: robot.yaml's
    lying: bool = False  # starts in the robot's lying pose
    hanging: bool = False  # hangs in a frame, its feet in the air
    clamped: bool = False  # feet in the air, the base bolted to a stand
    lowered: bool = False  # a hanging or clamped robot's feet touch the ground, in the default pose
    charge: float = 1.0  # initial charge of the battery, if robot.yaml declares one
    held: bool = True  # does not move until its motors are commanded
    # Time after the first command at which a robot that cannot stand by itself is released (`held_start`).
    release_after_s: float = HELD_UP_S


class SimulatedRobot:
    """A simulated robot behind its buses.

    It starts in its default pose on the ground, or lying, and does not move until motors are commanded.
    """

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        wires: SimulatedWires,
        config: PlantConfig | None = None,
        seed: int = 0,
    ) -> None:
        """Raises UserError if plant, robot and sample do not fit, or for `lying` without a lying pose."""
        config = config or PlantConfig()
        sample = config.sample
        plant = read_plant(robot, config.plant, replaced_by(config.ground), visual=False)
        _check_sample(sample, plant, robot)
        self.model, self.notes = plant.model, plant.notes
        apply_to_model(self.model, sample, body_map(self.model, robot))
        self.data = mujoco.MjData(self.model)
        self._qvel, self._applied = self.data.qvel, self.data.qfrc_applied
        qpos, qvel = joint_addresses(self.model, robot)
        base_joint = self.model.body_jntadr[plant.base]
        self._layout = Layout(
            as_slice(qpos),
            as_slice(qvel),
            int(self.model.jnt_qposadr[base_joint]),
            int(self.model.jnt_dofadr[base_joint]),
        )
        step_s = float(self.model.opt.timestep)
        configured_s = config.motor_timeout_s
        timeout_s = robot.motor_figures("timeout_s") if configured_s is None else np.array(configured_s)
        self._step, self._step_us = 0, round(step_s * 1e6)
        self._motors = SimulatedMotors(
            open_motor_end(wiring), plant.motor, len(qpos), sample, step_s, timeout_s, robot.winding, seed,
            robot.actuator_net,
        )  # fmt: skip
        self._connection = Connection(wires, sample, seed)
        self._sensors = SimulatedSensors(
            self.data, self._layout, sample, config.noise, step_s, len(qpos), seed,
            mean_velocity=config.engine != DEFAULT_ENGINE,
        )  # fmt: skip
        self._energy = EnergyMeter(robot)
        declared, self.battery = robot.description.battery, None
        if declared is not None:
            charge = battery_charge(sample, config.charge)
            self.battery = SimulatedBattery(robot, declared, self._motors, float(charge), step_s)
        self._engine = open_engine(config.engine, self.model, self.data, plant.foot_geoms, config.ground)
        self._ground_truth = GroundTruth(
            plant, self.data, self._engine, self._layout, robot.description.standing_height_m
        )
        self._torque = np.zeros(len(qpos))
        self._imu = SimulatedImu(wiring, step_s)
        self.foot_sensors: SimulatedFootSensors | None = None  # None: the robot has none
        if robot.foot_sensors:
            force = self._ground_truth.foot_force
            self.foot_sensors = SimulatedFootSensors(wiring, force, sample, step_s, seed)
        self.faults = Faults(self._motors.faults)
        put_down(robot, self.model, self.data, self._layout, initial_pose(robot, config.lying))
        height_m = 0.0 if config.lowered else robot.description.standing_height_m
        robot_holder = holder(
            robot, self.model, self.data, self._layout, plant.base, config.hanging, config.clamped, height_m
        )
        held_steps = math.inf if config.hanging or config.clamped else round(config.release_after_s / step_s)
        self._support = Support(robot_holder, held_steps, config.held)
        if self._support.still:
            self._keep_still()

    @property
    def time_us(self) -> int:
        """Simulated time."""
        return self._step * self._step_us

    @property
    def motors_on(self) -> np.ndarray:
        """Which motors are enabled, (n,) bool."""
        return self._motors.enabled.copy()

    def advance(self, now_us: int) -> None:
        """Simulate up to a time, exchanging frames."""
        while (self._step + 1) * self._step_us <= now_us:
            self._advance_one_step()

    def truth(self) -> Truth:
        """The true state."""
        return self._ground_truth.truth(self._torque)

    def snapshot(self) -> Snapshot:
        """Raw state, from which `truths` computes the true state later."""
        return self._ground_truth.snapshot(self._torque)

    def truths(self, snapshots: Sequence[Snapshot]) -> Truth:
        """The true states of T snapshots: arrays (T, ...)."""
        return self._ground_truth.truths(snapshots)

    def fall(self, snapshot: Snapshot | None = None) -> str | None:
        """Why the robot counts as fallen, or None: now, or in a snapshot."""
        return self._ground_truth.fall(snapshot or self.snapshot())

    def diverged(self) -> bool:
        """Whether the simulation diverged."""
        return self._engine.diverged()

    def take_power(self) -> Power:
        """Mean power of the motors since the last call."""
        return self._energy.take()

    def push(self, delta_v_world: tuple[float, float, float]) -> None:
        """Add to the velocity of the whole robot, m/s, world frame."""
        at = self._layout.base_qvel
        self.data.qvel[at : at + 3] += delta_v_world

    def reboot(self, motors: np.ndarray) -> None:
        """Restart motors (joint indices): they reply, without torque until they are enabled again."""
        self._motors.reboot(motors)

    @property
    def encoder_bias(self) -> np.ndarray:
        """Bias of each motor's encoder, rad, (n,); may be written to."""
        return self._motors.encoder_bias

    def weaken(self, strength: np.ndarray) -> None:
        """Scale the delivered torque of each motor from now on, (n,); a negative factor reverses it."""
        self._motors.weaken(strength)

    def rewire(self, wiring: Wiring) -> None:
        """Connect the motors according to another wiring, so that addresses reach other motors."""
        self._motors.rewire(open_motor_end(wiring))

    def regear(self, ratio: np.ndarray, about: np.ndarray) -> None:
        """Give motors other gear ratios than their firmware assumes (see `SimulatedMotors.regear`)."""
        self._motors.regear(ratio, about)

    def sag(self, share: float) -> None:
        """Scale the voltage of the motors' supply by `share` from now on."""
        self._motors.sag(share)

    def _advance_one_step(self) -> None:
        now_us, motors, sensors = self._step * self._step_us, self._motors, self._sensors
        true_state = sensors.remember(self._torque)
        position, velocity = true_state[0], true_state[1]
        if self.foot_sensors is not None:
            self.foot_sensors.remember()
            if self._imu.due(self._step):
                self._send(self.foot_sensors.sample(), now_us)
        for frames in self._connection.receive(now_us + self._step_us / 2):
            replies = motors.answer(self._step, frames, sensors.joints(motors.encoder_bias))
            if replies is not None:
                self._send(replies, now_us)
        if motors.broadcasts and now_us % BROADCAST_PERIOD_US == 0:
            broadcast = motors.broadcast(now_us, sensors.joints(motors.encoder_bias))
            if broadcast is not None:
                self._send(broadcast, now_us)
        if self._imu.due(self._step) and not self.faults.imu_silent:
            self._send(self._imu.frames(sensors.inertial, self.faults.imu_stuck), now_us)
        self._torque = torque = motors.torque(self._step, position, velocity)
        joints = self._layout.qvel
        self._applied[joints] = motors.at_joint(position, velocity, torque)
        self._support.apply(motors.commanded)
        if self._support.still:
            self._keep_still()
        else:
            self._engine.step()
        after = self._qvel[joints]
        self._energy.add(torque, velocity, after)
        if self.battery is not None:
            self.battery.add(torque, velocity, after)
        self._step += 1

    def _keep_still(self) -> None:
        """A step without motion: the accelerometer measures the support of the robot."""
        model, data = self.model, self.data
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        data.qacc[:] = 0.0
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)

    def _send(self, frames: Frames, now_us: float) -> None:
        if self.faults.on_wire is not None:
            frames = self.faults.on_wire(frames)
        self._connection.send(frames, now_us)


def _check_sample(sample: Sample, plant: Plant, robot: Robot) -> None:
    bodies = plant.model.nbody - 1
    for name, drawn in sample.items():
        if name not in QUANTITIES:
            raise UserError(f"sample: no quantity '{name}'{did_you_mean(name, QUANTITIES)}")
        require_parts(name, robot)
        if QUANTITIES[name].kind is kinds.BODY_AMOUNTS and len(drawn) != bodies:
            raise UserError(f"{name} was drawn for {len(drawn)} bodies, the plant has {bodies}")
