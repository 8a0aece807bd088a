"""Metrics of one iteration of a training."""

METRICS = {
    "reward/total": 1.5,
    "reward/alive": 0.5,
    "episode/length_s": 2.0,
    "tracking/linear_error_m_s": 0.25,
    "tracking/yaw_error_rad_s": 0.5,
    "learning/policy_dist_mean_std": 0.6,
    "learning/kl_mean": 0.0004,
}
