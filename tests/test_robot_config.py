"""Settings read from YAML: what is refused is named, with the reason and what would be right."""

from dataclasses import dataclass

import pytest
import yaml

from footfall.common.config import dump, structure
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
    span: tuple[float, float] = (0.0, 1.0)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        ({}, "cart.yaml: name: required field missing"),
        ({"name": 3}, "cart.yaml: name: 3 is not text"),
        ({"name": "a", "covered": 1}, "cart.yaml: covered: 1 is not true or false"),
        (
            {"name": "a", "colour": "red"},
            "cart.yaml: no setting colour (there are name, wheels, covered, span)",
        ),
        (
            {"name": "a", "wheels": [{"radius_m": "big"}]},
            "cart.yaml: wheels[0].radius_m: 'big' is not a number",
        ),
        (
            {"name": "a", "wheels": [{"radius_m": 1.0}, {"radius_m": -1.0}]},
            "cart.yaml: wheels[1]: radius_m must be above 0, not -1.0",
        ),
        (
            {"name": "a", "wheels": [{"radius_m": 1.0, "spokes": 8.5}]},
            "cart.yaml: wheels[0].spokes: 8.5 is not a whole number",
        ),
    ],
)
def test_refusals_name_the_field_and_the_reason(data: dict, expected: str) -> None:
    with pytest.raises(UserError) as caught:
        structure(data, Cart, "cart.yaml")
    assert str(caught.value) == expected


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


def test_dump_reads_back() -> None:
    cart = Cart("a", (Wheel(0.3), Wheel(0.4, 12)), True)
    assert structure(yaml.safe_load(dump(cart)), Cart, "cart.yaml") == cart
