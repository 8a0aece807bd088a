"""Settings read from each maker's motors before they are enabled: late replies, timeouts to set."""

from dataclasses import replace

import numpy as np
import pytest
from deploy_policies import Hold, stand_still
from some_motors import MAKERS, two_motors, with_motors
from watched_simulation import Simulation

from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.settings import ASK_AGAIN, Settings, TimeOut
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


class TestQuestions:
    """Questions to two motors with the settings 9, a timeout in steps of 50 us, and 10."""

    @pytest.fixture
    def settings(self) -> Settings:
        wiring = replace(two_motors("RS00", "RS03"), timeout_s=np.array([0.1, 0.05]))
        return Settings(wiring, {9: "time-out", 10: "mode"}, TimeOut(9, 50e-6))

    def test_an_unanswered_question_is_repeated_after_some_ticks(self, settings: Settings) -> None:
        questions = [len(settings.questions()) for _ in range(2 * ASK_AGAIN + 3)]
        assert [tick for tick, count in enumerate(questions) if count] == [
            0,
            ASK_AGAIN + 1,
            2 * ASK_AGAIN + 2,
        ]

    def test_an_answer_brings_the_next_question_once(self, settings: Settings) -> None:
        settings.questions()
        settings.note(1, 9, 500)
        assert settings.questions() == [(1, 10, None)]
        settings.note(0, 9, 2000)
        settings.questions()
        settings.note(0, 9, 2000)
        assert settings.questions() == []
