"""Fuzzing of frames: random frames cause no error, and commands beyond the limits are found."""

from unittest.mock import Mock

import fuzz_frames
import numpy as np
import pytest
from fuzz_tally import Tally

from footfall.deploy import joint_layer
from footfall.robots.description import Robot

BATCHES = range(24)


def fuzzed(model: str, settings_known: bool = True) -> Tally:
    tally = Tally()
    fuzz_frames.fuzz_motors_of(model, settings_known, BATCHES, tally)
    return tally


@pytest.mark.parametrize("model", fuzz_frames.MODELS)
@pytest.mark.parametrize("settings_known", [False, True])
def test_random_frames_cause_no_error(model: str, settings_known: bool) -> None:
    tally = fuzzed(model, settings_known)
    assert tally.unexpected == {}
    assert [counts.total() for counts in tally.outcomes.values()] == [len(BATCHES)] * 2


def test_an_interrupt_ends_the_cases_instead_of_counting_as_unexpected() -> None:
    tally = Tally()
    with pytest.raises(KeyboardInterrupt):
        tally.attempt("motors", 0, Mock(side_effect=KeyboardInterrupt))
    assert tally.unexpected == {}


def test_a_torque_within_the_frames_range_is_compared_with_the_motors(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(joint_layer, "limit_torque", lambda asked, *_: asked)
    unexpected = fuzzed("").unexpected
    assert unexpected
    assert all("too much torque" in trace for trace in unexpected.values())


@pytest.mark.parametrize(
    ("velocity", "torque", "excess"),
    [
        (0.0, 23.7, 0.0),  # peak torque of a hip
        (0.0, 47.4, 1.0),
        (30.1, 23.7, None),  # no torque is left in the direction of motion
        (-30.1, 23.7, 0.0),  # braking with the peak torque is possible
    ],
)
def test_motor_torque_by_its_speed(go1: Robot, velocity: float, torque: float, excess: float | None) -> None:
    assert (go1.motor.peak_torque[0], go1.motor.no_load_speed[0]) == (23.7, 30.1)
    sent, speeds = np.zeros((5, 12)), np.zeros(12)
    sent[4, 0], speeds[0] = torque, velocity
    found = fuzz_frames.excess(sent, go1.default_pose, speeds, go1)
    assert found[0] == pytest.approx(1.0 if excess is None else excess)
    assert (found[1:] == -1.0).all()
