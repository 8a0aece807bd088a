"""`footfall identify` on the command line: refusals and exit status."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from shell import Shell

from footfall.cli import main
from footfall.deploy.config import DeployConfig
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.record import record
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import Robot


def test_nothing_is_overwritten(shell: Shell, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    log.write_text("mine")
    for arguments in (["record", log], ["fit", log, "--out", tmp_path], ["net", log, "--out", tmp_path]):
        shell.refuses("identify", *arguments)
    assert log.read_text() == "mine"


def test_a_fit_without_a_log_an_unknown_foot_and_a_record_that_cannot_be_made_are_refused(
    shell: Shell, tmp_path: Path
) -> None:
    (tmp_path / "motion.yaml").write_text("stiffness: [0.5]")
    for arguments, named in (
        ("fit", ""),
        ("fit absent.mcap", ""),
        ("net", ""),
        ("net absent.mcap", ""),
        ("net x --steps 0", ""),
        ("net x --steps 24", "steps"),  # before the first check
        ("fit x x", "twice"),
        ("fit x --held-out ./x", "twice"),  # a fit cannot be validated on its own log
        ("fit x --out absent/robot", "absent"),  # before minutes of work
        ("foot tail", "FL"),
        ("record log.mcap --excitation motion.yaml", "stiffness"),  # two chirps need two gains
        ("record log.mcap --bus virtual --plant other.xml", ""),  # a plant is for the simulated robot alone
    ):
        assert named in shell.refuses("identify", *arguments.split()), arguments


def test_a_recording_that_did_not_end_in_order_or_lacks_a_part_is_status_1(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for state, faults, missing, status in (
        ("IDLE", (), "", 0),
        ("IDLE", ("a fault",), "", 1),
        ("ESTOP", (), "", 1),
        ("IDLE", (), "the log is truncated", 1),
    ):
        outcome = SimpleNamespace(
            faults=faults, notes=(), walked_s=1.0, final_state=state, missing_in_log=missing
        )
        monkeypatch.setattr("footfall.identify.record.record", lambda *_, outcome=outcome, **__: outcome)
        assert main(["identify", "record", str(tmp_path / "log.mcap")]) == status


def test_the_outcome_of_a_recording_on_a_full_disk_has_what_the_log_lacks(go1: Robot) -> None:
    short = ExcitationConfig(settle_s=0.1, triangle_s=0.4, chirp_s=0.6, burst_s=0.2)
    loop = DeployConfig(joint_rate_hz=250.0, stand_s=0.1)
    assert "/dev/full" in record(go1, simulated_bus(go1), Path("/dev/full"), short, loop).missing_in_log
