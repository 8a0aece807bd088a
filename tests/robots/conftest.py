"""Imported robots that several tests read."""

import pytest
from foreign_robots import BIPED_MJCF, make, quadruped

from footfall.robots.description import Robot
from footfall.robots.importer.create import Imported


@pytest.fixture(scope="session")
def four(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    """The machine of a four-legged robot in a URDF."""
    return make(tmp_path_factory.mktemp("four"), quadruped())


@pytest.fixture(scope="session")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    """The machine of a two-legged robot with soles in an MJCF."""
    return make(tmp_path_factory.mktemp("two"), BIPED_MJCF, "xml")
