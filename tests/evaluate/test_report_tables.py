"""Tables of the report."""

import pytest
from report_pages import FILE, comparison, result, walked

from footfall.evaluate.comparison import Comparison
from footfall.evaluate.report import tables
from footfall.evaluate.report.tables import Cell, Heading
from footfall.robots.description import Robot


@pytest.fixture
def two(go1: Robot) -> Comparison:
    """The second policy is worse except for pushes, and did not walk the course."""
    return comparison(
        go1, result("mine", "runs/mine", 0.1, 0, 1.0, walked()), result("trot", "trot", 0.3, 12, 2.0, None)
    )


class TestTables:
    def test_the_headline_has_a_figure_of_each_policy_in_its_row(self, two: Comparison) -> None:
        table = tables.headline_table(two)
        assert table.corner == "Policy"
        assert table.columns == [
            Heading("Falls", "nominal"),
            Heading("Velocity error", "m/s, nominal"),
            Heading("Median survivable push", "m/s, push"),
            Heading("Time per step", "ms p50 / p99, alone"),
        ]
        (mine, cells), (trot, others) = table.rows
        assert (mine, trot) == (Heading("mine", "made by hand", 0), Heading("trot", "made by hand", 1))
        assert cells == [
            Cell("0 of 24", "0 to 14 %", is_best=True),
            Cell("0.100", "0.090 to 0.110", is_best=True),
            Cell("1.00", "0.90 to 1.10"),
            Cell("0.21 / 0.40", "of 20 ms"),
        ]
        assert others == [
            Cell("12 of 24", "31 to 69 %"),
            Cell("0.300", "0.270 to 0.330"),
            Cell("2.00", "1.90 to 2.10", is_best=True),
            Cell("0.21 / 0.40", "of 20 ms"),
        ]

    def test_each_scenario_has_its_own_figures_and_endings(self, two: Comparison) -> None:
        nominal, push = tables.scenario_parts(two)
        assert (nominal.name, push.name) == ("nominal", "push")
        assert (nominal.about, push.about) == (FILE.scenarios["nominal"].about, FILE.scenarios["push"].about)
        assert nominal.table.columns == [Heading("mine", index=0), Heading("trot", index=1)]
        assert [heading for heading, _ in nominal.table.rows] == [
            Heading("Falls"),
            Heading("Velocity error", "m/s"),
        ]
        assert Heading("Median survivable push", "m/s") in [heading for heading, _ in push.table.rows]
        assert [cell.text for cell in nominal.table.rows[1][1]] == ["0.100", "0.300"]
        assert nominal.endings == ["trot: the base touched the ground (12)"]
        assert push.endings == [f"{name}: the base touched the ground (11)" for name in ("mine", "trot")]
