"""Requirements on the figures of an evaluation."""

import pytest

from footfall.evaluate.requirements import outcomes_of, parse_requirements

RESULTS = {
    "a": {
        "scenarios": {"walk": {"falls": 1, "lin_vel_rmse": 0.05, "own": {"lift": 0.2}}, "push": {"falls": 0}}
    },
    "b": {"scenarios": {"walk": {"falls": 0, "lin_vel_rmse": None}, "push": {}}},
}


def test_a_limit_holds_in_the_scenario_that_is_named_or_in_all() -> None:
    named, everywhere = parse_requirements(["walk.falls <= 0", "falls < 1"], ["walk", "push"])
    met = {(o.policy, o.scenario): o.met for o in outcomes_of([named], RESULTS)}
    assert met == {("a", "walk"): False, ("b", "walk"): True}
    met = {(o.policy, o.scenario): o.met for o in outcomes_of([everywhere], RESULTS)}
    assert met == {("a", "walk"): False, ("a", "push"): True, ("b", "walk"): True, ("b", "push"): False}


@pytest.mark.parametrize(
    ("text", "met"),
    [
        ("walk.lin_vel_rmse <= 0.05", True), ("walk.lin_vel_rmse < 0.05", False),
        ("walk.lin_vel_rmse >= 0.05", True), ("walk.lin_vel_rmse>0.05", False),
        ("walk.falls == 1", True), ("walk.own.lift >= 0.1", True), ("own.lift >= 0.3", False),
    ],
)  # fmt: skip
def test_each_comparison_operator(text: str, met: bool) -> None:
    requirements = parse_requirements([text], ["walk"], ["mine:lift"])
    assert [outcome.met for outcome in outcomes_of(requirements, {"a": RESULTS["a"]})] == [met]


def test_a_figure_that_was_not_measured_meets_no_requirement() -> None:
    requirements = parse_requirements(["walk.lin_vel_rmse <= 9"], ["walk"])
    assert not outcomes_of(requirements, {"b": RESULTS["b"]})[0].met
