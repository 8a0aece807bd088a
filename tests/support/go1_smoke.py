"""Go1 in the environment of the preset smoke."""

from dataclasses import replace

from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.feet import Feet
from footfall.envs.terms.data import Scene
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
N = len(ROBOT.joint_names)
SMOKE = load_preset("smoke").env
SMOKE_IN_C = replace(SMOKE, physics="c")  # compiled faster
FEW_TERMS = {  # traced and compiled faster, for tests of something else
    "observation": SMOKE.observation[:3], "critic": SMOKE.critic[:2], "rewards": SMOKE.rewards[2:3],
    "events": SMOKE.events[:1], "gait": None, "randomisation": Randomisation(),
}  # fmt: skip
FEW_IN_C = replace(SMOKE_IN_C, **FEW_TERMS)
MODEL = training_model(ROBOT, SMOKE.timestep_s)
SCENE = Scene(MODEL, ROBOT, Feet(MODEL, ROBOT, SMOKE.timestep_s, None), 0.02)
