"""A net learns a torque that is missing in the joint law, from motion alone."""

import numpy as np
from one_motor import ONE_MOTOR

from footfall.robots.actuator import JointCommand, Motor, friction_torque, motor_torque
from footfall.robots.actuator_net import inputs_of, learned_torque
from footfall.robots.driven_motion import DrivenMotion, joined_motion
from footfall.train.actuator_net import NetConfig, train_net

STEP_S, INERTIA, STEPS = 0.002, 0.05, 1500
HIDDEN = ONE_MOTOR._replace(stribeck=np.array([0.4]), damping=np.array([0.4]))
QUICK = NetConfig(hidden=(8,), window_s=0.05, windows=32, steps=150, seeds=1)


def moved(motor: Motor, seed: int) -> DrivenMotion:
    """A joint follows a target of three sines."""
    rng = np.random.default_rng(seed)
    time_s = STEP_S * np.arange(STEPS)[:, None]
    hz, phase = rng.uniform(0.3, 3.0, 3), rng.uniform(0.0, 6.0, 3)
    command = np.zeros((STEPS, 5, 1))
    command[:, 0, 0] = 0.15 * np.sin(2 * np.pi * hz * time_s + phase).sum(axis=1)
    command[:, 2], command[:, 3] = 30.0, 0.8
    position, velocity = np.zeros((STEPS, 1)), np.zeros((STEPS, 1))
    for row, values in enumerate(command[:-1]):
        torque = motor_torque(JointCommand.of(values), position[row], velocity[row], motor)
        force = torque + friction_torque(velocity[row], motor, torque)
        velocity[row + 1] = velocity[row] + STEP_S * force / INERTIA
        position[row + 1] = position[row] + STEP_S * velocity[row + 1]
    by_law = motor_torque(JointCommand.of(np.moveaxis(command, 1, 0)), position, velocity, ONE_MOTOR)
    acceleration = np.gradient(velocity[:, 0], STEP_S)[:, None]
    missing = INERTIA * acceleration - by_law - friction_torque(velocity, ONE_MOTOR, by_law)
    starts = np.arange(50, STEPS - 30)
    return DrivenMotion(
        STEP_S, command, position, velocity, acceleration, np.full((STEPS, 1, 1), INERTIA),
        np.zeros((STEPS, 1)), by_law, by_law, missing, starts, starts // 500,
    )  # fmt: skip


def test_a_net_learns_the_torque_missing_in_the_law() -> None:
    motion, unseen = joined_motion([moved(HIDDEN, 0), moved(HIDDEN, 1)]), moved(HIDDEN, 2)
    found = train_net(motion, unseen, ONE_MOTOR, QUICK)
    assert (found.net_rad < 0.3 * found.law_rad).all()
    speeds = np.linspace(-2.0, 2.0, 9)[:, None]
    command = JointCommand(*np.zeros((2, 9, 1)), *np.zeros((3, 9, 1)))
    inputs = inputs_of(found.net, command, np.zeros((9, 1)), speeds, np.zeros((9, 1)))
    memory = np.repeat(inputs[:, :, None], 2, axis=2)
    lacking = friction_torque(speeds, HIDDEN) - friction_torque(speeds, ONE_MOTOR)
    learned = learned_torque(found.net, inputs, memory, STEP_S).torque
    assert np.abs(learned - lacking).max() < 0.4 * np.abs(lacking).max()
