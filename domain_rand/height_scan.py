"""Errors of height scans, for training and for the simulated robot."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

from footfall.common.config import require_between, require_ordered

Array = Any  # a NumPy or a JAX array
Range = tuple[float, float]
MAX_LAG_S = 1.0
NEVER_S = 1e9


@dataclass(frozen=True)
class HeightScanErrors:
    """Errors of height scans. All zeros: scans are exact, complete and without delay."""

    noise_m: float = 0.0  # half-width, of each height in each scan
    offset_m: float = 0.0  # half-width, of all heights, for an episode
    drift_m_s: float = 0.0  # half-width, of the rate at which the offset changes, for an episode
    shift_m: float = 0.0  # half-width, of all points along each horizontal axis, for an episode
    lag_s: Range = (0.0, 0.0)  # from a scan to its arrival, for an episode
    missing_share: float = 0.0  # largest share of unknown points; each episode draws its own
    lost_share: float = 0.0  # of episodes in which scans stop, half of these before the first scan
    lost_before_s: float = 10.0  # the other half stop at a random time up to this one
    useless_share: float = 0.0  # of episodes whose heights are independent of the ground
    useless_m: float = 0.3  # half-width of such heights

    def __post_init__(self) -> None:
        require_between(self, 0.0, 1.0, "noise_m", "offset_m", "drift_m_s", "shift_m", "useless_m")
        require_between(self, 0.0, 1.0, "missing_share", "lost_share", "useless_share")
        require_between(self, 0.0, MAX_LAG_S, "lag_s")
        require_between(self, 0.0, 3600.0, "lost_before_s")
        require_ordered(self, "lag_s")


class EpisodeErrors(NamedTuple):
    """The errors of an episode's scans; all except the shift are scalars."""

    offset_m: Array
    drift_m_s: Array
    shift_m: Array  # (2,) forward, leftward
    lag_s: Array
    missing_share: Array
    end_s: Array  # no scan is taken from this time on
    useless: Array  # bool


NUMBERS = 9  # uniform numbers that `draw_errors` takes


def draw_errors(errors: HeightScanErrors, u: Array) -> EpisodeErrors:
    """The errors of one episode, from uniform numbers u in [0, 1), (NUMBERS,)."""
    xp, signed = u.__array_namespace__(), 2.0 * u - 1.0
    low, high = errors.lag_s
    ends = xp.maximum(signed[7], 0.0) * errors.lost_before_s
    return EpisodeErrors(
        offset_m=errors.offset_m * signed[0],
        drift_m_s=errors.drift_m_s * signed[1],
        shift_m=errors.shift_m * signed[2:4],
        lag_s=low + (high - low) * u[4],
        missing_share=errors.missing_share * u[5],
        end_s=xp.where(u[6] < errors.lost_share, ends, NEVER_S),
        useless=u[8] < errors.useless_share,
    )


def with_errors(
    heights: Array, errors: HeightScanErrors, episode: EpisodeErrors, taken_s: Array, u: Array
) -> Array:
    """Heights as delivered to the policy, NaN if unknown.

    Args:
        heights: heights of a scan, above the base, m, (points,).
        errors: the declaration.
        episode: the errors drawn for this episode.
        taken_s: time of the scan since the episode began, s.
        u: uniform numbers in [0, 1), (2, points).
    """
    xp, signed = heights.__array_namespace__(), 2.0 * u[0] - 1.0
    found = heights + episode.offset_m + episode.drift_m_s * taken_s + errors.noise_m * signed
    random = xp.mean(heights) + errors.useless_m * signed
    missing = (u[1] < episode.missing_share) | (taken_s >= episode.end_s)
    return xp.where(missing, math.nan, xp.where(episode.useless, random, found))
