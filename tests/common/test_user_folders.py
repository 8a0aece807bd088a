"""A user without a home folder, as in a container with `--user 12345`."""

from pathlib import Path

import pytest
from refused import refusal_of

from footfall.common.cache import compilation_cache
from footfall.deploy.log_store import default_store
from footfall.deploy.wiring_check.proof import is_proven, keep_proof
from footfall.machine import check_cache
from footfall.robots.description import Robot


@pytest.fixture(autouse=True)
def _no_home(monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for variable in ("HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME", "JAX_COMPILATION_CACHE_DIR"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(Path, "home", unknown)


def test_the_refusal_names_a_variable_or_an_option_that_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "XDG_CACHE_HOME" in refusal_of(compilation_cache)
    assert "--log" in refusal_of(default_store, 1000)
    monkeypatch.setenv("XDG_CACHE_HOME", "/var/cache")
    assert compilation_cache().is_relative_to("/var/cache/footfall")


def test_doctor_reports_that_trainings_have_no_cache() -> None:
    finding = check_cache()
    assert not finding.good
    assert "HOME" in finding.result


def test_a_wiring_is_checked_in_each_run(go1: Robot) -> None:
    assert not is_proven(go1, "socketcan")
    assert "HOME" in keep_proof(go1, "socketcan", [])
