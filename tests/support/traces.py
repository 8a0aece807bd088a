"""A trace made by hand."""

import numpy as np

from footfall.plant.trace import Trace

RATE_HZ = 100.0


def walk(seconds: float = 5.0, command: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> Trace:
    """A robot that follows its commands exactly, without effort, feet still on the ground."""
    count = round(seconds * RATE_HZ)
    time_s = np.arange(count) / RATE_HZ
    commands = np.tile(command, (count, 1))
    position = np.zeros((count, 3))
    position[:, :2] = time_s[:, None] * commands[:, :2]
    return Trace(
        time_s=time_s,
        command=commands,
        base_position=position,
        base_quaternion=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        base_velocity=commands * [1.0, 1.0, 0.0],
        base_angular_velocity=commands * [0.0, 0.0, 1.0],
        joint_position=np.zeros((count, 12)),
        joint_velocity=np.zeros((count, 12)),
        motor_torque=np.zeros((count, 12)),
        joint_target=np.zeros((count, 12)),
        foot_position=np.zeros((count, 4, 3)),
        foot_contact=np.ones((count, 4), dtype=bool),
        foot_velocity=np.zeros((count, 4, 3)),
        foot_force=np.full((count, 4), 30.0),
        legs_touch=np.zeros(count, dtype=bool),
        qpos=np.zeros((count, 19)),
        estimated_velocity=np.full((count, 3), np.nan),
        estimated_height=np.full(count, np.nan),
        electrical_power=np.zeros(count),
        mechanical_power=np.zeros(count),
        positive_power=np.zeros(count),
        compute_ms=np.full(count // 2, 0.1),
        record_rate_hz=RATE_HZ,
        mean_velocity=np.zeros(3),
        final_state="IDLE", fell=False, fall_reason="", faults=(), recoveries=(), timing={}, buses=(),
        wall_s=1.0, run_s=seconds, walked_s=seconds, distance_m=0.0, missing_in_log="", notes=(),
    )  # fmt: skip
