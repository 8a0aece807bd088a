"""Every kind of bad input ends in one line with the reason, status 2, and nothing written."""

import itertools
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from edited import edit
from shell import Shell
from tiny_policy import write_policy

from footfall.robots.description import ROBOTS
from footfall.train.config import PRESETS


@pytest.fixture
def shell(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Shell]:
    """The command line in an empty folder, which must stay empty."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    yield Shell(capsys)
    assert list(folder.iterdir()) == []


# A command line, and words that the message must name.
REFUSED = """
    depoly | depoly deploy
    --verbose | --verbose
    deploy | POLICY
    deploy stand trot | 'trot'
    deploy stand --sed 1 | --sed --seed
    deploy stand --seed | --seed
    deploy stand --seed one | --seed
    deploy stand --seed 1 --seed 2 | --seed
    deploy stand --duration long | --duration long
    deploy stand --duration 0 | --duration
    deploy stand --duration nan | --duration
    deploy stand --duration 1e12 | --duration 86400
    can monitor --duration 86401 | --duration 86400
    can monitor --duration 0 | --duration
    deploy stand --command nan,0,0 | --command
    deploy stand --command 0.5,0 | --command
    deploy stand --command 0,0,101 | --command
    deploy stand --command=0,-100.1,0 | --command
    deploy stand --command | --command
    deploy stand --robot hexapot | hexapod
    deploy stand --robot rex | rex go1 robot.yaml
    deploy stand --bus tram | tram sim
    deploy stand --log /proc/x.mcap | /proc
    deploy stand --plant rex.xml | rex.xml
    deploy stand --config loop.yaml | loop.yaml
    deploy stand --config /dev/zero | /dev/zero
    deploy stand --set | --set
    deploy stand --set stand.kp=-1 | stand@kp=-1 kp
    deploy stand --bus virtual --start lying | --start
    deploy stand --bus virtual --ground-truth | --ground-truth
    deploy stand --bus virtual --plant x.xml | --plant
    deploy go1-falt | go1-flat
    deploy hexapod-flat | --robot hexapod
    deploy rex | rex stand trot mpc .onnx
    bring-up stand --steps jump | jump hold joints legs wiring stand shift walk uneven
    bring-up stand --scale 0.009 | --scale
    bring-up stand --scale 1.01 | --scale
    bring-up stand --bus virtual | --yes
    evaluate stand --scenarios nominal push | 'push' --scenarios
    evaluate stand --scenarios ballet | ballet nominal
    evaluate stand --scenarios , | scenario
    evaluate stand --scenarios push,push | push
    evaluate stand --set trot.kp=1 | trot.kp=1 stand
    evaluate stand --epsiodes=3 | --episodes
    evaluate stand --weakest push --scenarios walk | --scenarios
    evaluate stand@kp | stand@kp KEY=VALUE
    evaluate stand@rate_hz=5000 --episodes 1 --workers 1 | 5000 500
    compare | policy
    compare stand stand | stand
    compare stand stand@none.yaml | none.yaml
    compare stand trot --scenarios ballet | ballet nominal
    train --sed 3 | --seed
    train --terrain rough | --set KEY=VALUE
    train --steps 0 | --steps
    train --trainer none | 'none' brax rsl_rl
    train --checkpoint-interval none | --checkpoint-interval none
    train --robot rex | rex go1
    train --preset huge | huge cpu gpu smoke
    train --resume run | run
    export | RUN
    export run | run
    sweep none | none
    replay | LOG
    replay log.mcap | log.mcap
    replay none --policy none | none
    log recover / | log
    log cut log.mcap --from -1 | --from 0
"""


@pytest.mark.parametrize("row", [row.strip() for row in REFUSED.strip().splitlines()])
def test_what_cannot_be_done_is_refused_by_name(shell: Shell, row: str) -> None:
    tokens, _, named = row.partition(" | ")
    complaint = shell.refuses(*tokens.split())
    for words in named.split():
        assert words in complaint


def test_files_with_garbage_are_refused(shell: Shell, tmp_path: Path) -> None:
    for command, file in (
        ("deploy", "walk.onnx"), ("deploy stand --plant", "plant.xml"), ("replay", "log.mcap"),
        ("evaluate", "walk.onnx"), ("evaluate stand --plant", "plant.xml"), ("train --preset", "preset.yaml"),
        ("deploy stand --config", "loop.yaml"),
    ):  # fmt: skip
        for content in (b"garbage\n", bytes(range(256)), b"{[<mujoco>"):
            (tmp_path / file).write_bytes(content)
            assert file in shell.refuses(*command.split(), tmp_path / file)


def test_presets_that_cannot_be_trained_are_refused(shell: Shell, tmp_path: Path) -> None:
    friction = "friction: {low: 0.6, high: 1.1}"
    for line, instead, named in (
        ("  substeps: 4", "  substeps: 0", "substeps"),
        ("  substeps: 4", "  control_rate_hz: 1.0e+9", "control_rate_hz"),
        ("  substeps: 4", "  initial: {tilt_rad: 180}", "tilt_rad"),
        ("gyro: 0.1", "gyro: -1", "gyro"),
        # values in a wrong unit: degrees, millimetres, per cent
        ("horizontal_m_s: 0.4", "horizontal_m_s: 500", "horizontal_m_s"),
        ("frequency_hz: 2.5", "frequency_hz: 1000", "frequency_hz"),
        ("weight: 1.5", "weight: 1.5, sigma_m2_s2: 0", "env.rewards[0].sigma_m2_s2"),
        ("weight: 1.5", "weight: 1.5, sigma: 0.2", "env.rewards[0].sigma"),
        ("weight: 0.8", "weight: .nan", "env.rewards[1].weight"),
        ("term: alive", "term: alife", "'alife'"),
        (friction, "encoder_bias: {low: -2, high: 2}", "encoder_bias"),
        (friction, "com_offset_m: {low: -30, high: 30}", "com_offset_m"),
        (friction, "gyro_bias: {low: 0, high: 57}", "gyro_bias"),
    ):
        shutil.copy(PRESETS / "smoke.yaml", tmp_path / "preset.yaml")
        edit(tmp_path, "preset.yaml", line, instead)
        complaint = shell.refuses("train", "--preset", tmp_path / "preset.yaml")
        assert "preset.yaml" in complaint
        assert named in complaint


def test_a_motor_timeout_beyond_the_buss_limit_is_refused(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "loop.yaml").write_text("motor_timeout_s: 0.5")
    for verb in ("deploy", "bring-up"):
        complaint = shell.refuses(verb, "stand", "--bus", "virtual", "--config", tmp_path / "loop.yaml")
        assert "motor_timeout_s" in complaint
        assert "0.1 s" in complaint


def test_a_robot_folder_with_garbage_is_refused(shell: Shell, own_folder: Path) -> None:
    (own_folder / "robot.yaml").write_text("name: [")
    for command in ("deploy stand", "evaluate stand", "train"):
        assert "robot.yaml" in shell.refuses(*command.split(), "--robot", own_folder)


def test_a_run_folder_without_a_policy_is_refused(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    for verb in ("deploy", "evaluate", "export"):
        assert str(tmp_path / "empty") in shell.refuses(verb, tmp_path / "empty")


def test_the_plant_of_another_robot_is_refused(shell: Shell, tmp_path: Path) -> None:
    plant = tmp_path / "cart.xml"
    plant.write_text("<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>")
    complaint = shell.refuses("deploy", "stand", "--plant", plant)
    assert "cart.xml" in complaint
    assert "FR_hip_joint" in complaint


def test_outputs_that_cannot_be_written_are_refused(shell: Shell, tmp_path: Path) -> None:
    """Outputs are checked first: each of these commands returns at once."""
    (tmp_path / "file").touch()
    (tmp_path / "out").mkdir()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    assert "footfall train --help" in shell.refuses("train", "--out", "")
    assert "footfall identify foot --help" in shell.refuses("identify", "foot")
    same = tmp_path / "twice"
    assert str(same) in shell.refuses("deploy", "stand", "--json", same, "--log", same)
    assert not same.exists()
    places = [tmp_path / place for place in ("absent/out", "out", "file/out", "loop")]
    commands = [f"{verb} --json" for verb in ("deploy stand", "evaluate stand", "compare stand trot")]
    commands += ["deploy stand --log", "compare stand trot --html", "export run --out"]
    for command, place in itertools.product(commands, [*places, Path("/proc/out")]):
        complaint = shell.refuses(*command.split(), place)
        assert str(place) in complaint or str(place.parent) in complaint


@pytest.mark.skipif(not hasattr(socket, "AF_CAN"), reason="no SocketCAN on this system")
def test_missing_can_interfaces_are_refused(shell: Shell) -> None:
    if any(name.startswith("can") for _, name in socket.if_nameindex()):
        pytest.skip("this machine has CAN interfaces; a test shall not talk to them")
    assert "can0" in shell.refuses("deploy", "stand", "--bus", "socketcan")


def test_policies_without_a_contract_or_of_another_robot_are_refused(
    shell: Shell, own_folder: Path, tmp_path: Path
) -> None:
    """The message names the field of the contract that does not fit."""
    onnx = pytest.importorskip("onnx")
    bare = write_policy(onnx, tmp_path / "bare.onnx", ROBOTS / "go1", contract=False)
    assert "bare.onnx" in shell.refuses("deploy", bare)
    walk = write_policy(onnx, tmp_path / "walk.onnx", ROBOTS / "go1")
    edit(own_folder, "robot.yaml", "default_rad: 0.9", "default_rad: 0.8")
    complaint = shell.refuses("deploy", walk, "--robot", own_folder)
    assert "walk.onnx" in complaint
    assert "default_pose_rad" in complaint
