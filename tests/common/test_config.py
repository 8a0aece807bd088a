"""Dataclasses from YAML and back."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pytest
import yaml
from refused import refusal_of

from footfall.common import config
from footfall.common.config import (
    load,
    merged,
    read_yaml,
    require_between,
    require_not_negative,
    require_ordered,
    require_positive,
    structure,
    with_changes,
)
from footfall.common.errors import UserError
from footfall.deploy.config import deploy_config
from footfall.identify.gain_search import GainConfig
from footfall.policies.registry import load_settings
from footfall.robots.description import Robot


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


def refusal(data: object) -> str:
    """Message of the refusal: one short line that begins with the settings' origin."""
    message = refusal_of(structure, data, Cart, "here")
    assert message.startswith("here: ")
    assert len(message) < 207
    return message.removeprefix("here: ")


def test_a_wrong_value_is_refused_with_its_key() -> None:
    for wrong, key in (
        ({"steered": "left"}, "steered: 'left'"),
        ({"steered": ["rear"]}, "steered: ['rear']"),
        ({"wheels": [ROUND, {"radius_m": -1.0}]}, "wheels[1]: radius_m"),
        ({"span": [0, float("nan")]}, "span[1]: "),
        ({"first": None}, "first: "),
        ({"first": 3}, "first: "),
    ):
        assert refusal(A_CART | wrong).startswith(key)
    for wheel, key in (
        ({"spokes": 1.0}, ".spokes: 1.0"), ({"spokes": True}, ".spokes: True"),
        ({"radius_m": True}, ".radius_m: True"), ({"radius_m": "1"}, ".radius_m: '1'"),
        ({"radius_m": 10**400}, ".radius_m: "), ({"radius_m": -float("inf")}, ".radius_m: "),
        ({"driven": 1}, ".driven: 1"), ({"tags": [7]}, ".tags[0]: 7"),
        ({"b": 2, "a": 3}, ": no setting a, b (there are radius_m, spokes, tags, driven)"),
        ({"spoeks": 1}, ": no setting spoeks (did you mean spokes?)"),
    ):  # fmt: skip
        assert refusal(A_CART | {"first": ROUND | wheel}).startswith(f"first{key}")
    assert refusal({}).startswith("name, first: ")
    for wrong in ([], [1], "text", 3, A_CART | {"span": [1.0]}, A_CART | {2: 3}, {"name": [0] * 1000}):
        assert refusal(wrong)


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


def test_values_out_of_range_are_named() -> None:
    Spring((1e-300, 1e300), 0.0, 0.0, (2.0, 2.0))  # all at the edge of their range
    Spring(share=1.0)
    Spring(share=None, travel_m=None)
    nan, inf = float("nan"), float("inf")
    for name, wrong in (
        ("stiffness", ((1.0, 0.0), (nan,), (inf,))),
        ("rest_m", (-1e-9, nan)),
        ("share", (1.01, -0.01, nan)),
        ("travel_m", ((1.0, -1.0), (0.0, nan), (0.0, inf))),
    ):
        for value in wrong:
            with pytest.raises(ValueError, match=f"^{name} "):
                Spring(**{name: value})


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join(8 * [f'*a{i - 1}'])}]\n" for i in range(1, 9)
)


def test_invalid_and_ambiguous_yaml_is_refused_in_one_line(tmp_path: Path) -> None:
    for content, why in (
        (b"when: 2026-13-45", ""), (b"x: " + 5000 * b"1", ""), (5000 * b"[", ""), (b"\xff\xfe\xff", ""),
        (b"a: [", ""), (b"? [a]\n: 1", ""), (b"kp: 1\nkd: 2\nkp: 3\n", "key kp .*line 3"),
        (b"a: {kp: 1, kp: 1}", "key kp .*line 1"), (b"on: 2", "key on .*line 1"),
        (b"~: 2", "key ~ .*line 1"), (b"a: &a {b: *a}", "alias .*line 1"),
        (b"a: &a [*a]", "alias .*line 1"), (BOMB.encode(), "aliases .*line"),
    ):  # fmt: skip
        (tmp_path / "cart.yaml").write_bytes(content)
        assert re.search(rf"cart\.yaml .*{why}", refusal_of(read_yaml, tmp_path / "cart.yaml"))


def test_a_mappings_own_keys_override_its_merged_keys(tmp_path: Path) -> None:
    (tmp_path / "cart.yaml").write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: *a\n")
    a = {"x": 1, "y": 2}
    assert read_yaml(tmp_path / "cart.yaml") == {"a": a, "b": {"x": 1, "y": 3}, "c": a}


def test_an_empty_file_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("# later\n")
    assert with_changes({"kp": 1.0}, path) == {"kp": 1.0}
    assert load(path, Spring) == Spring()
    assert re.search(r"mine\.yaml: name.*: required", refusal_of(load, path, Cart))
    path.write_text("kp: 2.0\n")
    assert with_changes({"kp": 1.0, "kd": 3.0}, path) == {"kp": 2.0, "kd": 3.0}


def test_a_merge_replaces_leaf_by_leaf_and_leaves_both_as_they_were() -> None:
    base = {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
    changes = {"a": {"c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
    assert merged(base, changes) == {"a": {"b": 1, "c": {"d": 3, "new": 4}}, "e": [9], "f": 5, "h": {"i": 6}}
    assert base == {"a": {"b": 1, "c": {"d": 2}}, "e": [1, 2], "f": {"g": 1}}
    assert merged({"a": 1}, {"a": {"b": 2}}) == {"a": {"b": 2}}


def test_the_largest_size_is_the_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(config, "MAX_FILE_BYTES", 2000)
    path = tmp_path / "a.yaml"
    path.write_text("a: 1 #" + "x" * 1994)
    assert read_yaml(path) == {"a": 1}
    path.write_text("a: 1 #" + "x" * 1995)
    assert "2,000" in refusal_of(read_yaml, path)
    assert "no.yaml" in refusal_of(read_yaml, tmp_path / "no.yaml")


def test_keys_of_earlier_versions_still_load_but_not_beside_the_new_ones(go1: Robot, tmp_path: Path) -> None:
    file = tmp_path / "old.yaml"
    file.write_text("contact: {most_force_n: 150}\nslope: {most: 0.4, ignored: 0.1}\n")
    for spec in (f"mpc@{file}", "mpc@contact.most_force_n=150@slope.most=0.4@slope.ignored=0.1"):
        settings = load_settings(spec, go1)
        assert settings.contact.max_force_n == 150.0
        assert (settings.slope.max_gradient, settings.slope.deadband) == (0.4, 0.1)
    assert load_settings("mpc-wbc@whole_body.contact.damping_s=3.0", go1).whole_body.contact.damping == 3.0
    assert load_settings("trot@touch_down.inertia_doubt=0.3", go1).touch_down.inertia_uncertainty == 0.3
    battery = "{least_share: 0.7, off_cell_v: 0.4}"
    file.write_text(f"safety: {{recovery: {{asked: true}}, battery: {battery}, sensors: {{limp_s: 0.2}}}}")
    safety = deploy_config(go1, file).safety
    assert safety.recovery.on_request
    assert (safety.battery.min_share, safety.battery.max_cell_deviation_v) == (0.7, 0.4)
    assert safety.sensors.no_torque_s == 0.2
    file.write_text("{most: 2.0, back_to: 0.5}")
    assert load(file, GainConfig) == GainConfig(max_gain=2.0, backoff=0.5)
    file.write_text("{most: 2.0, max_gain: 3.0}")
    with pytest.raises(UserError, match=r"old\.yaml.*most"):
        load(file, GainConfig)
