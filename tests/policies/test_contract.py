"""The contract: JSON preserves it bit for bit, and mismatches are reported."""

import json
from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from refused import refusal_of

from footfall.policies.contract import CONTRACT_KEY, TRAINER_KEY, Contract, Gait, Term
from footfall.robots.commands import CommandRange
from footfall.robots.description import Robot

above_zero = st.floats(0, exclude_min=True, allow_nan=False, allow_infinity=False)
numbers = st.floats(allow_nan=False, allow_infinity=False)
ranges = st.tuples(numbers, numbers)
text = st.text(max_size=6)
terms = st.builds(Term, text, numbers, st.integers(1, 9))


@st.composite
def contracts(draw: st.DrawFn) -> Contract:
    """Any valid contract."""
    joints = draw(st.lists(text, max_size=6).map(tuple))
    per_joint = st.lists(numbers, min_size=len(joints), max_size=len(joints)).map(tuple)
    return Contract(
        robot=draw(text),
        digest=draw(text),
        joints=joints,
        control_rate_hz=draw(st.floats(1.0, 1000.0)),
        observation=draw(st.lists(terms, min_size=1).map(tuple)),
        default_pose_rad=draw(per_joint),
        action_scale_rad=draw(per_joint),
        kp=draw(per_joint),
        kd=draw(per_joint),
        commands=draw(st.builds(CommandRange, ranges, ranges, ranges)),
        gait=draw(st.none() | st.builds(Gait, above_zero, per_joint, per_joint)),
        standing_command=draw(numbers),
    )


@settings(max_examples=25)
@given(contracts())
def test_json_round_trip_is_exact(contract: Contract) -> None:
    again = Contract.from_json(contract.to_json(), "a test")
    assert (again, repr(again)) == (contract, repr(contract))  # 0.0 == -0.0, but their texts differ


def refusal(text: str) -> str:
    message = refusal_of(Contract.from_json, text, "walk.onnx")
    assert message.startswith("walk.onnx: ")
    return message


def test_a_text_that_is_no_contract_is_refused_in_one_line() -> None:
    for text in ("", "{", "9" * 5000, "[" * 100_000, "[]"):
        refusal(text)
    for text in ("{}", '{"robot": 3}'):
        assert "robot" in refusal(text)


def test_a_wrong_field_is_named(contract: Contract) -> None:
    gait = {"frequency_hz": 2.0, "phase": [0.0] * 12, "amplitude_rad": [0.0] * 12}
    for field, value, expected in (
        ("control_rate_hz", 0.0, "control_rate_hz"),
        ("control_rate_hz", 1e-9, "control_rate_hz"),
        ("observation", [], "observation"),
        ("observation", [{"name": "gyro", "history": 0}], "history"),
        ("kp", [20.0], "kp has 1 numbers for 12"),
        ("kd", [0.5] * 13, "kd has 13 numbers for 12"),
        ("default_pose_rad", [0.0] * 11, "default_pose_rad has 11"),
        ("action_scale_rad", [], "action_scale_rad has 0"),
        ("kp", ["stiff"] * 12, "'stiff'"),
        ("gait", gait | {"phase": [0.0]}, "gait.phase has 1"),
        ("gait", gait | {"amplitude_rad": [0.0]}, "gait.amplitude_rad has 1"),
        ("gait", gait | {"frequency_hz": 0.0}, "frequency_hz"),
        ("gait", gait | {"duty": 1.0}, "duty"),
        ("commands", {"forward_m_s": [0.0]}, "commands"),
        ("mood", 1, "mood"),
    ):
        assert expected in refusal(json.dumps(json.loads(contract.to_json()) | {field: value})), field


def test_a_mismatch_names_its_field_only(contract: Contract, go1: Robot) -> None:
    """If the joints differ, values per joint are not listed; if any field differs, the digest is not."""
    other: dict[str, Any] = {
        "robot": "go2", "version": 0, "digest": "0123456789abcdef", "default_pose_rad": (0.0,) * 12,
        "joints": tuple(f"joint_{i}" for i in range(12)), "kp": (20.0,) * 12, "kd": (0.5,) * 12,
    }  # fmt: skip
    for changed, named in (
        ((), []),
        *(((field,), [field]) for field in other),
        (("robot", "joints", "kp", "kd"), ["robot", "joints"]),
        (("robot", "digest", "kd"), ["robot", "kd"]),
    ):
        found = replace(contract, **{field: other[field] for field in changed}).mismatches(go1)
        assert [line.split(":")[0] for line in found] == named
        assert "\n" not in "".join(found)


def test_a_mismatch_shows_both_values(contract: Contract, go1: Robot) -> None:
    """Values are of the first joint that differs.

    The last bit of a gain counts, and so does the joints' order.
    """
    nudged = (contract.kp[0] * (1 + 2**-52), *contract.kp[1:])
    swapped = (contract.joints[1], contract.joints[0], *contract.joints[2:])
    for field, value, result in (
        ("robot", "go2", ("go2", "go1")),
        ("kp", nudged, (f"{nudged[0]}", f"{go1.kp[0]}")),
        ("kp", (*contract.kp[:-1], 1.5), ("1.5", f"{go1.kp[-1]}")),
        ("kp", (1.5,) * 12, ("1.5", f"{go1.kp[0]}", "11 more")),
        ("joints", swapped, ("FR_thigh_joint", "FR_hip_joint", "1 more")),
        ("digest", "0" * 16, ("0" * 16, go1.digest)),
    ):
        (line,) = replace(contract, **{field: value}).mismatches(go1)
        assert line.startswith(f"{field}: ")
        assert all(part in line for part in result), line


def test_names_under_which_files_are_already_written(contract: Contract) -> None:
    """Policies that were exported earlier must stay readable."""
    assert (CONTRACT_KEY, TRAINER_KEY) == ("footfall.contract", "footfall.trainer")
    written = json.loads(contract.to_json())
    assert written["version"] == 1
    assert list(written) == [
        *("robot", "digest", "joints", "control_rate_hz", "observation", "default_pose_rad"),
        *("action_scale_rad", "kp", "kd", "commands", "gait", "standing_command", "version"),
    ]


def test_missing_contract_fields_have_their_defaults(contract: Contract) -> None:
    written = json.loads(contract.to_json())
    del written["standing_command"], written["version"], written["gait"]["duty"]
    written["observation"] = [{"name": "gyro"}]
    read = Contract.from_json(json.dumps(written), "walk.onnx")
    assert (read.standing_command, read.version, read.observation) == (0.1, 1, (Term("gyro", 1.0, 1),))
    assert read.gait is not None
    assert read.gait.duty == 0.5
