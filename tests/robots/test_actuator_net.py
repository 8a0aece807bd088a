"""The learned part of the joint law: its memory, its slope, its file."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from edited import edit
from refused import refusal_of
from some_net import some_net, with_net

from footfall import JointCommand, load_robot
from footfall.robots.actuator_net import INPUTS, Learned, inputs_of, learned_torque, load_net, save_net

N = 3
NET = some_net(N)
RNG = np.random.default_rng(1)
INPUT, MEMORY = RNG.normal(size=(N, INPUTS)), RNG.normal(size=(N, 2, INPUTS))


def test_the_memory_does_not_depend_on_the_length_of_steps() -> None:
    once, memory = learned_torque(NET, INPUT, MEMORY, 0.005).memory, MEMORY
    for _ in range(5):
        memory = learned_torque(NET, INPUT, memory, 0.001).memory
    np.testing.assert_allclose(memory, once, rtol=1e-12)


def test_the_net_is_odd_in_its_inputs_and_zero_at_rest() -> None:
    one, other = (learned_torque(NET, sign * INPUT, sign * MEMORY, 0.001).torque for sign in (1.0, -1.0))
    np.testing.assert_allclose(one, -other)
    assert (np.abs(one) <= NET.limit).all()
    assert not learned_torque(NET, 0.0 * INPUT, NET.rest(), 0.001).torque.any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_damping_is_the_slope_in_the_velocity_where_it_brakes(sign: float) -> None:
    net = NET._replace(layers=(*NET.layers[:-1], sign * NET.layers[-1]))
    command = JointCommand(*0.1 * RNG.normal(size=(2, N)), *np.full((2, N), 10.0), np.zeros(N))
    position, velocity, torque = 0.1 * RNG.normal(size=(3, N))

    def at(speed: np.ndarray) -> Learned:
        return learned_torque(net, inputs_of(net, command, position, speed, torque), 0.1 * MEMORY, 0.001)

    slope = (at(velocity + 1e-6).torque - at(velocity - 1e-6).torque) / 2e-6
    assert np.abs(slope).max() > 0.01
    np.testing.assert_allclose(at(velocity).damping, np.maximum(-slope, 0.0), atol=1e-6)


def test_a_command_without_stiffness_has_no_position_error() -> None:
    command = JointCommand(np.ones(N), np.zeros(N), np.array([0.0, 1.0, 0.0]), np.zeros(N), np.zeros(N))
    inputs = inputs_of(NET, command, np.zeros(N), np.zeros(N), np.zeros(N))
    assert (inputs[:, 0] != 0.0).tolist() == [False, True, False]


def test_a_file_holds_the_net_and_is_not_overwritten(tmp_path: Path) -> None:
    names = ("a", "b", "c")
    save_net(tmp_path / "net.npz", NET, names)
    read = load_net(tmp_path / "net.npz", names)
    for read_part, saved_part in zip((*read.layers, *read[1:]), (*NET.layers, *NET[1:]), strict=True):
        np.testing.assert_array_equal(read_part, saved_part)
    with pytest.raises(FileExistsError):
        save_net(tmp_path / "net.npz", NET, names)


def test_a_net_changes_the_digest(tmp_path: Path) -> None:
    plain = load_robot("go1")
    one, other = (with_net(plain, tmp_path / str(seed), seed) for seed in (0, 1))
    assert len({plain.digest, one.digest, other.digest}) == 3
    assert one.actuator_net is not None
    shutil.move(one.folder / "net.npz", one.folder / "same.npz")
    edit(one.folder, "robot.yaml", "net.npz", "same.npz")
    assert load_robot(one.folder).digest == one.digest


@pytest.mark.parametrize("wrong", ["absent", "text", "joints", "shape", "number"])
def test_a_net_that_does_not_fit_is_refused_in_a_line(wrong: str, tmp_path: Path) -> None:
    robot = with_net(load_robot("go1"), tmp_path / "robot")
    net, path, names = robot.actuator_net, robot.folder / "net.npz", robot.joint_names
    assert net is not None
    path.unlink()
    if wrong == "text":
        path.write_text("weights")
    elif wrong == "joints":
        save_net(path, net, names[::-1])
    elif wrong == "shape":
        save_net(path, net._replace(layers=net.layers[1:]), names)
    elif wrong == "number":
        save_net(path, net._replace(limit=np.full_like(net.limit, np.nan)), names)
    assert "net.npz" in refusal_of(load_robot, robot.folder)
