"""Self-contacts in training are those of the simulated robot."""

import mujoco
import numpy as np

from footfall.robots.description import load_robot
from footfall.robots.model import training_model


def test_original_shapes_collide_as_on_the_simulated_robot() -> None:
    """A simplified, thick shank cannot hook behind another leg, but a sphere foot on a thin shank can."""
    robot = load_robot("go1")
    model = training_model(robot, contacts="true_limbs")
    paired = {model.geom(g).name for g in np.concatenate([model.pair_geom1, model.pair_geom2])}
    assert paired >= {foot.geoms[0] for foot in robot.description.feet}
    assert not paired & {"FR_shank", "FL_shank", "RR_shank", "RL_shank"}


def test_the_long_edges_of_a_box_are_sharp() -> None:
    """A thigh jams under an edge of the trunk from which it would slide if that were round."""
    model = training_model(load_robot("go1"), contacts="whole_body")
    shapes = np.flatnonzero(model.geom_bodyid == 1)
    box = next(g for g in shapes if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX)
    half = model.geom_size[box, 1:]
    capsules = shapes[model.geom_type[shapes] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    for sides in ([-1, -1], [-1, 1], [1, -1], [1, 1]):
        away = np.linalg.norm(model.geom_pos[capsules, 1:] - sides * half, axis=1)
        assert (away - model.geom_size[capsules, 0]).min() < 0.002
