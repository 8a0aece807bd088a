"""The simulated robot: falls, and plants that differ from the robot."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from plant_bodies import body_of

from footfall import Robot, UserError
from footfall.domain_rand.sample import Sample


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_tilt_past_70_degrees_is_a_fall(go1: Robot, axis: int) -> None:
    """A turn about the vertical is none."""
    body = body_of(go1)
    for degrees in (69.0, 71.0, -71.0, 150.0):
        half = np.deg2rad(degrees) / 2
        body.data.qpos[2:7] = 2.0, np.cos(half), 0.0, 0.0, 0.0
        body.data.qpos[4 + axis] = np.sin(half)
        mujoco.mj_forward(body.model, body.data)
        assert bool(body.fall()) is (axis < 2 and abs(degrees) > 70.0)


def test_a_sample_for_another_body_count_is_refused(go1: Robot) -> None:
    with pytest.raises(UserError, match=r"3 bodies.* 13"):
        body_of(go1, sample=Sample(link_mass=np.ones(3)))


def test_a_plant_without_reflected_inertia_gets_the_robots(go1: Robot, tmp_path: Path) -> None:
    plant, text = tmp_path / "light.xml", go1.xml_path.read_text()
    for armature in (' armature="0.00403"', ' armature="0.00906"'):
        assert armature in text
        text = text.replace(armature, "")
    plant.write_text(text)
    body = body_of(go1, plant=plant)
    assert "reflected inertia" in body.notes[0]
    np.testing.assert_allclose(body.model.dof_armature[6:], go1.armature)
