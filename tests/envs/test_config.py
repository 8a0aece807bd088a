"""Settings of the environment: refused values, values at their limits, and older forms."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from go1_smoke import SMOKE

from footfall.common.config import merged
from footfall.domain_rand.distributions import Distribution
from footfall.envs.config import CommandConfig, EventConfig, GaitConfig, ObservationConfig, with_lists
from footfall.envs.old_settings import with_current_state, with_terms
from footfall.robots.commands import CommandRange

CONFIG = replace(SMOKE, control_rate_hz=40.0)
RANGES = CommandRange((-1.0, 1.0), (-0.5, 0.5), (-1.0, 1.0))


@pytest.mark.parametrize(
    "make",
    [
        lambda: GaitConfig("trot", 0.0), lambda: GaitConfig("trot", 2.0, -0.01),
        lambda: CommandConfig(RANGES, Distribution(0.0, 1.0)),
        lambda: CommandConfig(RANGES, standing_command=-0.1),
        lambda: CommandConfig(RANGES, standing_probability=1.1),
        lambda: CommandConfig(RANGES, standing_probability=-0.1),
        lambda: CommandConfig(RANGES, single_axis_probability=1.1),
        lambda: CommandConfig(CommandRange((1.0, -1.0), (0.0, 0.0), (0.0, 0.0))),
        lambda: CommandConfig(CommandRange((0.0, 0.0), (1.0, -1.0), (0.0, 0.0))),
        lambda: CommandConfig(CommandRange((0.0, 0.0), (0.0, 0.0), (1.0, -1.0))),
        lambda: EventConfig("push", interval_s=Distribution(0.0, 1.0)),
        lambda: ObservationConfig("gyro", history=0),
        lambda: replace(CONFIG, control_rate_hz=0.9), lambda: replace(CONFIG, control_rate_hz=1000.1),
        lambda: replace(CONFIG, episode_s=0.0), lambda: replace(CONFIG, episode_s=0.0249),
        lambda: replace(CONFIG, speed_limit=0.0), lambda: replace(CONFIG, curriculum_steps=-1),
        lambda: replace(CONFIG, reward_floor=0.1), lambda: replace(CONFIG, substeps=1),
    ],
)  # fmt: skip
def test_impossible_settings_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        make()


OLD = {
    "observation": [{"name": "gyro", "scale": 0.25}],
    "rewards": {"track_linear": 1.5, "pose": -0.1},
    # yaw_sigma_rad2_s2 is a parameter of a reward that this preset does not have
    "reward_scales": {
        "linear_sigma_m2_s2": 0.5, "yaw_sigma_rad2_s2": 0.3, "least": -0.5, "pose_shares": {"*hip*": 2.0},
    },
    "tilt_limit_rad": 0.8, "least_height_share": 0.6, "initial": {"joint_rad": 0.05},
    "pushes": {"interval_s": {"low": 1.0, "high": 2.0}, "horizontal_m_s": 0.4},
    "curriculum": {"steps": 100, "commands": 0.5, "randomisation": 1.0},
}  # fmt: skip
NEW = {
    "observation": [{"term": "gyro", "scale": 0.25}],
    "rewards": [
        {"term": "track_linear", "weight": 1.5, "sigma_m2_s2": 0.5},
        {"term": "pose", "weight": -0.1, "joint_shares": {"*hip*": 2.0}},
    ],
    "reward_floor": -0.5,
    "terminations": [
        {"term": "tilted", "name": "", "limit_rad": 0.8},
        {"term": "sunk", "name": "", "min_height_share": 0.6},
    ],
    "events": [
        {"term": "reset_pose", "name": "", "interval_s": None, "joint_rad": 0.05},
        {"term": "push", "interval_s": {"low": 1.0, "high": 2.0}, "horizontal_m_s": 0.4},
    ],
    "curriculum_steps": 100,
    "curricula": [
        {"term": "linear", "of": "commands", "start": 0.5},
        {"term": "linear", "of": "randomisation", "start": 1.0},
    ],
}


def test_settings_of_older_runs_become_lists_of_terms() -> None:
    assert with_lists(with_terms(OLD)) == NEW
    assert with_lists(with_terms(NEW)) == NEW


def test_a_robots_changes_in_the_old_form_reach_the_terms_of_a_preset() -> None:
    changes = {
        "rewards": {"pose": -0.7, "torque": -1.0}, "pushes": {"horizontal_m_s": 0.1},
        "reward_scales": {"linear_sigma_m2_s2": 0.01, "swing_height_m": 0.03}, "initial": {"tilt_rad": 0.2},
    }  # fmt: skip
    changed = merged(NEW, with_terms(changes))
    assert changed["rewards"] == [
        {"term": "track_linear", "weight": 1.5, "sigma_m2_s2": 0.01},
        {"term": "pose", "weight": -0.7, "joint_shares": {"*hip*": 2.0}},
        {"term": "torque", "weight": -1.0},
    ]
    assert [event.get("horizontal_m_s", event.get("tilt_rad")) for event in changed["events"]] == [0.2, 0.1]
    assert changed["events"][1]["interval_s"] == {"low": 1.0, "high": 2.0}


def test_an_older_checkpoint_has_the_parts_of_todays_state() -> None:
    terms: dict[str, object] = {"rewards": {}, "terminations": {}, "critic": {}}
    today = {"env": {"steps": 3, "event_steps": {"push": 5}, "terms": terms}}
    assert with_current_state({"env": {"steps": 3, "push_steps": 5}}) == today
    assert with_current_state(today) == today
    assert with_current_state({"frames": 2, "recent_readings": 1}) == {"history": 2, "recent_readings": 1}
    assert with_current_state({"piece": 2, "asked": 1.5}) == {"piece": 2, "commanded": 1.5}
