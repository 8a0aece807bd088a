"""Episodes of a scenario: commands, levels, pushes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_robots import described
from refused import refusal_of

from footfall import UserError, load_robot
from footfall.evaluate.episodes import sample_of
from footfall.evaluate.plan import CommandSchedule, plan_episodes, spread_levels
from footfall.evaluate.scenarios import DrawnCommands, Scenario, Waypoint, load_scenarios
from footfall.robots.commands import CommandRange

ROBOT = load_robot("go1")
FILE = load_scenarios(ROBOT)
MANY = [0.5] * 250
RANGES = CommandRange((-0.2, 0.4), (-0.1, 0.3), (-0.5, 2.0))
OTHER = described(ROBOT, commands=RANGES)


def written(folder: Path, text: str, bare: str = "about: x, episodes: 1, duration_s: 5, ") -> Path:
    """A file of one scenario: this text, after the entries that every scenario needs."""
    path = folder / "own.yaml"
    path.write_text(f"scenarios: {{own: {{{bare}{text}}}}}")
    return path


def test_an_impossible_scenario_is_refused_with_its_field(tmp_path: Path) -> None:
    fixed = "commands: {leftward_m_s: [0, 0], yaw_rad_s: [0, 0]"
    for text, named in (
        ("levels: {gravity: [1]}", "gravity"), ("rows: [friction]", "levels"),
        ("levels: {push_m_s: [1]}", "push_between_s"),
        ("levels: {push_m_s: [1]}, push_between_s: [2, 1]", "push_between_s"),
        ("levels: {push_m_s: [1]}, push_between_s: [-1, 1]", "push_between_s"),
        ("levels: {push_m_s: [-1]}, push_between_s: [0, 1]", "level push_m_s"),
        ("levels: {friction: [0.5, -0.1]}", "level friction must be from 0 to 10, not -0.1"),
        ("levels: {action_delay_s: [1.5]}", "level action_delay_s"),
        ("levels: {step_m: [0.1]}", "level step_m"),
        (f"levels: {{friction: {MANY}, kp: {MANY}, kd: [1, 1.1]}}", "100,000"),
        ("ground: {shape: stair}", "no shape 'stair'"), ("ground: {shape: stairs}", "step_m"),
        ("ground: {shape: stairs}, levels: {step_m: [0.1, 3]}", "step_m: must be from -1 to 1, not 3"),
        (f"{fixed}, forward_m_s: [0, 1], hold_s: [0, 1]}}", "hold_s"),  # else drawing might not end
        (f"{fixed}, hold_s: [1, 2], forward_m_s: [1, -1]}}", "forward_m_s"),
        (f"{fixed}, hold_s: [1, 2], forward_m_s: [0, 1e3]}}", "forward_m_s must be from -100 to 100"),
        (f"{fixed}, hold_s: [1, 2], forward_m_s: [0, 1], standing_share: 7}}", "standing_share"),
        (f"{fixed}, hold_s: [1, 2], forward_m_s: [0, 1]}}, script: [{{at_s: 0}}]", "commands or a script"),
        (f"{fixed}, hold_s: [1, 2], forward_m_s: [0, 1]}}, levels: {{yaw_rad_s: [1]}}", "yaw_rad_s"),
        ("script: [{at_s: 1}]", "at_s"), ("script: [{at_s: 0}, {at_s: 2}, {at_s: 2}]", "at_s"),
        ("script: [{at_s: 0, yaw_rad_s: -101}]", "yaw_rad_s must be from -100 to 100, not -101"),
        ("pushes: [{time_s: -1, delta_v_m_s: [1, 0, 0]}]", "time_s"),
        ("pushes: [{time_s: 1, delta_v_m_s: [1, 0, 1e9]}]", "delta_v_m_s"),
        ("forward_share: high", "own.yaml"),
    ):  # fmt: skip
        assert named in refusal_of(load_scenarios, ROBOT, written(tmp_path, text)), text
    for bare, named in (
        ("about: x, episodes: 1", "duration_s"), ("about: x, episodes: 100001, duration_s: 5", "episodes"),
        ("about: x, episodes: 0, duration_s: 5", "episodes"),
        ("about: x, episodes: 1, duration_s: 86401", "duration_s"),
    ):  # fmt: skip
        assert named in refusal_of(load_scenarios, ROBOT, written(tmp_path, "", bare)), bare
    with pytest.raises(UserError, match=r"100001 .*push"):
        plan_episodes("push", FILE.scenarios["push"], 0, 100_001)


def test_shares_are_of_the_robots_range_of_commands() -> None:
    scenarios = load_scenarios(OTHER).scenarios
    drawn = scenarios["nominal"].commands
    assert drawn is not None
    assert (drawn.forward_m_s, drawn.leftward_m_s, drawn.yaw_rad_s) == tuple(vars(RANGES).values())
    assert scenarios["forward"].script[0].forward_m_s == pytest.approx(1.5 * 0.4)
    _, _, turn, aside, *_ = scenarios["course"].script
    assert (turn.forward_m_s, turn.yaw_rad_s) == pytest.approx((0.6 * 0.4, 0.8 * 2.0))
    assert aside.leftward_m_s == pytest.approx(0.8 * 0.3)
    sweep = scenarios["sweep"]
    assert sweep.levels["forward_m_s"][:2] == pytest.approx((-0.2, -0.1))
    assert sweep.levels["yaw_rad_s"] == pytest.approx((-0.5, -0.25, 0.0, 1.0, 2.0))
    assert sweep.rows == ("forward_m_s", "yaw_rad_s")


def test_no_load_may_make_the_base_weightless(tmp_path: Path) -> None:
    """A Go1's base is 5.204 kg in Unitree's model."""
    load_scenarios(ROBOT, written(tmp_path, "levels: {payload_kg: [-5.2, 1]}"))
    with pytest.raises(UserError, match=r"payload_kg.* -5\.21"):
        load_scenarios(ROBOT, written(tmp_path, "levels: {payload_kg: [1, -5.21]}"))


def test_a_users_file_adds_and_replaces_scenarios_and_may_use_units(tmp_path: Path) -> None:
    (tmp_path / "own.yaml").write_text(
        "scenarios: {push: {episodes: 3}, slow: {about: x, episodes: 1, duration_s: 5,"
        " script: [{at_s: 0, forward_m_s: 0.07, yaw_share: -1}]}}"
    )
    shipped, file = load_scenarios(OTHER), load_scenarios(OTHER, tmp_path / "own.yaml")
    (waypoint,) = file.scenarios["slow"].script
    assert (waypoint.forward_m_s, waypoint.yaw_rad_s) == (0.07, -0.5)
    assert file.scenarios["push"] == replace(shipped.scenarios["push"], episodes=3)
    assert file.noise == shipped.noise
    assert list(file.scenarios) == [*shipped.scenarios, "slow"]


class TestPlans:
    def test_episodes_depend_only_on_scenario_seed_and_number(self) -> None:
        for name, scenario in FILE.scenarios.items():
            few, again, many = (plan_episodes(name, scenario, 3, count) for count in (5, 5, 40))
            assert few == again == many[:5]

    def test_a_push_has_the_size_and_direction_of_its_levels_and_a_random_phase(self) -> None:
        plans = plan_episodes("push", FILE.scenarios["push"], 0)
        for plan in plans:
            (push,) = plan.pushes
            angle = np.deg2rad(plan.levels["push_direction_deg"])
            expected = plan.levels["push_m_s"] * np.array([np.cos(angle), np.sin(angle), 0.0])
            assert push.delta_v_m_s == pytest.approx(expected)
        times_s = [plan.pushes[0].time_s for plan in plans]
        assert min(times_s) < 1.6
        assert max(times_s) > 2.4

    def test_a_script_is_followed_and_levels_stand_in_for_its_axes(self) -> None:
        script = (Waypoint(0.0, 0.1, 0.2, 0.3), Waypoint(1.5, -0.4, -0.5, -0.6))
        scenario = Scenario("x", 2, 4.0, script=script, levels={"leftward_m_s": (0.9,)})
        (plan, _) = plan_episodes("x", scenario, 0)
        schedule = CommandSchedule((0.0, 1.5), ((0.1, 0.9, 0.3), (-0.4, 0.9, -0.6)))
        assert (plan.scenario, plan.index, plan.duration_s) == ("x", 0, 4.0)
        assert (plan.randomised, plan.pushes, plan.schedule) == (False, (), schedule)

    def test_drawn_commands_and_their_durations_are_in_their_ranges(self) -> None:
        drawn = DrawnCommands((0.1, 0.2), (0.3, 0.4), (0.5, 0.6), (0.7, 0.9), standing_share=0.25)
        plans = plan_episodes("x", Scenario("x", 40, 10.0, commands=drawn, randomised=True), 0)
        commands = np.array([command for plan in plans for command in plan.schedule.commands])
        stands = ~commands.any(axis=1)
        assert stands.mean() == pytest.approx(0.25, abs=0.07)
        assert commands[~stands].min(axis=0) == pytest.approx([0.1, 0.3, 0.5], abs=0.01)
        assert commands[~stands].max(axis=0) == pytest.approx([0.2, 0.4, 0.6], abs=0.01)
        held = np.concatenate([np.diff(plan.schedule.from_s) for plan in plans])
        assert (held.min(), held.max()) == pytest.approx((0.7, 0.9), abs=0.01)
        assert all(9.1 <= plan.schedule.from_s[-1] < 10.0 for plan in plans)
        assert all(plan.randomised for plan in plans)
        assert [plan.index for plan in plans] == list(range(40))

    def test_pushes_come_within_their_time_and_straight_ahead_unless_a_direction_is_given(self) -> None:
        scenario = Scenario("x", 50, 5.0, levels={"push_m_s": (0.5, 2.0)}, push_between_s=(1.25, 1.75))
        plans = plan_episodes("x", scenario, 0)
        times_s = [plan.pushes[0].time_s for plan in plans]
        assert (min(times_s), max(times_s)) == pytest.approx((1.25, 1.75), abs=0.05)
        for plan in plans:
            assert plan.pushes[0].delta_v_m_s == pytest.approx((plan.levels["push_m_s"], 0.0, 0.0))
        assert plan_episodes("x", replace(scenario, levels={"friction": (0.5,)}), 0)[0].pushes == ()

    def test_every_combination_of_levels_comes_before_a_combination_repeats(self) -> None:
        levels = {"friction": (0.2, 0.4, 0.6), "payload_kg": (0.0, 1.0), "forward_m_s": (0.3, 0.5)}
        chosen = spread_levels(levels, 24, np.random.default_rng(1))
        assert [list(each) for each in chosen] == [list(levels)] * 24
        drawn = [tuple(each.values()) for each in chosen]
        assert (len(set(drawn[:12])), drawn[12:]) == (12, drawn[:12])
        orders = [[each[1:] for each in drawn[:12] if each[0] == friction] for friction in levels["friction"]]
        assert not orders[0] == orders[1] == orders[2]  # each repetition has its own order
        assert spread_levels({}, 3, np.random.default_rng(0)) == [{}, {}, {}]


def test_a_command_holds_from_its_time_until_the_next() -> None:
    first, second = (1.0, 0.0, 0.0), (0.0, 0.5, 0.0)
    schedule = CommandSchedule((0.0, 2.0), (first, second))
    for time_s, command in ((-0.5, first), (0.0, first), (1.999, first), (2.0, second), (99.0, second)):
        assert np.array_equal(schedule(time_s), command)


def test_a_level_overrides_the_drawn_value() -> None:
    (plan,) = plan_episodes("randomised", FILE.scenarios["randomised"], 0, 1)
    sample = sample_of(replace(plan, levels={"friction": 0.15}), ROBOT, 13)
    assert sample is not None
    assert sample["friction"] == 0.15
    assert sample.keys() > {"friction", "motor_strength"}
