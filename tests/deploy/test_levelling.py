"""A biped whose centre of mass differs from its model's stands up without tipping over."""

from dataclasses import replace

import numpy as np
import pytest

from footfall import Episode, Robot, load_policy, load_robot, run_episode
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.domain_rand.noise import Noise
from footfall.plant.robot import SimulatedRobot

SAMPLE = {"com_offset_m": np.array([0.03, 0.0, 0.01]), "payload_kg": 4.0}


@pytest.fixture(scope="module")
def g1() -> Robot:
    return load_robot("g1")


class TestABipedThatStandsUp:
    def test_a_biped_does_not_tip_over_its_toes(self, g1: Robot) -> None:
        """Without levelling the biped tips over."""
        episode = Episode(lambda _: np.zeros(3), duration_s=1.2, sample=SAMPLE)
        assert not run_episode(g1, load_policy("step", g1), episode).fell

    def test_a_biped_comes_to_rest(self, g1: Robot) -> None:
        """The biped has gyro noise, the bus's delays, and stiff joints such as those of a Talos."""
        rates: list[float] = []

        def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
            rates.append(float(body.data.qvel[4]))

        config = replace(deploy_config(g1), stand_kp_scale=8.0)
        episode = Episode(lambda _: np.zeros(3), 0.05, noise=Noise(gyro=0.02), config=config)
        run_episode(g1, load_policy("stand", g1), episode, watch)
        assert np.abs(rates[400:500]).max() < 0.2
