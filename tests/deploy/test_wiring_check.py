"""The wiring check: wrong wiring is found, by its name, before the robot stands up or walks."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from changed_robots import described
from deploy_policies import Hold
from fault_kinds.wiring import geared, imu_turned
from injected import Injected

from footfall import Robot, UserError, load_robot
from footfall.deploy.config import deploy_config
from footfall.deploy.session import SessionResult
from footfall.deploy.wiring import wiring_of
from footfall.deploy.wiring_check import check
from footfall.deploy.wiring_check.causes import Cause, causes
from footfall.deploy.wiring_check.config import WiringCheckConfig
from footfall.deploy.wiring_check.proof import is_proven, keep_proof, must_check, proof_file, unproven_note
from footfall.deploy.wiring_check.verdict import Responses, Search, Verdict
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant.injection import FaultInjector
from footfall.plant.robot import PlantConfig

NOISE = Noise(joint_position=0.0005, joint_velocity=0.02, gyro=0.005, gravity=0.002)
PROOF = [Verdict("", 0.05, 0.1)]
Inject = Callable[[FaultInjector], None]
Motions = Callable[..., None]


def checked(
    robot: Robot, inject: Inject, lying: bool, sample: Sample | None = None
) -> tuple[SessionResult, list[Verdict]]:
    """A short run with a wiring check, and its verdicts if it has passed."""
    config, verdicts = replace(deploy_config(robot), joint_rate_hz=250.0), list[Verdict]()
    plant = PlantConfig(noise=NOISE, lying=lying, sample=sample or {})
    run = Injected(robot, Hold(robot), plant, config=config)
    inject(run.injector)
    return run.run(0.1, check_wiring=True, on_wiring_passed=verdicts.extend, lie_down=False), verdicts


def exchanged(first: str, second: str) -> Inject:
    """Exchange the connectors of two buses."""

    def inject(injector: FaultInjector) -> None:
        wiring = injector.wiring
        a, b = wiring.buses.index(first), wiring.buses.index(second)
        channel = np.select([wiring.channel == a, wiring.channel == b], [b, a], wiring.channel)
        injector.body.rewire(replace(wiring, channel=channel))

    return inject


def motors_exchanged(injector: FaultInjector) -> None:
    """Exchange the connectors of two motors whose ranges differ: each torque is read in the other's range."""
    wiring, order = injector.wiring, np.arange(len(injector.wiring.motor_id))
    yaw, roll = map(wiring.joint_names.index, ("left_hip_yaw_joint", "left_ankle_roll_joint"))
    order[[yaw, roll]] = roll, yaw
    injector.body.rewire(replace(wiring, channel=wiring.channel[order], motor_id=wiring.motor_id[order]))


@pytest.fixture
def motions(monkeypatch: pytest.MonkeyPatch) -> Motions:
    """Sets motions and limits of the check."""
    return lambda **to: monkeypatch.setattr(check, "WiringCheckConfig", partial(WiringCheckConfig, **to))


def test_right_wiring_passes_lying_and_standing(go1: Robot, motions: Motions) -> None:
    """Commands act with a delay, as on robots whose bus or computer is slow."""
    motions(alike=0.25, doubtful=0.25, settle_s=0.8, move_s=0.4)
    late: Sample = {"action_delay_s": np.array(0.012)}
    outcome, proven = checked(go1, lambda _: None, lying=True, sample=late)
    assert (outcome.final_state, outcome.faults) == ("IDLE", ())
    lying, standing = (verdict.joint_error for verdict in proven)
    assert lying < 0.25
    assert standing < 0.05  # legs that stood up do not pull at each other


@pytest.mark.parametrize(
    ("robot", "inject", "lying", "names"),
    [
        ("go1", exchanged("can0", "can2"), True, ["can0", "can2", "exchanged"]),
        ("go1", geared(-1.0), False, ["opposite direction"]),
        ("go1", imu_turned(2, 90.0), False, ["IMU is turned", "about z"]),
        ("g1", motors_exchanged, False, ["left_hip_yaw_joint", "left_ankle_roll_joint", "exchanged"]),
    ],
)
def test_wrong_wiring_is_named_before_the_robot_walks(
    motions: Motions, robot: str, inject: Inject, lying: bool, names: list[str]
) -> None:
    motions(settle_s=0.25, move_s=0.2)
    outcome, _ = checked(load_robot(robot), inject, lying)
    assert (outcome.final_state, outcome.walked_s) == ("ESTOP", 0.0)
    assert all(name in outcome.faults[0] for name in names), outcome.faults


def test_a_motor_is_named_whose_own_torques_show_its_mistake(go1: Robot) -> None:
    """Slipping feet add an error to all joints and to the tilts, which no cause explains."""
    every = list(causes(wiring_of(go1), go1.foot_joints))
    true = next(each for each in every if each.key == (7,) and each.ratio[7] == 1.25)
    right = Responses(50.0 * np.eye(12) + 5.0, np.full((12, 2), 0.1))
    wrong = right._replace(torque=true.responses(right.torque, np.ones((5, 12))))

    def simulated(cause: Cause) -> Iterator[np.ndarray]:
        yield from np.hstack(wrong if cause is true else right)

    for slipping, tilt, named in ((9, 0.1, True), (9, 0.3, True), (7, 0.1, False)):
        slip = 6.0 * (np.arange(12) == slipping)
        measured = Responses(wrong.torque + slip, np.full((12, 2), tilt))
        search = Search(measured, right, right.min_size, 0.25, simulated)
        assert search.cause(every, np.full((5, 12), np.inf), 0.5) == ""  # for any motor
        assert search.motor(every, WiringCheckConfig()) == (true.text if named else "")


class TestProof:
    @pytest.fixture(autouse=True)
    def state(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def test_a_proof_holds_for_this_wiring_on_this_bus(self, go1: Robot) -> None:
        assert not is_proven(go1, "socketcan")
        assert str(proof_file(go1, "socketcan")) in keep_proof(go1, "socketcan", PROOF)
        first, *rest = go1.description.joints
        moved = described(go1, joints=(replace(first, id=9), *rest))
        assert is_proven(go1, "socketcan")
        for robot, bus in ((go1, "slcan"), (moved, "socketcan"), (replace(go1, digest="x"), "socketcan")):
            assert not is_proven(robot, bus)

    def test_only_an_unproven_real_robot_must_be_checked(self, go1: Robot) -> None:
        assert [must_check(go1, "socketcan", how) for how in ("auto", "trust")] == [True, False]
        assert "not proven" in unproven_note(go1, "socketcan")
        held = described(go1, held_start=True)  # it cannot stand still
        with pytest.raises(UserError, match="--wiring trust"):
            must_check(held, "socketcan", "auto")
        assert not must_check(held, "socketcan", "trust")
        keep_proof(go1, "socketcan", PROOF)
        for bus in ("sim", "virtual", "socketcan"):
            assert [must_check(go1, bus, how) for how in ("auto", "check")] == [False, True]
            assert unproven_note(go1, bus) == ""

    def test_a_proof_that_cannot_be_saved_or_read_does_not_count(self, go1: Robot, tmp_path: Path) -> None:
        (tmp_path / "footfall").write_text("a file where the folder should be")
        assert keep_proof(go1, "socketcan", PROOF)
        (tmp_path / "footfall").unlink()
        keep_proof(go1, "socketcan", PROOF)
        proof_file(go1, "socketcan").write_text("no JSON")
        assert not is_proven(go1, "socketcan")
