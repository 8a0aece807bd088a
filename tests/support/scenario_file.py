"""A file of scenarios made by hand."""

from footfall.domain_rand.noise import Noise
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint

OWN_NOISE = Noise(gyro=0.123)
FILE = ScenarioFile(
    OWN_NOISE,
    {
        "one": Scenario("One", 3, 2.0, script=(Waypoint(0.0),), levels={"friction": (0.3, 0.9)}),
        "two": Scenario("Two", 2, 3.0, script=(Waypoint(0.0),)),
        "course": Scenario("A walk", 5, 4.0, script=(Waypoint(0.0),)),
    },
)
