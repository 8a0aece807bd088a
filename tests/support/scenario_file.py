"""A file of scenarios, and a scenario's summary, made by hand."""

from pathlib import Path
from typing import Any

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
OWN = Path("own.yaml")


def bare(name: str) -> dict[str, Any]:
    """A scenario's summary of 4 falls in 24 episodes."""
    return {"episodes": 24, "failed_episodes": [], "falls": 4, "fall_rate": 4 / 24,
            "fall_rate_interval": [0.1, 0.2], "notes": [], "about": name}  # fmt: skip
