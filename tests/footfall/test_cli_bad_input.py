"""Every kind of bad input ends in one line with the reason, status 2, and nothing written."""

import socket
from pathlib import Path

import pytest
from shell import Shell

from footfall.robots.description import ROBOTS
from footfall.train.config import PRESETS


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    """In an empty folder, which must stay empty."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return Shell(capsys)


@pytest.fixture(autouse=True)
def nothing_is_left_behind(shell: Shell, tmp_path: Path):
    yield
    assert list((tmp_path / "here").iterdir()) == []


@pytest.mark.parametrize(
    ("tokens", "named"),
    [
        (["depoly"], ["depoly", "deploy"]),
        (["--verbose"], ["--verbose"]),
        (["deploy"], ["POLICY"]),
        (["deploy", "stand", "trot"], ["unexpected argument 'trot'"]),
        (["evaluate", "stand", "--scenarios", "nominal", "push"], ["'push'", "--scenarios", "comma"]),
        (["evaluate", "go1-falt"], ["'go1-falt'", "mean go1-flat?"]),
        (["deploy", "hexapod-flat"], ["--robot hexapod"]),
        (["deploy", "stand", "--sed", "1"], ["--sed", "--seed"]),
        (["deploy", "stand", "--seed"], ["--seed"]),
        (["deploy", "stand", "--seed", "one"], ["--seed", "whole number"]),
        (["deploy", "stand", "--seed", "1", "--seed", "2"], ["--seed"]),
        (["deploy", "stand", "--duration", "long"], ["--duration", "long"]),
        (["deploy", "stand", "--duration", "0"], ["--duration", "above 0"]),
        (["deploy", "stand", "--duration", "nan"], ["--duration", "above 0"]),
        (["deploy", "stand", "--duration", "inf"], ["--duration", "above 0"]),
        (["deploy", "stand", "--duration", "1e12"], ["--duration", "at most 86400, a day"]),
        (["can", "monitor", "--duration", "86401"], ["--duration", "at most 86400, a day"]),
        (["deploy", "stand", "--command", "fast"], ["--command", "three numbers"]),
        (["deploy", "stand", "--command", "nan,0,0"], ["--command", "three numbers"]),
        (["deploy", "stand", "--command"], ["--command"]),
        (["train", "--steps", "0"], ["--steps", ">= 1"]),
        (["deploy", "go1-falt"], ["Did you mean go1-flat?"]),
        (["deploy", "stand", "--robot", "hexapot"], ["Did you mean hexapod?"]),
        (["deploy", "stand", "--log", "/proc/x.mcap"], ["no file can be made"]),
        (["train", "--trainer", "none"], ["trainer 'none'", "brax", "rsl_rl"]),
        (["train", "--checkpoint-interval", "none"], ["--checkpoint-interval", "none"]),
        (["export"], ["RUN"]),
        (["replay"], ["LOG"]),
        (["deploy", "stand", "--set"], ["--set", "argument"]),
        (["deploy", "stand", "--json", ""], ["empty argument", "footfall deploy --help"]),
        (["train", "--out", ""], ["empty argument", "footfall train --help"]),
        # what does not exist
        (["deploy", "stand", "--set", "stand.kp=-1"], ["stand@kp=-1", "kp must be above 0"]),
        (["evaluate", "stand", "--set", "trot.kp=1"], ["--set trot.kp=1", "not among", "stand"]),
        (["compare", "stand", "stand@none.yaml"], ["none.yaml", "No such file"]),
        (["evaluate", "stand@rate_hz=5000", "--episodes", "1", "--workers", "1"], ["5000 Hz", "500 Hz"]),
        (["deploy", "rex"], ["rex", "stand", "trot", "mpc", ".onnx"]),
        (["deploy", "stand", "--robot", "rex"], ["rex", "go1", "robot.yaml"]),
        (["deploy", "stand", "--bus", "tram"], ["tram", "sim"]),
        (["deploy", "stand", "--plant", "rex.xml"], ["rex.xml"]),
        (["deploy", "stand", "--config", "loop.yaml"], ["loop.yaml"]),
        (["evaluate", "rex"], ["rex", "stand"]),
        (["evaluate", "stand", "--robot", "rex"], ["rex", "go1"]),
        (["evaluate", "stand", "--scenarios", "ballet"], ["ballet", "nominal"]),
        (["evaluate", "stand", "--scenarios", ","], ["scenario"]),
        (["evaluate", "stand", "--scenarios", "push,,nominal"], ["--scenarios", "nominal,push"]),
        (["evaluate", "stand", "--scenarios", "push,push"], ["push", "twice"]),
        (["compare", "stand", "stand"], ["stand", "twice"]),
        (["compare"], ["policy"]),
        (["compare", "stand", "rex"], ["rex"]),
        (["compare", "stand", "trot", "--scenarios", "ballet"], ["ballet", "nominal"]),
        (["train", "--robot", "rex"], ["rex", "go1"]),
        (["deploy", "stand", "--plant", "none"], ["no MJCF file at none"]),
        (["sweep", "none"], ["none"]),
        (["replay", "none", "--policy", "none"], ["none"]),
        (["train", "--preset", "huge"], ["huge", "cpu", "gpu", "smoke"]),
        (["train", "--resume", "run"], ["run"]),
        (["export", "run"], ["run"]),
        (["replay", "log.mcap"], ["log.mcap"]),
    ],
)
def test_unparsable_and_missing_files_are_refused(shell: Shell, tokens: list[str], named: list[str]) -> None:
    complaint = shell.refuses(*tokens)
    for words in named:
        assert words in complaint


GARBAGE = (b"garbage\n", bytes(range(256)), b"{[<mujoco>")


@pytest.mark.parametrize(
    ("file", "tokens"),
    [
        ("walk.onnx", ["deploy", "{}"]),
        ("walk.onnx", ["evaluate", "{}"]),
        ("plant.xml", ["deploy", "stand", "--plant", "{}"]),
        ("plant.xml", ["evaluate", "stand", "--plant", "{}"]),
        ("log.mcap", ["replay", "{}"]),
        ("preset.yaml", ["train", "--preset", "{}"]),
        ("loop.yaml", ["deploy", "stand", "--config", "{}"]),
    ],
)
def test_garbage_files(shell: Shell, tmp_path: Path, file: str, tokens: list[str]) -> None:
    path = tmp_path / file
    for content in GARBAGE:
        path.write_bytes(content)
        assert file in shell.refuses(*(token.format(path) for token in tokens))


@pytest.mark.parametrize(
    ("line", "instead", "named"),
    [
        ("  substeps: 4", "  substeps: 0", ["substeps", "at least 2"]),
        ("  substeps: 4", "  control_rate_hz: 1.0e+9", ["control_rate_hz", "from 1 to 1000"]),
        ("gyro: 0.1", "gyro: -1", ["gyro", "from 0 to 100"]),
        # values in a wrong unit: degrees, millimetres, per cent
        ("horizontal_m_s: 0.4", "horizontal_m_s: 500", ["horizontal_m_s", "from 0 to 100"]),
        ("frequency_hz: 2.5", "frequency_hz: 1000", ["frequency_hz", "from 0.05 to 50"]),
        ("weight: 1.5", "weight: 1.5, sigma_m2_s2: 0", ["env.rewards[0].sigma_m2_s2", "from 1e-06 to 1e+06"]),
        (
            "weight: 1.5",
            "weight: 1.5, sigma: 0.2",
            ["env.rewards[0].sigma: no such", "sigma_m2_s2"],
        ),
        ("weight: 0.8", "weight: .nan", ["env.rewards[1].weight", "not a finite number"]),
        ("term: alive", "term: alife", ["env.rewards[2]", "no reward 'alife'"]),
        ("  substeps: 4", "  initial: {tilt_rad: 180}", ["tilt_rad", "from 0 to 100"]),
        ("friction: {low: 0.6, high: 1.1}", "encoder_bias: {low: -2, high: 2}", ["encoder_bias", "-1 to 1"]),
        (
            "friction: {low: 0.6, high: 1.1}",
            "com_offset_m: {low: -30, high: 30}",
            ["com_offset_m", "-1 to 1"],
        ),
        ("friction: {low: 0.6, high: 1.1}", "gyro_bias: {low: 0, high: 57}", ["gyro_bias", "-10 to 10"]),
        (
            "friction: {low: 0.6, high: 1.1}",
            "gravity_bias: {low: 0, high: 9.81}",
            ["gravity_bias", "-1 to 1"],
        ),
    ],
)
def test_presets_that_cannot_be_trained(
    shell: Shell, tmp_path: Path, line: str, instead: str, named: list[str]
) -> None:
    smoke = (PRESETS / "smoke.yaml").read_text()
    assert line in smoke
    path = tmp_path / "preset.yaml"
    path.write_text(smoke.replace(line, instead))
    complaint = shell.refuses("train", "--preset", path)
    for words in ("preset.yaml", *named):
        assert words in complaint


@pytest.mark.parametrize("verb", ["deploy", "bring-up"])
def test_motor_timeouts_beyond_the_buss_greatest(shell: Shell, tmp_path: Path, verb: str) -> None:
    path = tmp_path / "loop.yaml"
    path.write_text("motor_timeout_s: 0.5")
    complaint = shell.refuses(verb, "stand", "--bus", "virtual", "--config", path)
    assert "motor_timeout_s is 0.5 s: go1's motors disable themselves after 0.1 s" in complaint


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero")
def test_settings_without_an_end(shell: Shell) -> None:
    assert "/dev/zero" in shell.refuses("deploy", "stand", "--config", "/dev/zero")


@pytest.mark.parametrize("verb", [["deploy", "stand"], ["evaluate", "stand"], ["train"]])
def test_garbage_robot_folder(shell: Shell, own_folder: Path, verb: list[str]) -> None:
    (own_folder / "robot.yaml").write_text("name: [")
    assert "robot.yaml" in shell.refuses(*verb, "--robot", own_folder)


@pytest.mark.parametrize("verb", ["deploy", "evaluate", "export"])
def test_run_folder_without_a_policy(shell: Shell, tmp_path: Path, verb: str) -> None:
    assert str(tmp_path / "empty") in shell.refuses(verb, _folder(tmp_path / "empty"))


def test_plant_of_another_robot(shell: Shell, tmp_path: Path) -> None:
    plant = tmp_path / "cart.xml"
    plant.write_text("<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>")
    complaint = shell.refuses("deploy", "stand", "--plant", plant)
    assert "cart.xml" in complaint
    assert "FR_hip_joint" in complaint


def _folder(path: Path) -> Path:
    path.mkdir()
    return path


WRITERS = [
    ["deploy", "stand", "--json"],
    ["deploy", "stand", "--log"],
    ["evaluate", "stand", "--json"],
    ["compare", "stand", "trot", "--json"],
    ["compare", "stand", "trot", "--html"],
    ["export", "run", "--out"],
]


@pytest.mark.parametrize("tokens", WRITERS, ids=" ".join)
class TestOutputs:
    """Outputs are checked first: each of these commands returns at once."""

    def test_a_folder_that_is_not_there(self, shell: Shell, tokens: list[str], tmp_path: Path) -> None:
        complaint = shell.refuses(*tokens, tmp_path / "absent" / "out.file")
        assert f"no folder {tmp_path / 'absent'}" in complaint

    def test_a_folder_instead_of_a_file(self, shell: Shell, tokens: list[str], tmp_path: Path) -> None:
        assert "folder" in shell.refuses(*tokens, _folder(tmp_path / "out"))

    def test_a_file_instead_of_a_folder(self, shell: Shell, tokens: list[str], tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        assert str(tmp_path / "file") in shell.refuses(*tokens, tmp_path / "file" / "out")

    @pytest.mark.skipif(not Path("/proc").is_dir(), reason="no /proc")
    def test_an_unwritable_folder(self, shell: Shell, tokens: list[str]) -> None:
        assert "/proc/out" in shell.refuses(*tokens, "/proc/out")


def test_an_output_that_is_a_link_to_itself(shell: Shell, tmp_path: Path) -> None:
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    assert "symbolic links" in shell.refuses("deploy", "stand", "--duration", "0.1", "--log", loop)


def test_two_outputs_of_one_name(shell: Shell, tmp_path: Path) -> None:
    same = tmp_path / "out"
    assert "its own name" in shell.refuses("deploy", "stand", "--json", same, "--log", same)
    assert not same.exists()


def test_training_into_a_folder_in_use(shell: Shell, own_folder: Path) -> None:
    before = sorted(own_folder.iterdir())
    assert "not empty" in shell.refuses("train", "--preset", "smoke", "--out", own_folder)
    assert sorted(own_folder.iterdir()) == before


@pytest.mark.parametrize("file", ["/", ".."])
def test_recovering_a_folder(shell: Shell, file: str) -> None:
    assert "cannot read the log" in shell.refuses("log", "recover", file)


def test_demo_into_a_folder_in_use(shell: Shell, own_folder: Path) -> None:
    assert "not empty" in shell.refuses("demo", "--out", own_folder)


@pytest.mark.skipif(not hasattr(socket, "AF_CAN"), reason="no SocketCAN on this system")
def test_can_interfaces_that_are_not_there(shell: Shell) -> None:
    if any(name.startswith("can") for _, name in socket.if_nameindex()):
        pytest.skip("this machine has CAN interfaces; a test shall not talk to them")
    assert "can0" in shell.refuses("deploy", "stand", "--bus", "socketcan")


def test_policy_of_another_robot(shell: Shell, own_folder: Path, tmp_path: Path) -> None:
    """A policy names the field of its contract that does not fit."""
    onnx = pytest.importorskip("onnx")
    from tiny_policy import write_policy

    walk = write_policy(onnx, tmp_path / "walk.onnx", ROBOTS / "go1")
    declaration = own_folder / "robot.yaml"
    declaration.write_text(declaration.read_text().replace("default_rad: 0.9", "default_rad: 0.8"))
    complaint = shell.refuses("deploy", walk, "--robot", own_folder)
    assert "walk.onnx does not fit" in complaint
    assert "default_pose_rad" in complaint


def test_onnx_without_a_contract(shell: Shell, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    from tiny_policy import write_policy

    bare = write_policy(onnx, tmp_path / "bare.onnx", ROBOTS / "go1", contract=False)
    complaint = shell.refuses("deploy", bare)
    assert "no footfall contract" in complaint
