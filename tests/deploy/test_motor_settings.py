"""Settings read from each maker's motors before they are enabled: late replies, timeouts to set."""

import pytest
from deploy_policies import Hold, stand_still
from some_motors import MAKERS, with_motors
from watched_simulation import Simulation

from footfall.deploy.config import DeployConfig
from footfall.deploy.session import Session, run_session
from footfall.plant.frame_changes import late
from footfall.robots.description import Robot


@pytest.mark.parametrize(
    ("maker", "late_us"),
    [("MIT mode", 5000), ("ODrive", 5000), ("moteus", 5000), ("mixed", 5000), ("Damiao", 1000)],
)
def test_a_robot_whose_replies_are_late_stands_up(go1: Robot, maker: str, late_us: int) -> None:
    robot = with_motors(go1, **MAKERS[maker])
    simulated = Simulation(robot, motor_timeout_s=None, hanging=True)
    simulated.bus.incoming = late(late_us)
    session = Session(stand_still, 0.05, realtime=False, config=DeployConfig(stand_s=0.1), lie_down=False)
    outcome = run_session(robot, Hold(robot), simulated.bus, session)
    assert (outcome.faults, outcome.final_state) == ((), "IDLE")
