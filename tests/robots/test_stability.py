"""The bound on stiffness and damping is where simulations of the robot begin to grow."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec
from footfall.robots.model import joint_addresses, training_model
from footfall.robots.stability import (
    MOST_TURNED_RAD,
    TRAINING_TIMESTEP_S,
    _fastest,
    _mobility,
    instabilities,
    longest_timestep,
)
from footfall.robots.stance import in_default_pose


def swinging(robot: Robot, frequency_hz: float) -> Robot:
    gains = replace(robot.description.gains, natural_frequency_hz=frequency_hz, damping_ratio=1e-3)
    return replace(robot, description=replace(robot.description, gains=gains))


def energy_grows(robot: Robot, timestep_s: float = TRAINING_TIMESTEP_S) -> bool:
    """In the air, without gravity: springs of stiffness kp at the joints, a little bent."""
    model = training_model(robot, timestep_s)
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
    turned_rad = TRAINING_TIMESTEP_S * np.sqrt(_fastest(_mobility(go1.description, model), go1.kp)[0])
    limit_hz = go1.description.gains.natural_frequency_hz * MOST_TURNED_RAD / turned_rad
    robot = swinging(go1, share * limit_hz)
    found = list(instabilities(robot.description, model, robot.kp, robot.kd, robot.motor))
    assert any("too stiff for physics steps of 5 ms" in line for line in found) is grows
    assert energy_grows(robot) is grows


@pytest.mark.parametrize(("share", "grows"), [(0.97, False), (1.03, True)])
def test_the_longest_step_is_where_steps_begin_to_swing_up(go1: Robot, share: float, grows: bool) -> None:
    longest_s, _ = longest_timestep(go1.description, training_model(go1), go1.kp)
    assert energy_grows(go1, share * longest_s) is grows


def test_mobility_is_how_joints_answer_torques_while_the_base_is_free(go1: Robot) -> None:
    model = load_spec(go1.xml_path).compile()
    model.opt.gravity[:], model.dof_frictionloss[:], model.dof_damping[:] = 0.0, 0.0, 0.0
    dofs, mobility = joint_addresses(model, go1)[1], _mobility(go1.description, model)
    for joint in (1, 6, 11):
        data = in_default_pose(model, go1.description)
        data.qfrc_applied[dofs[joint]] = 1.0
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.qacc[dofs], mobility[:, joint], atol=1e-9)
    assert np.abs(data.qacc[:6]).max() > 0.01


@pytest.mark.parametrize("fastest", range(3))
@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_the_fastest_joint_is_the_one_that_moves_most(fastest: int, signs: tuple[int, ...]) -> None:
    """Of a mode (0.6, -0.5, -0.62) in any order and with any signs."""
    mode = np.roll([0.62, -0.6, -0.5], fastest) * signs
    gains = np.array([4.0, 9.0, 0.25])
    scaled = 7.0 * np.outer(mode, mode) / (mode @ mode) + np.eye(3)
    mobility = scaled / np.sqrt(np.outer(gains, gains))
    value, joint = _fastest(mobility, gains)
    assert value == pytest.approx(8.0)
    assert joint == fastest


@pytest.mark.parametrize(("share", "refused"), [(0.99, False), (1.01, True)])
def test_damping_is_refused_where_a_plants_step_would_take_one_and_a_half_times_the_speed(
    go1: Robot, share: float, refused: bool
) -> None:
    """kd, the ramp of friction and viscous damping together; the joint that is damped most is named."""
    model = load_spec(go1.xml_path).compile()
    mobility = _mobility(go1.description, model)
    motor = go1.motor._replace(damping=np.linspace(0.1, 0.4, 12))
    damping = go1.kd + motor.friction / motor.friction_speed + motor.damping
    rates, modes = np.linalg.eig(mobility * damping)
    rate, worst = rates.real.max(), np.abs(modes[:, rates.real.argmax()] * np.sqrt(damping)).argmax()
    wanted = share * 1.5 / (0.001 * rate)
    scaled = motor._replace(
        damping=wanted * motor.damping + (wanted - 1) * go1.kd, friction=wanted * motor.friction
    )
    lines = list(instabilities(go1.description, model, go1.kp, go1.kd, scaled))
    assert any(f"joint {go1.joint_names[worst]}: kd, friction" in line for line in lines) is refused
    assert any(line.endswith("physics steps of 1 ms") for line in lines) is refused
