"""Outcomes of episodes made by hand."""

from dataclasses import replace
from typing import Any

import numpy as np

from footfall.evaluate.episodes import EpisodeOutcome
from footfall.evaluate.metrics import EpisodeMetrics
from footfall.evaluate.pool import TaskResult

GOOD = EpisodeMetrics(
    fell=False, emergency_stop=False, walked_s=10.0, scored_s=8.0,
    lin_vel_mse=0.01, yaw_rate_mse=0.04, estimate_mse=np.nan, mean_velocity=(0.5, 0.0, 0.0),
    distance_m=5.0, progress=1.0, weight_n=125.0, electrical_j=625.0, mechanical_j=250.0, positive_j=300.0,
    peak_torque_nm=20.0, peak_torque_share=0.8, foot_slip_m_s=0.05, stance_s=20.0, legs_touch_share=0.0,
    target_rate_rad_s=2.0, torque_rate_nm_s=100.0,
)  # fmt: skip


def outcome(
    metrics: EpisodeMetrics = GOOD, push: float | None = None, **changes: Any
) -> TaskResult[EpisodeOutcome]:
    levels = {} if push is None else {"push_m_s": push, "push_direction_deg": 0.0}
    plain = EpisodeOutcome(metrics, levels, np.array([0.1, 0.2, 30.0]), 20.0, "", (), None)
    return TaskResult(replace(plain, **changes))
