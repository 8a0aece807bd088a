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

    def __post_init__(self) -> None:
        if self.radius_m <= 0:
            raise ValueError(f"radius_m must be above 0, not {self.radius_m}")


@dataclass(frozen=True)
class Cart:
    name: str

    wheels: tuple[Wheel, ...] = ()

    covered: bool = False
    steered: Literal["front", "rear"] = "front"

    span: tuple[float, float] = (0.0, 1.0)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({"name": "a", "steered": "left"}, "cart.yaml: steered: 'left' is none of front, rear"),
        ({"name": "a", "steered": ["rear"]}, "cart.yaml: steered: ['rear'] is none of front, rear"),
        (
            {"name": "a", "wheels": [{"radius_m": 1.0}, {"radius_m": -1.0}]},
            "cart.yaml: wheels[1]: radius_m must be above 0, not -1.0",
        ),
    ],
)
def test_refusals_name_the_field_and_the_reason(data: dict, expected: str) -> None:
    with pytest.raises(UserError) as caught:
        structure(data, Cart, "cart.yaml")
    assert str(caught.value) == expected


@pytest.mark.parametrize("text", [".nan", ".inf", "-.inf", "1.0e+999", "1" + 400 * "0"])
def test_numbers_are_finite(text: str) -> None:
    with pytest.raises(UserError, match=r"^cart\.yaml: span\[1\]: not a finite number"):
        structure(yaml.safe_load(f"{{name: a, span: [0, {text}]}}"), Cart, "cart.yaml")


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
def test_what_is_no_yaml_is_told_in_one_line(tmp_path: Path, content: bytes) -> None:
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
def test_what_would_be_read_otherwise_than_meant_is_refused(tmp_path: Path, content: str, why: str) -> None:
    (tmp_path / "cart.yaml").write_text(content)
    refused = rf"cart\.yaml is not valid YAML: {re.escape(why)} \(line \d+, column \d+\)$"
    with pytest.raises(UserError, match=refused):
        read_yaml(tmp_path / "cart.yaml")


def test_what_is_merged_in_gives_way_to_a_key_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "cart.yaml").write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: *a\n")
    assert read_yaml(tmp_path / "cart.yaml") == {
        "a": {"x": 1, "y": 2},
        "b": {"x": 1, "y": 3},
        "c": {"x": 1, "y": 2},
    }


def test_a_setting_that_there_is_not_may_be_a_number() -> None:
    with pytest.raises(UserError, match=r"^here: no setting 2 \(there are "):
        structure({"name": "a", "span": [0.0, 1.0], 2: 3}, Cart, "here")


def test_a_message_repeats_no_more_of_a_value_than_fits_a_line() -> None:
    with pytest.raises(UserError, match=f"^here: name: \\[{'0, ' * 26}0\\.\\.\\. is not text"):
        structure({"name": [0] * 1000, "span": [0.0, 1.0]}, Cart, "here")


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("# later\n")
    assert with_changes({"kp": 1.0}, tmp_path / "mine.yaml") == {"kp": 1.0}
    (tmp_path / "mine.yaml").write_text("kp: 2.0\n")
    assert with_changes({"kp": 1.0, "kd": 3.0}, tmp_path / "mine.yaml") == {"kp": 2.0, "kd": 3.0}


@pytest.mark.parametrize("data", [[], "text", 3, {"name": "a", "span": [1.0]}, {"name": "a", "wheels": 3}])
def test_the_wrong_kind_of_value_is_refused_in_one_line(data: object) -> None:
    with pytest.raises(UserError, match=r"^cart\.yaml: ") as caught:
        structure(data, Cart, "cart.yaml")
    assert "\n" not in str(caught.value)


def test_whole_numbers_do_for_floats_and_come_out_as_floats() -> None:
    cart = structure({"name": "a", "span": [0, 2]}, Cart, "cart.yaml")
    assert repr(cart.span) == "(0.0, 2.0)"


@pytest.mark.parametrize("text", ["1e-3", "3E+2", "-2.e1"])
def test_numbers_with_an_exponent_need_no_point(text: str) -> None:
    cart = structure(yaml.safe_load(f"{{name: a, span: [0, {text}]}}"), Cart, "cart.yaml")
    assert cart.span == (0.0, float(text))


@dataclass(frozen=True)
class Inner:
    size: float

    names: tuple[str, ...] = ()

    on: bool = False


@dataclass(frozen=True)
class Outer:
    count: int

    inner: Inner

    label: str = "none"


@dataclass(frozen=True)
class Defaults:
    count: int = 3


class TestSettings:
    def test_a_file_reads_as_what_was_dumped(self, tmp_path: Path) -> None:
        settings = Outer(3, Inner(2.5, ("b", "a"), True), "yes")
        path = tmp_path / "a.yaml"
        path.write_text(dump(settings))
        assert load(path, Outer) == settings
        assert dump(settings).splitlines()[0] == "count: 3"  # in the order of the fields
        inner = unstructure(settings)["inner"]
        assert (inner["size"], list(inner["names"]), inner["on"]) == (2.5, ["b", "a"], True)

    @pytest.mark.parametrize(
        ("data", "says"),
        [
            ({"count": 1.0, "inner": {"size": 1}}, "here: count: 1.0 is not a whole number"),
            ({"count": True, "inner": {"size": 1}}, "here: count: True is not a whole number"),
            ({"count": 1, "inner": {"size": True}}, "here: inner.size: True is not a number"),
            ({"count": 1, "inner": {"size": "1"}}, "here: inner.size: '1' is not a number"),
            ({"count": 1, "inner": {"size": 10**400}}, "here: inner.size: not a finite number"),
            ({"count": 1, "inner": {"size": -float("inf")}}, "here: inner.size: not a finite number"),
            ({"count": 1, "inner": {"size": 1, "on": 1}}, "here: inner.on: 1 is not true or false"),
            (
                {"count": 1, "inner": {"size": 1, "names": [7]}},
                "here: inner.names[0]: 7 is not text: put it in quotes",
            ),
            (
                {"count": 1, "inner": {"size": 1, "b": 2, "a": 3}},
                "here: inner: no setting a, b (there are size, names, on)",
            ),
            (
                {"count": 1, "inner": {"size": 1, "nmaes": []}},
                "here: inner: no setting nmaes (did you mean names?)",
            ),
            ({}, "here: count, inner: required field missing"),
            ({"count": 1, "inner": None}, "here: inner: expected a mapping of settings"),
            ({"count": 1, "inner": 3}, "here: inner: expected a mapping of settings"),
            ([1], "here: expected a mapping of settings, found list"),
        ],
    )
    def test_what_is_wrong_is_named_with_its_place(self, data: Any, says: str) -> None:
        with pytest.raises(UserError) as caught:
            structure(data, Outer, "here")
        assert str(caught.value) == says

    def test_an_empty_file_leaves_every_setting_at_its_default(self, tmp_path: Path) -> None:
        (tmp_path / "empty.yaml").write_text("# nothing\n")
        assert load(tmp_path / "empty.yaml", Defaults) == Defaults()
        with pytest.raises(UserError, match=r"empty\.yaml: count.*: required"):
            load(tmp_path / "empty.yaml", Outer)

    def test_a_merge_replaces_leaf_by_leaf_and_leaves_both_as_they_were(self) -> None:
        base = {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
        changes = {"a": {"c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
        expected = {"a": {"b": 1, "c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
        assert merged(base, changes) == expected
        assert base == {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
        assert merged({"a": 1}, {"a": {"b": 2}}) == {"a": {"b": 2}}

    def test_the_largest_size_is_the_limit(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(config, "LARGEST_BYTES", 2000)
        path = tmp_path / "a.yaml"
        path.write_text("a: 1 #" + "x" * 1994)
        assert read_yaml(path) == {"a": 1}
        path.write_text("a: 1 #" + "x" * 1995)
        with pytest.raises(UserError, match="larger than 2,000 bytes"):
            read_yaml(path)
        with pytest.raises(UserError, match=r"no\.yaml: No such file"):
            read_yaml(tmp_path / "no.yaml")
