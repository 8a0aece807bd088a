"""Readings that contradict each other are found and named; those of a healthy robot do not."""

from dataclasses import replace

import numpy as np
import pytest
from fault_kinds.imu import scaled
from injected import FAULTS, Injected

from footfall import Episode, Push, Robot, load_policy, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import DAMPED, Mode
from footfall.deploy.safety import SafetyConfig
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import load_randomisation
from footfall.domain_rand.sample import draw
from footfall.plant.robot import PlantConfig

AT_S = 0.5  # of walking, when a fault begins
NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)
CONFIG = DeployConfig(stand_s=0.4, safety=SafetyConfig(damping_s=0.1))
COMMAND = np.array([0.6, 0.2, -0.5])
KINDS = FAULTS | {"gyro reversed, five times too high": scaled("gyro", -5.0, -5.0, -5.0)}
WALK = Episode(lambda _: COMMAND, duration_s=2.0, config=CONFIG, record=False)


# Where several checks can notice a fault, the leg's step decides which one is first.
REPEATS = "the motor repeats one torque"
REBOOTED = "one motor rebooted: replies without torque"
NAMED = [
    ("acceleration frames lost", 0, "no new IMU reading (acceleration)", 0.06),
    ("IMU frozen, its counters go on", 0, "the IMU: its ", 0.1),
    ("gyro reversed, five times too high", 0, "the IMU: its quaternion turned by", 0.6),
    ("quaternion off by 30 degrees", 0, "the IMU: its quaternion turned by", 0.05),
    ("position frozen", 4, "FL_thigh_joint (can1, id 2): its position ", 0.3),
    ("torque frozen", 5, f"FL_calf_joint (can1, id 3): {REPEATS}", 0.3),
    ("acceleration's signs reversed", 0, "the IMU: on average its acceleration is off gravity by", 0.6),
    ("encoder jumps by 0.3 rad", 10, "RL_thigh_joint (can3, id 2): its position changed", 0.05),
    ("ids of two motors swapped", 0, "FR_", 0.05),
    ("one reply repeated", 5, f"FL_calf_joint (can1, id 3): {REPEATS} | repeats", 0.2),
    # A rebooted motor reports a torque of zero again and again.
    (REBOOTED, 2, f"FR_calf_joint (can0, id 3): {REPEATS} | no torque", 0.3),
    ("motor's torque reversed", 8, "RR_calf_joint (can2, id 3): the other way | off its commands", 0.4),
    ("motor at 90 degrees Celsius", 6, "RR_hip_joint (can2, id 1): the motor is at 90 degrees", 0.03),
]


@pytest.mark.parametrize(("kind", "joint", "message", "within_s"), NAMED)
def test_a_fault_in_a_walk_is_named_in_time_and_damps(
    go1: Robot, kind: str, joint: int, message: str, within_s: float
) -> None:
    run = Injected(go1, load_policy("go1-flat", go1), PlantConfig(), COMMAND, CONFIG)
    run.injector.joint, run.injector.channel = joint, int(run.wiring.channel[joint])
    faulty, damped = list[float](), list[int]()

    def watch(loop: ControlLoop) -> None:
        if loop.walking and loop.walking_s >= AT_S:
            if not faulty:
                KINDS[kind](run.injector)
            faulty.append(loop.walking_s)
        elif loop.state.mode in DAMPED:
            damped.append(loop.now_us)

    outcome = run.run(2.0, watch)
    assert outcome.final_state == "ESTOP", outcome.faults
    (fault,) = outcome.faults
    source, _, reasons = message.rpartition(": ") if "_joint" in message else ("", "", message)
    assert fault.startswith(source)
    assert any(reason in fault for reason in reasons.split(" | "))
    assert faulty[-1] - AT_S <= within_s
    assert len(damped) > 40


def test_a_misaligned_imu_is_noticed_before_the_robot_walks(go1: Robot) -> None:
    run = Injected(go1, load_policy("stand", go1), PlantConfig(), config=DeployConfig(stand_s=1.0))
    FAULTS["quaternion off by 15 degrees"](run.injector)
    modes = set[Mode]()
    outcome = run.run(2.0, lambda loop: modes.add(loop.state.mode))
    assert "the IMU: " in outcome.faults[0]
    assert Mode.WALKING not in modes


def test_a_pushed_randomised_robot_raises_no_alarm(go1: Robot) -> None:
    rng = np.random.default_rng(3)
    sample = draw(load_randomisation(), lambda count: rng.uniform(size=count), 12, 13)
    sample["action_delay_s"] = np.array(0.004)
    pushes = (Push(0.4, (0.5, 0.5, 0.0)), Push(1.4, (-0.5, 0.5, 0.0)))
    episode = replace(WALK, seed=3, duration_s=2.5, noise=NOISE, sample=sample, pushes=pushes)
    assert run_episode(go1, load_policy("go1-flat", go1), episode).faults == ()


def test_a_healthy_robot_raises_no_alarm(go1: Robot) -> None:
    """The joint rate is as low as the policy's, or readings repeat themselves at rest."""
    slow = replace(WALK, config=replace(CONFIG, joint_rate_hz=50), noise=NOISE)
    standing = replace(WALK, command_source=lambda _: np.zeros(3))
    for policy, episode in (("go1-flat", slow), ("stand", standing)):
        assert run_episode(go1, load_policy(policy, go1), episode).faults == ()
