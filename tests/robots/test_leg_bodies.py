"""The leg that each body belongs to."""

import mujoco
import numpy as np

from footfall.robots.leg_bodies import NO_LEG, leg_of_bodies

# A waist that both legs hang on; the left leg ends in a foot that is fixed to its shank.
BODIES = """
<mujoco><worldbody><body name="base"><freejoint/><geom size="0.1"/>
  <body name="tail"><joint name="wag"/><geom size="0.02"/></body>
  <body name="waist"><joint name="twist"/><geom size="0.05"/>
    <body name="right"><joint name="right_hip"/><geom size="0.02"/></body>
    <body name="left"><joint name="left_hip"/><geom size="0.02"/>
      <body name="shank"><joint name="knee"/><geom size="0.02"/>
        <body name="foot"><geom size="0.02"/></body>
      </body>
    </body>
  </body>
</body></worldbody></mujoco>"""


def test_a_leg_consists_of_the_bodies_that_only_its_joints_move() -> None:
    model = mujoco.MjModel.from_xml_string(BODIES)
    legs = leg_of_bodies(model, [("twist", "left_hip", "knee"), ("twist", "right_hip")])
    by_name = {model.body(body).name: leg for body, leg in enumerate(legs.tolist())}
    none = dict.fromkeys(("world", "base", "tail", "waist"), NO_LEG)
    assert by_name == none | {"right": 1, "left": 0, "shank": 0, "foot": 0}
    assert np.all(leg_of_bodies(model, []) == NO_LEG)
