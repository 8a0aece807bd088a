"""What doctor makes of what it finds."""

from pathlib import Path

import pytest

from footfall import machine


@pytest.mark.parametrize(
    ("governors", "good"),
    [
        (["performance", "performance"], True),
        (["performance", "powersave"], False),
        (["schedutil"], False),
        ([], True),
    ],
)
def test_processors_that_save_power_are_slow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, governors: list[str], good: bool
) -> None:
    for number, governor in enumerate(governors):
        folder = tmp_path / f"cpu{number}" / "cpufreq"
        folder.mkdir(parents=True)
        (folder / "scaling_governor").write_text(f"{governor}\n")
    monkeypatch.setattr(machine, "PROCESSORS", tmp_path)
    found = machine._processors()
    assert found.good == good
    assert ("performance" in found.advice) == (not good)


def test_both_simulators_are_of_one_release(monkeypatch: pytest.MonkeyPatch) -> None:
    versions = {"mujoco": "3.17.0", "mujoco-mjx": "3.17.0"}
    monkeypatch.setattr(machine, "version", versions.__getitem__)
    assert machine._simulators()[:2] == ("simulators", True)
    versions["mujoco-mjx"] = "3.16.0"
    found = machine._simulators()
    assert not found.good
    assert found.found == "mujoco 3.17.0, mujoco-mjx 3.16.0"
