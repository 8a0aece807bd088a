"""The bound on stiffness and damping is where simulations of the robot begin to grow."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from footfall.robots.description import Robot, load_spec
from footfall.robots.model import joint_addresses, training_model
from footfall.robots.stability import MOST_TURNED_RAD, TRAINING_TIMESTEP_S, _fastest, _mobility, instabilities


def swinging(robot: Robot, frequency_hz: float) -> Robot:
    gains = replace(robot.description.gains, natural_frequency_hz=frequency_hz, damping_ratio=1e-3)
    return replace(robot, description=replace(robot.description, gains=gains))


def energy_grows(robot: Robot) -> bool:
    """In the air, without gravity: springs of stiffness kp at the joints, a little bent."""
    model = training_model(robot)
    model.opt.gravity[:] = 0.0
    data, (positions, dofs) = mujoco.MjData(model), joint_addresses(model, robot)
    data.qpos[positions] = robot.default_pose + 1e-6
    for _ in range(400):
        data.qfrc_applied[dofs] = robot.kp * (robot.default_pose - data.qpos[positions])
        mujoco.mj_step(model, data)
        if np.abs(data.qpos[positions] - robot.default_pose).max() > 1e-4:
            return True
    return False


@pytest.mark.parametrize(("share", "grows"), [(0.97, False), (1.03, True)])
def test_stiffness_is_refused_where_steps_begin_to_swing_up(go1: Robot, share: float, grows: bool) -> None:
    model = load_spec(go1.xml_path).compile()
    turned_rad = TRAINING_TIMESTEP_S * np.sqrt(_fastest(_mobility(go1, model), go1.kp)[0])
    limit_hz = go1.description.gains.natural_frequency_hz * MOST_TURNED_RAD / turned_rad
    robot = swinging(go1, share * limit_hz)
    assert any("too stiff" in line for line in instabilities(robot, model)) is grows
    assert energy_grows(robot) is grows
