"""Each reward term of an outcome that is worked out by hand: its value, its sign, and where it is best."""

import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.envs.config import RewardScales
from footfall.envs.rewards import TERMS, RewardInputs, joint_shares, reward_rate, rewards

SCALES = RewardScales(linear_sigma_m2_s2=0.25, yaw_sigma_rad2_s2=0.5, swing_height_m=0.08, least=-0.5)

# Two legs of one joint each: the first stands, the second swings as planned. It walks as it is asked to.
PERFECT = RewardInputs(
    command=jnp.array([0.6, -0.2, 0.4]),
    moving=jnp.float32(1.0),
    linear_velocity=jnp.array([0.6, -0.2, 0.0]),
    angular_velocity=jnp.array([0.0, 0.0, 0.4]),
    gravity=jnp.array([0.0, 0.0, -1.0]),
    height=jnp.float32(0.3),
    standing_height=0.3,
    joint_position=jnp.array([0.5, -0.5]),
    joint_velocity=jnp.zeros(2),
    default_pose=jnp.array([0.5, -0.5]),
    pose_share=jnp.array([1.0, 3.0]),
    soft_lower=jnp.array([-1.0, -1.0]),
    soft_upper=jnp.array([1.0, 1.0]),
    torque=jnp.zeros(2),
    actions=jnp.zeros((3, 2)),
    contact=jnp.array([1.0, 0.0]),
    clearance=jnp.array([0.0, 0.08]),
    foot_speed=jnp.array([0.0, 1.5]),
    foot_tilt=jnp.zeros(2),
    crowding=jnp.float32(0.0),
    swing=jnp.array([0.0, 1.0]),
    fell=jnp.float32(0.0),
)
BEST = {name: 1.0 for name in ("track_linear", "track_yaw", "alive", "gait_contact")}


def value(name: str, **changes: object) -> float:
    changed = {key: jnp.asarray(each, dtype=jnp.float32) for key, each in changes.items()}
    return float(TERMS[name](PERFECT._replace(**changed), SCALES))


@pytest.mark.parametrize("name", TERMS)
def test_what_is_wanted_costs_nothing_and_earns_all(name: str) -> None:
    assert value(name) == pytest.approx(BEST.get(name, 0.0), abs=1e-7)


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        # exp(-0.5 ** 2 / 0.25) and exp(-(0.3 ** 2 + 0.4 ** 2) / 0.25); the vertical velocity is no part of it
        ("track_linear", {"linear_velocity": [0.1, -0.2, 9.0]}, np.exp(-1.0)),
        ("track_linear", {"linear_velocity": [0.9, 0.2, 0.0]}, np.exp(-1.0)),
        ("track_linear", {"linear_velocity": [-0.6, 0.2, 0.0]}, np.exp(-(1.2**2 + 0.4**2) / 0.25)),
        ("track_yaw", {"angular_velocity": [7.0, 7.0, 0.9]}, np.exp(-0.5)),
        ("track_yaw", {"angular_velocity": [0.0, 0.0, -0.6]}, np.exp(-2.0)),
        ("alive", {"fell": 1.0}, 0.0),
        ("fall", {"fell": 1.0}, 1.0),
        ("gait_contact", {"contact": [1.0, 1.0]}, 0.5),  # the swinging foot drags
        ("gait_contact", {"contact": [0.0, 0.0]}, 0.5),  # the standing foot is up
        ("gait_contact", {"contact": [0.0, 1.0]}, 0.0),
        ("swing_height", {"clearance": [0.05, 0.05]}, 0.03**2),  # of the swinging foot alone
        ("swing_height", {"clearance": [0.0, 0.08], "swing": [0.0, 0.5]}, 0.04**2),
        ("crowded_feet", {"crowding": 0.02}, 0.02),
        ("vertical_velocity", {"linear_velocity": [1.0, 1.0, -0.3]}, 0.09),
        ("roll_pitch_rate", {"angular_velocity": [0.3, -0.4, 5.0]}, 0.25),
        ("orientation", {"gravity": [0.6, 0.0, -0.8]}, 0.36),
        ("orientation", {"gravity": [0.0, -0.6, -0.8]}, 0.36),
        ("height", {"height": 0.2}, 0.01),
        ("torque", {"torque": [3.0, -4.0]}, 25.0),
        ("power", {"torque": [3.0, -4.0], "joint_velocity": [-2.0, -1.0]}, 10.0),
        ("action_rate", {"actions": [[1.0, 0.0], [0.0, 2.0], [9.0, 9.0]]}, 5.0),
        ("action_acceleration", {"actions": [[1.0, 0.0], [0.0, 1.0], [3.0, 0.0]]}, 16.0 + 4.0),
        ("pose", {"joint_position": [0.8, -0.9]}, 0.09 + 3 * 0.16),  # the second joint counts threefold
        ("stand_still", {"joint_position": [0.8, -0.9]}, 0.0),  # asked to move
        ("stand_still", {"joint_position": [0.8, -0.9], "moving": 0.0}, 0.7),
        ("joint_limits", {"joint_position": [1.2, -1.3]}, 0.5),
        ("joint_limits", {"joint_position": [-0.99, 0.99]}, 0.0),
        ("slip", {"foot_speed": [0.5, 1.5]}, 0.25),  # a swinging foot may be fast
        ("slip", {"foot_speed": [0.5, 1.5], "contact": [1.0, 1.0]}, 2.5),
        ("level_soles", {"foot_tilt": [0.01, 0.03]}, 1e-3),
    ],
)
def test_terms_have_their_values(name: str, changes: dict[str, object], expected: float) -> None:
    assert value(name, **changes) == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_no_robot_tracks_better_than_one_that_does_as_commanded() -> None:
    for error in (-0.1, 0.1):
        for axis in range(2):
            moved = np.array(PERFECT.linear_velocity)
            moved[axis] += error
            assert value("track_linear", linear_velocity=moved) < 1.0
        assert value("track_yaw", angular_velocity=[0.0, 0.0, 0.4 + error]) < 1.0


def test_terms_are_weighted_by_name() -> None:
    terms = rewards(PERFECT, {"track_linear": 2.0, "alive": 0.25}, SCALES)
    assert {name: float(term) for name, term in terms.items()} == {"track_linear": 2.0, "alive": 0.25}


@pytest.mark.parametrize(
    ("terms", "rate"),
    [
        ({"alive": 1.0, "height": -0.25}, 0.75),
        ({"alive": 1.0, "height": -9.0}, -0.5),  # clipped
        ({"alive": 1.0, "height": -9.0, "fall": -50.0}, -50.5),  # a fall counts in full
        ({"alive": 1.0, "fall": -50.0}, -49.0),
    ],
)
def test_the_sum_is_clipped_from_below_but_for_a_fall(terms: dict[str, float], rate: float) -> None:
    assert float(reward_rate({k: jnp.float32(v) for k, v in terms.items()}, SCALES)) == pytest.approx(rate)


def test_joints_count_in_pose_by_the_first_pattern_that_fits() -> None:
    names = ("left_hip_roll", "left_knee", "right_hip_roll", "right_ankle")
    shares = joint_shares(names, {"left_*roll": 5.0, "*_hip_*": 2.0, "*knee": 0.0})
    assert shares.tolist() == [5.0, 0.0, 2.0, 1.0]
    with pytest.raises(UserError, match=r"no joint fits '\*_toe'"):
        joint_shares(names, {"*_toe": 1.0})
