"""`footfall evaluate` and `footfall compare`: what the files hold."""

import json
from pathlib import Path

import pytest
from shell import Shell

BRIEF = ("--scenarios", "forward", "--episodes", "1", "--workers", "1")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def test_evaluate_writes_what_it_promises(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "trot.json"
    outcome = shell("evaluate", "trot", *BRIEF, "--seed", "4", "--json", path)
    assert outcome.status == 0, outcome.err
    assert "forward" in outcome.out
    result = json.loads(path.read_text())
    assert (result["policy"], result["robot"], result["seed"]) == ("trot", "go1", 4)
    figures = result["scenarios"]["forward"]
    for name in ("episodes", "falls", "lin_vel_rmse", "yaw_rate_rmse", "cost_of_transport"):
        assert name in figures
    assert figures["episodes"] == 1


def test_push_adds_the_even_odds_point_with_its_interval(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "stand.json"
    shell("evaluate", "stand", "--scenarios", "push", "--episodes", "2", "--workers", "1", "--json", path)
    figures = json.loads(path.read_text())["scenarios"]["push"]
    assert "dv50" in figures
    assert "dv50_interval" in figures


def test_compare_nests_the_same_under_each_name(shell: Shell, tmp_path: Path) -> None:
    path, report = tmp_path / "both.json", tmp_path / "both.html"
    outcome = shell("compare", "stand", "trot", *BRIEF, "--json", path, "--html", report)
    assert outcome.status == 0, outcome.err
    results = json.loads(path.read_text())
    for name in ("stand", "trot"):
        assert results[name]["scenarios"]["forward"]["episodes"] == 1
        assert set(results[name]["compute_ms"]) == {"p50", "p99"}
    page = report.read_text()
    assert "stand" in page
    assert "trot" in page
    assert "https://" not in page.split("</head>")[0]  # self-contained


def test_the_same_seed_gives_the_same_figures(shell: Shell, tmp_path: Path) -> None:
    results = []
    for name in ("a.json", "b.json"):
        shell("evaluate", "trot", *BRIEF, "--seed", "2", "--json", tmp_path / name)
        figures = json.loads((tmp_path / name).read_text())["scenarios"]["forward"]
        results.append({k: v for k, v in figures.items() if k not in ("compute_ms", "missed_deadlines")})
    assert results[0] == results[1]
