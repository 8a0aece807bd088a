"""Simulations become unstable beyond the bound on stiffness and damping."""

import mujoco
import numpy as np
import pytest

from footfall import Robot
from footfall.robots.mjcf import load_spec
from footfall.robots.model import joint_addresses
from footfall.robots.stability import instabilities
from footfall.robots.stance import in_default_pose


def mobility_of(robot: Robot, model: mujoco.MjModel) -> np.ndarray:
    """Joint accelerations per torque with a free base, by MuJoCo's forward dynamics, (n, n)."""
    model.opt.gravity[:], model.dof_frictionloss[:], model.dof_damping[:] = 0.0, 0.0, 0.0
    dofs, columns = joint_addresses(model, robot)[1], []
    for dof in dofs:
        data = in_default_pose(model, robot.description)
        data.qfrc_applied[dof] = 1.0
        mujoco.mj_forward(model, data)
        columns.append(data.qacc[dofs])
    return np.array(columns).T


@pytest.mark.parametrize(("share", "refused"), [(0.99, False), (1.01, True)])
def test_damping_beyond_a_plants_step_is_refused(go1: Robot, share: float, refused: bool) -> None:
    """kd, friction's ramp and viscous damping count together; the joint with the largest sum is named."""
    model = load_spec(go1.xml_path).compile()
    motor = go1.motor._replace(damping=np.linspace(0.1, 0.4, 12))
    damping = go1.kd + motor.friction / motor.friction_speed + motor.damping
    rates, modes = np.linalg.eig(mobility_of(go1, model) * damping)
    rate, worst = rates.real.max(), np.abs(modes[:, rates.real.argmax()] * np.sqrt(damping)).argmax()
    scale = share * 1.5 / (0.001 * rate)
    scaled = motor._replace(
        damping=scale * motor.damping + (scale - 1) * go1.kd, friction=scale * motor.friction
    )
    lines = list(instabilities(go1.description, model, go1.kp, go1.kd, scaled))
    assert any(f"joint {go1.joint_names[worst]}: kd, friction" in line for line in lines) is refused
    assert any(line.endswith("physics steps of 1 ms") for line in lines) is refused
