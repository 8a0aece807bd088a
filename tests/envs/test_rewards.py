"""Each reward term for an outcome calculated by hand: its value, its sign, and its maximum."""

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import ROBOT, SCENE

from footfall.envs.terms.data import StepData, example_data
from footfall.envs.terms.rewards import REWARDS

POSE = ROBOT.default_pose
PARAMETERS = {"track_linear": {"sigma_m2_s2": 0.25}, "track_yaw": {"sigma_rad2_s2": 0.5}}


@cache
def perfect() -> StepData:
    """The first and the last foot stand, the others swing as planned. The robot follows its command."""
    return example_data(SCENE)._replace(
        command=jnp.array([0.6, -0.2, 0.4]), moving=jnp.float32(1.0),
        linear_velocity=jnp.array([0.6, -0.2, 0.0]), angular_velocity=jnp.array([0.0, 0.0, 0.4]),
        foot_position=jnp.array([[0.2, 0.2, 0.0], [0.2, -0.2, 0.0], [-0.2, 0.2, 0.0], [-0.2, -0.2, 0.0]]),
        contact=jnp.array([1.0, 0.0, 0.0, 1.0]), clearance=jnp.array([0.0, 0.08, 0.08, 0.0]),
        foot_speed=jnp.array([0.0, 1.5, 1.5, 0.0]), swing=jnp.array([0.0, 1.0, 1.0, 0.0]),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "changes", "expected"),
    [
        # exp(-0.5 ** 2 / 0.25) and exp(-(0.3 ** 2 + 0.4 ** 2) / 0.25), without the vertical velocity
        ("track_linear", {"linear_velocity": [0.1, -0.2, 9.0]}, np.exp(-1.0)),
        ("track_linear", {"linear_velocity": [0.9, 0.2, 0.0]}, np.exp(-1.0)),
        ("track_linear", {"linear_velocity": [-0.6, 0.2, 0.0]}, np.exp(-(1.2**2 + 0.4**2) / 0.25)),
        ("track_yaw", {"angular_velocity": [7.0, 7.0, 0.9]}, np.exp(-0.5)),
        ("track_yaw", {"angular_velocity": [0.0, 0.0, -0.6]}, np.exp(-2.0)),
        ("alive", {"fell": 1.0}, 0.0), ("fall", {"fell": 1.0}, 1.0),
        ("gait_contact", {"contact": [1.0, 1.0, 1.0, 1.0]}, 0.5),  # the swinging feet drag
        ("gait_contact", {"contact": [0.0, 0.0, 0.0, 0.0]}, 0.5),  # the standing feet are up
        ("gait_contact", {"contact": [0.0, 1.0, 1.0, 0.0]}, 0.0),
        ("swing_height", {"clearance": [0.05, 0.05, 0.08, 0.0]}, 0.03**2),  # of the swinging feet only
        ("swing_height", {"clearance": [0.0, 0.08, 0.0, 0.0], "swing": [0.0, 0.5, 0.0, 0.0]}, 0.04**2),
        ("crowded_feet", {"foot_position": [[0, 0, 1], [0.1, 0, 0], [1, 0, 0], [2, 0, 0]]}, 4e-4),
        ("vertical_velocity", {"linear_velocity": [1.0, 1.0, -0.3]}, 0.09),
        ("roll_pitch_rate", {"angular_velocity": [0.3, -0.4, 5.0]}, 0.25),
        ("orientation", {"gravity": [0.6, 0.0, -0.8]}, 0.36),
        ("orientation", {"gravity": [0.0, -0.6, -0.8]}, 0.36),
        ("height", {"height": SCENE.standing_height - 0.1}, 0.01),
        ("upright", {"gravity": [0.0, 1.0, 0.0]}, 0.5), ("upright", {"gravity": [0.0, 0.0, 1.0]}, 0.0),
        ("raised", {"height": 0.5 * SCENE.standing_height}, 0.5),
        ("raised", {"height": 2.0 * SCENE.standing_height}, 1.0),
        ("raised", {"gravity": [0.0, 1.0, 0.0]}, 0.25),
        ("stands", {"height": SCENE.standing_height + 0.05}, np.exp(-1.0)),
        ("stands", {"joint_position": POSE - 0.5}, np.exp(-1.0)),
        ("stands", {"joint_velocity": np.full(12, -2.0)}, np.exp(-1.0)),
        ("stands", {"gravity": [0.3, 0.0, -np.sqrt(0.91)]}, np.exp(-1.0)),
        ("joint_speed", {"joint_velocity": [3.0, -4.0]}, 25.0), ("torque", {"torque": [3.0, -4.0]}, 25.0),
        ("power", {"torque": [3.0, -4.0], "joint_velocity": [-2.0, -1.0]}, 10.0),
        ("action_rate", {"actions": [[1.0, 0.0], [0.0, 2.0], [9.0, 9.0]]}, 5.0),
        ("action_acceleration", {"actions": [[1.0, 0.0], [0.0, 1.0], [3.0, 0.0]]}, 16.0 + 4.0),
        ("pose", {"joint_position": POSE + 0.3 * np.eye(12)[2] - 0.4 * np.eye(12)[7]}, 0.25),
        ("stand_still", {"joint_position": POSE + 0.1}, 0.0),  # command to move
        ("stand_still", {"joint_position": POSE + 0.1 * np.resize([1, -1], 12), "moving": 0.0}, 1.2),
        ("joint_limits", {"joint_position": ROBOT.soft_limits[1] + 0.2}, 12 * 0.2),
        ("joint_limits", {"joint_position": ROBOT.soft_limits[0] - 0.1}, 12 * 0.1),
        ("slip", {"foot_speed": [0.5, 1.5, 1.5, 0.0]}, 0.25),  # a swinging foot may be fast
        ("slip", {"foot_speed": [0.5, 1.5, 0.0, 0.0], "contact": [1.0, 1.0, 1.0, 1.0]}, 2.5),
        ("level_soles", {"foot_tilt": [0.01, 0.03, 0.0, 0.0]}, 1e-3),
    ],
)  # fmt: skip
def test_each_term_has_the_calculated_value(name: str, changes: dict[str, object], expected: float) -> None:
    data = perfect()._replace(**{key: jnp.asarray(each, jnp.float32) for key, each in changes.items()})
    found = REWARDS[name](data, **PARAMETERS.get(name, {}))
    assert float(found) == pytest.approx(expected, rel=1e-5, abs=1e-7)


def test_parameters_change_a_term() -> None:
    still = perfect()._replace(linear_velocity=jnp.zeros(3))
    near = perfect()._replace(foot_position=0.5 * perfect().foot_position)  # 0.2 m along, 0.2 m across
    for term, data, parameter, expected in (
        ("track_linear", still, {"sigma_m2_s2": 0.4}, np.exp(-1.0)),
        ("swing_height", perfect(), {"height_m": 0.05}, 2 * 0.03**2),
        ("crowded_feet", near, {"distance_m": 0.25}, 4 * 0.05**2),
    ):
        assert float(REWARDS[term](data, **parameter)) == pytest.approx(expected, rel=1e-4)


def test_the_first_pattern_that_matches_a_joint_gives_its_weight_in_pose() -> None:
    shares = {"FR_*hip*": 5.0, "*_hip_*": 2.0, "*calf*": 0.0}
    expected = {"FR_hip_joint": 5.0, "FL_hip_joint": 2.0, "FL_calf_joint": 0.0, "FL_thigh_joint": 1.0}
    for joint, share in expected.items():
        moved = POSE + np.array([float(name == joint) for name in ROBOT.joint_names])
        data = perfect()._replace(joint_position=jnp.asarray(moved, jnp.float32))
        assert float(REWARDS["pose"](data, joint_shares=shares)) == pytest.approx(share, abs=1e-5), joint
