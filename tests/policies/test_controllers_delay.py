"""Controllers measure the delay of their commands and predict the state at which they act."""

import numpy as np
import pytest
from moments import readings

from footfall.evaluate.plan import CommandSchedule
from footfall.plant.episode import Episode, run_episode
from footfall.policies.controllers.delay import CommandDelay
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand, motor_torque
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
JOINTS = len(ROBOT.joint_names)
TICK_S = 0.002


def measured(delay_ticks: int, change_nm: float) -> int:
    """Measured delay, in ticks, of motors that follow the command sent `delay_ticks` before the last one."""
    rng = np.random.default_rng(0)
    delay, sent, still = CommandDelay(ROBOT.motor, TICK_S), [], np.zeros(JOINTS)
    for tick in range(200):
        position = ROBOT.default_pose + 0.005 * change_nm * np.sin(0.1 * tick)
        active = sent[max(0, tick - 1 - delay_ticks)] if sent else JointCommand(*np.zeros((5, JOINTS)))
        torque = motor_torque(active, position, still, ROBOT.motor) + 0.02 * rng.standard_normal(JOINTS)
        delay.measure(readings(ROBOT, joint=position, torque=torque))
        wave = change_nm * np.sin(0.13 * tick + np.arange(JOINTS))
        sent.append(JointCommand(position, still, np.full(JOINTS, 20.0), np.full(JOINTS, 1.0), wave))
        delay.record(sent[-1])
    return delay.ticks


@pytest.mark.parametrize("delay_ticks", [1, 2, 8, 16])
def test_the_delay_shows_in_the_reported_torques(delay_ticks: int) -> None:
    assert measured(delay_ticks, change_nm=2.0) == delay_ticks


def test_velocity_changes_are_relative_to_the_acting_command() -> None:
    delay, rows = CommandDelay(ROBOT.motor, TICK_S), np.ones(JOINTS)
    for velocity in (1.0, 4.0, 9.0):
        delay.record(JointCommand(0.0 * rows, velocity * rows, rows, rows, 0.0 * rows))
    np.testing.assert_array_equal(delay.velocity_changes(), [5.0 * rows])  # a tick late: 9 is sent, 4 acts


def test_walks_and_turns_though_commands_act_30_ms_late() -> None:
    schedule = CommandSchedule((0.0, 0.8), ((0.5, 0.2, 0.0), (0.8, 0.0, 0.6)))
    episode = Episode(schedule, duration_s=1.7, sample={"action_delay_s": np.array(0.03)})
    trace = run_episode(ROBOT, load_policy("mpc", ROBOT), episode)
    assert not trace.fell, trace.fall_reason
    assert trace.base_velocity[-25:, 0].mean() == pytest.approx(0.8, abs=0.1)


def test_walks_on_slippery_ground() -> None:
    """If the planned forces needed a friction of 0.4, the feet would slide apart."""
    schedule = CommandSchedule((0.0, 1.5), ((0.8, -0.3, -0.5), (-0.8, 0.3, 0.5)))
    episode = Episode(schedule, duration_s=2.4, sample={"friction": np.array(0.2)})
    trace = run_episode(ROBOT, load_policy("mpc", ROBOT), episode)
    assert not trace.fell, trace.fall_reason
