"""Fits recover the parameters of a simulated robot."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.deploy.config import DeployConfig
from footfall.domain_rand.randomisation import load_randomisation, randomisation_of
from footfall.domain_rand.sample import Sample
from footfall.evaluate.report import fit_page
from footfall.fit_report import page
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.explain import explained
from footfall.identify.fit import TORQUE_SHARE, FitConfig, LegFit, fit_leg, problem_of, torque_error
from footfall.identify.leg import fixed_legs
from footfall.identify.proposal import propose
from footfall.identify.record import record
from footfall.identify.recording import Recording, read_recording
from footfall.identify.simulated import simulated_bus
from footfall.learned_law import learn
from footfall.robots.description import load_robot
from footfall.train.actuator_net import NetConfig

ROBOT = load_robot("go1")
LEG = fixed_legs(ROBOT)[0]
LOOP = DeployConfig(joint_rate_hz=250.0, stand_s=0.1)
SHORT = ExcitationConfig(settle_s=0.3, triangle_s=0.5, chirp_s=0.6, burst_s=0.3)
QUICK = FitConfig(rounds=2, rate_hz=125.0, window_s=0.4, explain=False)
N = len(ROBOT.joint_names)
TRUTH: Sample = {
    "armature": np.full(N, 1.2),
    "joint_friction": np.full(N, 0.8),
    "joint_damping": np.full(N, 0.08),
    "kp": np.full(N, 0.95),
    "motor_strength": np.full(N, 1.05),
    "action_delay_s": np.array(0.005),
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A recording of the simulated robot with `TRUTH`."""
    path = tmp_path_factory.mktemp("identify") / "log.mcap"
    outcome = record(ROBOT, simulated_bus(ROBOT, TRUTH), path, SHORT, LOOP)
    assert (outcome.final_state, outcome.faults) == ("IDLE", ())
    return read_recording(path, ROBOT)


@pytest.fixture(scope="module")
def fit(recording: Recording) -> LegFit:
    """The third joint's torque readings are too high, which must not shift the parameters."""
    read = replace(recording, torque=recording.torque * np.where(np.arange(N) == 2, 1.3, 1.0))
    return fit_leg(LEG, [read], config=QUICK)


def test_a_fit_finds_the_parameters_of_the_simulated_robot_and_predicts_held_out_motion(fit: LegFit) -> None:
    for joint in LEG.joint_names:
        assert fit.value("armature", joint) == pytest.approx(1.2, rel=0.03)
        assert fit.value("joint_friction", joint) == pytest.approx(0.8, rel=0.03)
        assert fit.value("joint_damping", joint) == pytest.approx(0.08, rel=0.2)
        # The delay includes two transfers over the bus.
        assert fit.value("delay_s", joint) == pytest.approx(0.0057, abs=0.0006)
    assert (fit.held_out_rad < 0.002).all()
    assert (fit.held_out_rad < fit.nominal_rad / 5.0).all()
    assert (fit.misfit < 3.0).all()


def test_a_proposal_is_a_robot_with_the_identified_joints(fit: LegFit, tmp_path: Path) -> None:
    folder = propose(ROBOT, [fit], ["log.mcap"], tmp_path / "identified")
    made = load_robot(folder)
    np.testing.assert_allclose(made.armature[LEG.joints], 1.2 * ROBOT.armature[LEG.joints], rtol=0.03)
    np.testing.assert_array_equal(made.armature[3:], ROBOT.armature[3:])
    ranges = load_randomisation(folder / "randomisation.yaml")
    assert ranges.armature is not None
    assert ranges.armature.high - ranges.armature.low < 0.3  # the default range: 0.9 to 1.2
    assert ranges.action_delay_s is not None
    assert ranges.action_delay_s.low < fit.value("delay_s", LEG.joint_names[0]) < ranges.action_delay_s.high
    with pytest.raises(UserError):
        propose(ROBOT, [fit], ["log.mcap"], folder)


def test_a_robots_own_ranges_in_any_layout_are_kept(fit: LegFit, tmp_path: Path) -> None:
    own = shutil.copytree(ROBOT.folder, tmp_path / "own")
    text = "# My robot.\n'kp':\n  low: 0.5\n  high: 1.5\npayload_kg:\n  low: -0.5\n  high: 2.5\n"
    (own / "randomisation.yaml").write_text(text)
    folder = propose(load_robot(own), [fit], ["log.mcap"], tmp_path / "identified")
    ranges = randomisation_of(load_robot(folder))
    assert (ranges.payload_kg.low, ranges.payload_kg.high) == (-0.5, 2.5)
    assert ranges.kp.high < 1.5
    assert "# My robot." in (folder / "randomisation.yaml").read_text()


def test_a_net_is_added_to_a_proposal_and_compared_with_the_law(
    fit: LegFit, recording: Recording, tmp_path: Path
) -> None:
    quick = NetConfig(hidden=(4,), window_s=0.1, windows=16, steps=50, seeds=1)
    (found,) = learn(ROBOT, [fit], [recording], [recording], tmp_path / "learned", quick)
    made = load_robot(tmp_path / "learned")
    assert made.actuator_net is not None
    assert np.flatnonzero(made.actuator_net.limit).tolist() == LEG.joints.tolist()
    np.testing.assert_allclose(made.armature[LEG.joints], 1.2 * ROBOT.armature[LEG.joints], rtol=0.03)
    assert (found.net_rad < 0.8 * found.nominal_rad).all()
    np.testing.assert_allclose(found.law_rad, fit.held_out_rad, rtol=0.3)
    ranges = load_randomisation(made.folder / "randomisation.yaml")
    assert ranges.kp is not None
    assert ranges.kp.low + ranges.kp.high == pytest.approx(
        2.0
    )  # centred on 1: the net already holds the identified gain


def test_parameters_that_rounding_puts_just_beyond_a_bound_have_a_prediction(recording: Recording) -> None:
    """A delay of -1e-18 s would need a command that has not been sent yet."""
    problem = problem_of(LEG, [recording], FitConfig())
    at = problem.scaled(np.array([each.declaration.nominal for each in problem.parameters]))
    delays = [each.quantity == "delay_s" for each in problem.parameters]
    at[delays] = problem.low[delays]
    below = np.where(delays, np.nextafter(at, -np.inf), at)
    for found, expected in zip(problem.errors(below[:, None]), problem.errors(at[:, None]), strict=True):
        np.testing.assert_allclose(found, expected)


def test_a_base_that_moves_is_refused(recording: Recording) -> None:
    with pytest.raises(UserError):
        fit_leg(LEG, [replace(recording, turn_rad_s=0.2)])


def test_each_leg_has_its_own_motors() -> None:
    robot = replace(ROBOT, motor=ROBOT.motor._replace(friction=np.arange(float(N))))
    for leg in fixed_legs(robot):
        np.testing.assert_array_equal(leg.motor.friction, leg.joints)


def test_the_noise_of_torque_readings_is_found(recording: Recording) -> None:
    noisy = replace(recording, torque=np.random.default_rng(0).normal(recording.torque, 0.5))
    np.testing.assert_allclose(problem_of(LEG, [noisy], FitConfig()).torque_sigma, 0.5, rtol=0.15)


@pytest.mark.parametrize(("factor", "wrong"), [(1.0, False), (1.3, True), (-1.0, True)])
def test_torque_readings_that_contradict_the_motion_are_noticed(
    recording: Recording, factor: float, wrong: bool
) -> None:
    """With the true parameters, since a fit takes seconds."""
    read = replace(recording, torque=recording.torque * np.where(np.arange(N) == 2, factor, 1.0))
    problem = problem_of(LEG, [read], FitConfig())
    truth = {name: float(np.mean(value)) for name, value in TRUTH.items()} | {"delay_s": 0.0057}
    values = [truth.get(each.quantity, each.declaration.nominal) for each in problem.parameters]
    at, noise = problem.scaled(np.array(values)), problem.torque_sigma
    problem.refine_starts(at)
    assert (torque_error(problem, at, noise) > TORQUE_SHARE).tolist() == [False, False, wrong]


def test_wrong_torque_readings_are_named(fit: LegFit) -> None:
    assert (fit.torque_error > TORQUE_SHARE).tolist() == [False, False, True]
    assert fit.torque_error[2] == pytest.approx(1.0 - 1.0 / 1.3, abs=0.02)  # a shifted fit hides half of it


def test_a_page_shows_each_joint_and_is_self_contained(fit: LegFit, monkeypatch: pytest.MonkeyPatch) -> None:
    text = page(ROBOT, [fit], [Path("log.mcap")], None)
    for name in (*LEG.joint_names, *LEG.body_names, "armature", "delay_s"):
        assert name in text
    assert not re.search(r'(src|href)="(?!#)', text)
    one_wrong = replace(fit, residual_rad=np.array([1.0, 99.0, 1.0]) * fit.noise_rad)
    warning = f"does not fit {LEG.name}"
    monkeypatch.setattr(fit_page, "plots", lambda _: [])  # they take seconds
    assert (warning in page(ROBOT, [one_wrong], [Path("log.mcap")], None), warning in text) == (True, False)


def test_an_effect_missing_in_the_model_is_named(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    brief = ExcitationConfig(settle_s=0.2, triangle_s=0.5, chirp_s=0.4, burst_s=0.2)
    record(ROBOT, simulated_bus(ROBOT, {"stribeck_friction": 0.5 * ROBOT.motor.friction}), log, brief, LOOP)
    whole = problem_of(LEG, [read_recording(log, ROBOT)], FitConfig(window_s=0.2, rate_hz=125.0))
    free = tuple(each for each in whole.parameters if each.quantity in ("armature", "joint_friction"))
    # A command and a reading take 0.7 ms on the bus.
    delays = {each: 0.0007 for each in whole.parameters if each.quantity == "delay_s"}
    found = explained(replace(whole, parameters=free, fixed=delays), np.zeros(len(free)), rounds=1)
    assert found.best == "stribeck_friction", found
