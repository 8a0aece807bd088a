"""The C++ program computes what the Python policy computes."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from tiny_policy import write_network
from user_folder import EXAMPLES

from footfall import PolicyInput, Robot, load_robot
from footfall.policies.contract import Contract
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import observation_size
from footfall.policies.registry import ZOO
from footfall.robots.readings import Sensed

HEADER_FOLDERS = (
    os.environ.get("ONNXRUNTIME_INCLUDE", ""),
    "/usr/include/onnxruntime",
    "/usr/local/include/onnxruntime",
    EXAMPLES.parent / ".cache/onnxruntime/usr/include/onnxruntime",  # of .ci/onnxruntime_headers
)
AXES = ("forward_m_s", "leftward_m_s", "yaw_rad_s")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled example, linked to the library of Python's onnxruntime."""
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    found = [folder for folder in HEADER_FOLDERS if Path(folder, "onnxruntime_cxx_api.h").is_file()]
    if not found:
        pytest.skip("no onnxruntime_cxx_api.h: install libonnxruntime-dev, or run .ci/onnxruntime_headers")
    if not Path("/usr/include/nlohmann/json.hpp").is_file():
        pytest.skip("no nlohmann/json.hpp: install nlohmann-json3-dev")
    libraries = list((Path(onnxruntime.__file__).parent / "capi").glob("libonnxruntime.so.*"))
    if not libraries:
        pytest.skip("Python's onnxruntime brings no libonnxruntime.so")
    folder = tmp_path_factory.mktemp("program")
    for name in ("libonnxruntime.so", "libonnxruntime.so.1"):
        (folder / name).symlink_to(libraries[0])
    link = [f"-L{folder}", "-lonnxruntime", f"-Wl,-rpath,{folder}"]
    source = EXAMPLES / "deploy_cpp" / "run_policy.cpp"
    options = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-isystem", found[0]]
    subprocess.run([compiler, *options, source, *link, "-o", folder / "run_policy"], check=True)
    return folder / "run_policy"


def random_steps(robot: Robot) -> list[PolicyInput]:
    """Readings of a tumbling robot; the command is to stand for a while in the middle."""
    rng, n = np.random.default_rng(7), len(robot.joint_names)
    found = []
    for step in range(40):
        quaternion = rng.normal(size=4)
        gyro, unit = rng.normal(size=3), quaternion / np.linalg.norm(quaternion)
        position, velocity = robot.default_pose + rng.normal(0.0, 0.3, n), rng.normal(0.0, 3.0, n)
        sensed = Sensed(gyro, np.zeros(3), unit, position, velocity, np.zeros(n))
        command = np.zeros(3) if 10 <= step < 20 else rng.normal(size=3)
        found.append(PolicyInput(0.0, sensed, command, np.zeros(3), 0.0))
    return found


def input_line(step: PolicyInput) -> str:
    sensed = step.sensed
    numbers = (sensed.quaternion, sensed.gyro, sensed.joint_position, sensed.joint_velocity, step.command)
    return " ".join(map(repr, np.concatenate(numbers).tolist())) + "\n"


def agree(program: Path, file: Path, robot: Robot) -> None:
    """Compare actions and joint targets of the program and of the Python policy, step by step."""
    steps = random_steps(robot)
    text = "".join(map(input_line, steps))
    done = subprocess.run([program, file], input=text, capture_output=True, text=True, check=True)
    policy = LearnedPolicy(file, robot)
    policy.reset(steps[0])
    ranges = np.array([getattr(policy.contract.commands, axis) for axis in AXES])  # the loop clamps commands
    expected = []
    for step in steps:
        target = policy.act(step._replace(command=np.clip(step.command, *ranges.T))).position
        expected.append(np.concatenate([policy.action, target]))
    answers = np.array([line.split() for line in done.stdout.splitlines()], float)
    np.testing.assert_allclose(answers, expected, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", ["go1", "hexapod", "g1"])
def test_the_program_gives_the_actions_of_the_shipped_policies(program: Path, name: str) -> None:
    agree(program, ZOO / f"{name}-flat" / "policy.onnx", load_robot(name))


def test_the_program_follows_a_gaits_reference(
    program: Path, contract: Contract, go1: Robot, tmp_path: Path
) -> None:
    onnx = pytest.importorskip("onnx")
    weights = np.random.default_rng(3).normal(0.0, 0.1, (observation_size(contract), 12)).astype(np.float32)
    agree(program, write_network(onnx, tmp_path / "policy.onnx", weights, contract), go1)


def test_an_unknown_term_is_refused_by_name(program: Path, contract: Contract, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    path = write_network(onnx, tmp_path / "policy.onnx", np.zeros((3, 12), np.float32), contract)
    model = onnx.load(path)
    for entry in model.metadata_props:
        entry.value = entry.value.replace('"gyro"', '"lidar"')
    onnx.save(model, path)
    done = subprocess.run([program, path], input="0 " * 34, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "lidar" in done.stderr


@pytest.mark.parametrize("second", ["0 " * 33, "0 " * 35, "0 " * 33 + "nan", "0 " * 33 + "x", ""])
def test_a_line_that_is_not_all_numbers_of_a_step_is_refused(program: Path, second: str) -> None:
    """Otherwise numbers of one line would be read as those of another."""
    text = input_line(random_steps(load_robot("go1"))[0]) + second + "\n"
    arguments = [program, ZOO / "go1-flat" / "policy.onnx"]
    done = subprocess.run(arguments, input=text, capture_output=True, text=True, check=False)
    assert (done.returncode, len(done.stdout.splitlines())) == (2, 1)
    assert "line 2" in done.stderr
