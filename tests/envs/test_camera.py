"""Pictures and information of the gymnasium face."""

from typing import Any

import mujoco
import numpy as np
import pytest

from footfall.envs import camera, gymnasium_env
from footfall.envs.camera import Camera
from footfall.envs.gymnasium_env import GymnasiumVectorEnv
from footfall.robots.description import load_robot
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
SMOKE = load_preset("smoke").env
N = 12
QUATERNION = np.array([0.5, 0.5, -0.5, 0.5])


class TestPictures:
    """With a fake renderer."""

    @pytest.fixture
    def renderer(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """What was rendered: positions, and the camera's target and distance."""
        seen: list[Any] = []

        class Renderer:
            def __init__(self, _: object, height: int, width: int) -> None:
                seen.append(("made", height, width))

            def update_scene(self, data: mujoco.MjData, view: mujoco.MjvCamera) -> None:
                seen.append((data.qpos.copy(), view.lookat.copy(), view.distance))

            def render(self) -> np.ndarray:
                return np.full((1, 1, 3), len(seen), np.uint8)

            def close(self) -> None:
                seen.append(("closed",))

        monkeypatch.setattr(camera.mujoco, "Renderer", Renderer)
        return seen

    def test_the_camera_follows_and_is_made_once(self, renderer: list[Any]) -> None:
        eye = Camera(ROBOT)
        assert renderer == []
        qpos = np.concatenate([[3.0, -2.0, 0.5], QUATERNION, np.linspace(-0.2, 0.2, N)])
        first, second = eye.picture(np.zeros(19) + np.eye(19)[3]), eye.picture(qpos)
        assert renderer[0] == ("made", camera.HEIGHT, camera.WIDTH)
        assert len(renderer) == 3
        np.testing.assert_allclose(renderer[2][0], qpos)
        np.testing.assert_allclose(renderer[2][1], [3.0, -2.0, 0.5])
        assert renderer[2][2] == pytest.approx(5 * ROBOT.description.standing_height_m)
        assert (first[0, 0, 0], second[0, 0, 0]) == (2, 3)
        eye.close()
        eye.close()
        assert renderer[3:] == [("closed",)]
        eye.picture(qpos)
        assert renderer[4] == ("made", camera.HEIGHT, camera.WIDTH)

    def test_each_robot_has_a_picture_of_its_own(self, renderer: list[Any]) -> None:
        many = GymnasiumVectorEnv(ROBOT, SMOKE, 2, "rgb_array")
        assert many.render() is None  # nothing has started
        positions = np.zeros((2, 19))
        positions[:, 0], positions[:, 3] = [1.0, 2.0], 1.0
        many.state = type("S", (), {"qpos": positions})()
        assert len(many.render() or ()) == 2
        assert [each[0][0] for each in renderer[1:]] == [1.0, 2.0]
        many.close()
        assert renderer[-1] == ("closed",)


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
    quiet = last._replace(terminated=np.zeros(3, bool), truncated=np.zeros(3, bool))
    assert set(gymnasium_env.gathered(quiet, last.info["command"])) == {
        "command",
        "_command",
        "error",
        "_error",
    }
