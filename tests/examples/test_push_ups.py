"""The example of a user's own controller."""

import numpy as np
from half_rate import half_rate
from user_folder import UserFolder

from footfall import Episode, load_policy, load_robot, run_episode


def test_the_base_sinks_and_rises_while_all_feet_stand(user_folder: UserFolder) -> None:
    user_folder.copy("push_ups.py")
    robot = load_robot("hexapod")
    policy = load_policy("push_ups:PushUps", robot)
    episode = Episode(lambda _: np.zeros(3), 4.0, config=half_rate(robot))
    trace = run_episode(robot, policy, episode)
    assert not trace.fell
    height = trace.base_position[:, 2]
    lowest, highest = height[200:300].min(), height[200:400].max()  # of the second cycle
    depth = 0.15 * robot.description.standing_height_m
    assert 0.7 * depth < highest - lowest < 1.3 * depth
    assert trace.foot_contact.mean() > 0.95
