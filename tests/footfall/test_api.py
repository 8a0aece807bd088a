"""The Python API: names of `import footfall`."""

import footfall


def test_the_api_has_exactly_the_documented_names() -> None:
    assert all(getattr(footfall, name) is not None for name in footfall.__all__)
    assert set(footfall.__all__) <= set(dir(footfall))
    assert not hasattr(footfall, "load_robots")


def test_an_episode_in_seven_lines() -> None:
    from footfall import Episode, load_policy, load_robot, run_episode

    robot = load_robot("go1")
    policy = load_policy("stand", robot)
    trace = run_episode(robot, policy, Episode(lambda time_s: [0.0, 0.0, 0.0], duration_s=0.2))
    assert not trace.fell
    assert trace.motor_torque.shape[1] == 12
