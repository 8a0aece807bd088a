"""Which geoms of another maker's model are the feet."""

import mujoco

from footfall.robots.description import Robot, load_spec
from footfall.robots.feet import find_feet


def test_a_foot_on_a_link_that_is_fixed_to_the_shin_is_found_by_its_place(go1: Robot) -> None:
    spec = load_spec(go1.xml_path)
    name = go1.description.feet[2].geoms[0]
    theirs = spec.geom(name)
    at, size, shin = theirs.pos.copy(), theirs.size.copy(), theirs.parent
    spec.delete(theirs)
    toe = shin.add_body(name="toe", pos=at)
    toe.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, contype=1)
    shin.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=size, contype=1)  # at its upper end: no foot
    model = spec.compile()
    feet = find_feet(model, go1)
    assert [model.body(model.geom_bodyid[geom]).name for geom in feet[2]] == ["toe"]
