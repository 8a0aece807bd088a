"""Imported robots that several tests read."""

import pytest
from foreign_robots import BIPED_MJCF, make, quadruped

from footfall.robots.description import Robot
from footfall.robots.importer.create import Imported


@pytest.fixture(scope="session")
def four(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    """A four-legged robot, imported from a URDF."""
    return make(tmp_path_factory.mktemp("four"), quadruped())


@pytest.fixture(scope="session")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    """A two-legged robot with soles, imported from an MJCF."""
    return make(tmp_path_factory.mktemp("two"), BIPED_MJCF)
