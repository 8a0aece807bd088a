"""Pictures and information of the gymnasium face."""

import numpy as np

from footfall.envs import gymnasium_env


def test_information_covers_running_and_ended_episodes() -> None:
    last = gymnasium_env.StepResult(
        np.arange(6.0).reshape(3, 2), np.zeros(3), np.array([False, True, False]), np.array([False,
        False, True]),
        {"command": np.arange(9.0).reshape(3, 3), "error": np.array([0.1, 0.2, 0.3])},
    )  # fmt: skip
    info = gymnasium_env.gathered(last, 100 + np.arange(9.0).reshape(3, 3))
    np.testing.assert_array_equal(info["command"], 100 + np.arange(9.0).reshape(3, 3))
    assert info["_command"].all()
    assert (info["error"].tolist(), info["_error"].tolist()) == ([0.1, 0.0, 0.0], [True, False, False])
    assert [None if row is None else row.tolist() for row in info["final_obs"]] == [
        None,
        [2.0, 3.0],
        [4.0, 5.0],
    ]
    assert info["_final_obs"].tolist() == info["_final_info"].tolist() == [False, True, True]
    assert info["final_info"]["error"].tolist() == [0.0, 0.2, 0.3]
    assert info["final_info"]["command"].tolist() == [[0.0] * 3, [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]]
    none_ended = last._replace(terminated=np.zeros(3, bool), truncated=np.zeros(3, bool))
    assert set(gymnasium_env.gathered(none_ended, last.info["command"])) == {
        "command",
        "_command",
        "error",
        "_error",
    }
