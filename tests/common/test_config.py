"""Dataclasses from YAML and back."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pytest
import yaml

from footfall.common import config
from footfall.common.config import (
    dump,
    load,
    merged,
    read_yaml,
    require_between,
    require_not_negative,
    require_ordered,
    require_positive,
    structure,
    unstructure,
    with_changes,
)
from footfall.common.errors import UserError


@dataclass(frozen=True)
class Wheel:
    radius_m: float
    spokes: int = 8
    tags: tuple[str, ...] = ()
    driven: bool = False

    def __post_init__(self) -> None:
        require_positive(self, "radius_m")


@dataclass(frozen=True)
class Cart:
    name: str
    first: Wheel
    wheels: tuple[Wheel, ...] = ()
    steered: Literal["front", "rear"] = "front"
    span: tuple[float, float] = (0.0, 1.0)


ROUND = {"radius_m": 1}
A_CART = {"name": "a", "first": ROUND}


def read(**changes: Any) -> Cart:
    return structure(A_CART | changes, Cart, "here")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (A_CART | {"steered": "left"}, "steered: 'left' is none of front, rear"),
        (A_CART | {"steered": ["rear"]}, "steered: ['rear'] is none of front, rear"),
        (A_CART | {"wheels": [ROUND, {"radius_m": -1.0}]}, "wheels[1]: radius_m must be above 0, not -1.0"),
        *(
            (A_CART | {"first": ROUND | first}, f"first{message}")
            for first, message in (
                ({"spokes": 1.0}, ".spokes: 1.0 is not a whole number"),
                ({"spokes": True}, ".spokes: True is not a whole number"),
                ({"radius_m": True}, ".radius_m: True is not a number"),
                ({"radius_m": "1"}, ".radius_m: '1' is not a number"),
                ({"radius_m": 10**400}, ".radius_m: not a finite number"),
                ({"radius_m": -float("inf")}, ".radius_m: not a finite number"),
                ({"driven": 1}, ".driven: 1 is not true or false"),
                ({"tags": [7]}, ".tags[0]: 7 is not text: put it in quotes"),
                ({"b": 2, "a": 3}, ": no setting a, b (there are radius_m, spokes, tags, driven)"),
                ({"spoeks": 1}, ": no setting spoeks (did you mean spokes?)"),
            )
        ),
        ({}, "name, first: required field missing"),
        ({"name": "a", "first": None}, "first: expected a mapping of settings"),
        ({"name": "a", "first": 3}, "first: expected a mapping of settings"),
        ([1], "expected a mapping of settings, found list"),
    ],
)
def test_a_wrong_value_is_refused_with_its_place(data: Any, message: str) -> None:
    with pytest.raises(UserError) as caught:
        structure(data, Cart, "here")
    assert str(caught.value) == f"here: {message}"


@pytest.mark.parametrize(
    "data",
    [[], "text", 3, A_CART | {"span": [1.0]}, A_CART | {"wheels": 3}, A_CART | {2: 3}, {"name": [0] * 1000}],
)
def test_the_wrong_kind_of_value_is_refused_in_one_short_line(data: object) -> None:
    with pytest.raises(UserError, match=r"^here: [^\n]{,200}$"):
        structure(data, Cart, "here")


@pytest.mark.parametrize("text", [".nan", ".inf", "-.inf", "1.0e+999", "1" + 400 * "0"])
def test_numbers_are_finite(text: str) -> None:
    with pytest.raises(UserError, match=r"^here: span\[1\]: not a finite number"):
        read(**yaml.safe_load(f"span: [0, {text}]"))


def test_whole_numbers_and_exponents_without_a_point_are_floats() -> None:
    assert repr(read(span=[0, 2]).span) == "(0.0, 2.0)"
    for text in ("1e-3", "3E+2", "-2.e1"):
        assert read(**yaml.safe_load(f"span: [0, {text}]")).span == (0.0, float(text))


@dataclass(frozen=True)
class Spring:
    stiffness: tuple[float, ...] = (1.0,)
    rest_m: float = 0.0
    share: float | None = 0.5
    travel_m: tuple[float, float] | None = (-1.0, 1.0)

    def __post_init__(self) -> None:
        require_positive(self, "stiffness")
        require_not_negative(self, "rest_m")
        require_between(self, 0, 1, "share")
        require_ordered(self, "travel_m")


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"stiffness": (1.0, 0.0)}, "stiffness must be above 0, not 0.0"),
        ({"stiffness": (float("nan"),)}, "stiffness must be above 0, not nan"),
        ({"stiffness": (float("inf"),)}, "stiffness must be above 0, not inf"),
        ({"rest_m": -1e-9}, "rest_m must be 0 or above, not -1e-09"),
        ({"rest_m": float("nan")}, "rest_m must be 0 or above, not nan"),
        ({"share": 1.01}, "share must be from 0 to 1, not 1.01"),
        ({"share": -0.01}, "share must be from 0 to 1, not -0.01"),
        ({"share": float("nan")}, "share must be from 0 to 1, not nan"),
        ({"travel_m": (1.0, -1.0)}, "travel_m must be a range from low to high, not [1.0, -1.0]"),
        ({"travel_m": (0.0, float("nan"))}, "travel_m must be a range from low to high, not [0.0, nan]"),
        ({"travel_m": (0.0, float("inf"))}, "travel_m must be a range from low to high, not [0.0, inf]"),
    ],
)
def test_values_out_of_range_are_named_with_the_rule(settings: dict, reason: str) -> None:
    Spring((1e-300, 1e300), 0.0, 0.0, (2.0, 2.0))  # all at the edge of their range
    Spring(share=1.0)
    Spring(share=None, travel_m=None)
    with pytest.raises(ValueError) as caught:  # noqa: PT011, compared in full
        Spring(**settings)
    assert str(caught.value) == reason


@pytest.mark.parametrize(
    "content",
    [b"when: 2026-13-45", b"x: " + 5000 * b"1", 5000 * b"[", b"\xff\xfe\xff", b"a: [", b"? [a]\n: 1"],
    ids=["no such date", "a number of 5000 digits", "nested", "no text", "cut short", "a list for a name"],
)
def test_invalid_yaml_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "cart.yaml"
    path.write_bytes(content)
    with pytest.raises(UserError, match=r"cart\.yaml is not valid YAML: [^\n]+$"):
        read_yaml(path)


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join(8 * [f'*a{i - 1}'])}]\n" for i in range(1, 9)
)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        ("kp: 1\nkd: 2\nkp: 3\n", "the key kp is repeated"),
        ("a: {kp: 1, kp: 1}", "the key kp is repeated"),
        ("on: 2", "the key on is neither text nor a whole number"),
        ("~: 2", "the key ~ is neither text nor a whole number"),
        ("a: &a {b: *a}", "an alias is inside the value that it repeats"),
        ("a: &a [*a]", "an alias is inside the value that it repeats"),
        (BOMB, "its aliases repeat more than 262,144 values"),
    ],
)
def test_ambiguous_yaml_is_refused(tmp_path: Path, content: str, why: str) -> None:
    (tmp_path / "cart.yaml").write_text(content)
    refused = rf"cart\.yaml is not valid YAML: {re.escape(why)} \(line \d+, column \d+\)$"
    with pytest.raises(UserError, match=refused):
        read_yaml(tmp_path / "cart.yaml")


def test_own_keys_override_merged_keys(tmp_path: Path) -> None:
    (tmp_path / "cart.yaml").write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: *a\n")
    assert read_yaml(tmp_path / "cart.yaml") == {
        "a": {"x": 1, "y": 2},
        "b": {"x": 1, "y": 3},
        "c": {"x": 1, "y": 2},
    }


def test_a_file_loads_as_it_was_dumped(tmp_path: Path) -> None:
    cart = Cart("yes", Wheel(2.5, 3, ("b", "a"), True))
    path = tmp_path / "a.yaml"
    path.write_text(dump(cart))
    assert load(path, Cart) == cart
    assert dump(cart).splitlines()[0] == "name: 'yes'"  # in the order of the fields
    first = unstructure(cart)["first"]
    assert (first["radius_m"], list(first["tags"]), first["driven"]) == (2.5, ["b", "a"], True)


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("# later\n")
    assert with_changes({"kp": 1.0}, path) == {"kp": 1.0}
    assert load(path, Spring) == Spring()
    with pytest.raises(UserError, match=r"mine\.yaml: name.*: required"):
        load(path, Cart)
    path.write_text("kp: 2.0\n")
    assert with_changes({"kp": 1.0, "kd": 3.0}, path) == {"kp": 2.0, "kd": 3.0}


def test_a_merge_replaces_leaf_by_leaf_and_leaves_both_as_they_were() -> None:
    base = {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
    changes = {"a": {"c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
    expected = {"a": {"b": 1, "c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
    assert merged(base, changes) == expected
    assert base == {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
    assert merged({"a": 1}, {"a": {"b": 2}}) == {"a": {"b": 2}}


def test_the_largest_size_is_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "MAX_FILE_BYTES", 2000)
    path = tmp_path / "a.yaml"
    path.write_text("a: 1 #" + "x" * 1994)
    assert read_yaml(path) == {"a": 1}
    path.write_text("a: 1 #" + "x" * 1995)
    with pytest.raises(UserError, match="larger than 2,000 bytes"):
        read_yaml(path)
    with pytest.raises(UserError, match=r"no\.yaml: No such file"):
        read_yaml(tmp_path / "no.yaml")
