"""The contract: it survives the trip through JSON bit for bit, and says what does not fit."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from policies.contract import CommandRange, Contract, Gait, Term
from robots.description import Robot, load_robot
from robots.errors import UserError

numbers = st.floats(allow_nan=False, allow_infinity=False)
tuples = st.lists(numbers, min_size=1, max_size=6).map(tuple)
ranges = st.tuples(numbers, numbers)
contracts = st.builds(
    Contract,
    robot=st.text(),
    digest=st.text(),
    joints=st.lists(st.text()).map(tuple),
    control_rate_hz=numbers,
    observation=st.lists(st.builds(Term, st.text(), numbers, st.integers(1, 9))).map(tuple),
    default_pose_rad=tuples,
    action_scale_rad=tuples,
    kp=tuples,
    kd=tuples,
    commands=st.builds(CommandRange, ranges, ranges, ranges),
    gait=st.none() | st.builds(Gait, numbers, tuples, tuples),
    standing_command=numbers,
)


@given(contracts)
def test_json_round_trip_is_exact(contract: Contract) -> None:
    again = Contract.from_json(contract.to_json(), "a test")
    assert again == contract
    assert repr(again) == repr(contract)  # tells -0.0 from 0.0, which == does not


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[]", "mapping"),
        ("{}", "robot"),
        ('{"robot": 3}', "robot"),
    ],
)
def test_garbage_is_refused_in_one_line(text: str, wanted: str) -> None:
    with pytest.raises(UserError, match=wanted) as caught:
        Contract.from_json(text, "walk.onnx")
    assert str(caught.value).startswith("walk.onnx: ")
    assert "\n" not in str(caught.value)


def test_unknown_field_is_refused_by_name(contract: Contract) -> None:
    text = contract.to_json().replace('"robot":', '"mood": 1, "robot":', 1)
    with pytest.raises(UserError, match="mood"):
        Contract.from_json(text, "walk.onnx")


def test_a_fitting_contract_has_no_mismatches(contract: Contract, go1: Robot) -> None:
    assert contract.mismatches(go1) == []


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("robot", "go2"),
        ("joints", ("FL_hip_joint",)),
        ("version", 0),
        ("default_pose_rad", (0.0,) * 12),
        ("kp", (20.0,) * 12),
        ("kd", (0.5,) * 12),
        ("action_scale_rad", (0.25,) * 12),
        ("digest", "0123456789abcdef"),
    ],
)
def test_a_mismatch_names_the_field_and_nothing_else(
    contract: Contract, go1: Robot, field: str, value: object
) -> None:
    found = replace(contract, **{field: value}).mismatches(go1)
    assert [line.split(":")[0] for line in found] == [field]
    assert "\n" not in found[0]


def test_a_last_bit_of_a_gain_is_a_mismatch(contract: Contract, go1: Robot) -> None:
    nudged = (contract.kp[0] * (1 + 2**-52), *contract.kp[1:])
    assert [line.split(":")[0] for line in replace(contract, kp=nudged).mismatches(go1)] == ["kp"]


def test_a_changed_body_is_a_mismatch(contract: Contract, own_folder: Path) -> None:
    xml = own_folder / "robot.xml"
    xml.write_text(xml.read_text().replace('mass="5.204"', 'mass="6"'))
    (line,) = contract.mismatches(load_robot(own_folder))
    assert line.startswith("digest:")
