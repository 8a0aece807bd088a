"""Force sensors at the feet: frames, simulated robot, log, and the estimator's trust in them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_robots import with_foot_sensors
from deploy_policies import short_episode
from edited import content_of
from refused import refusal_of
from some_motors import frame

from footfall import Robot, Trace, load_policy, load_robot, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers import foot_force
from footfall.deploy.drivers.choice import filters_of, open_driver
from footfall.deploy.drivers.foot_force import FootForceReader
from footfall.deploy.log_analysis.columns import read_columns
from footfall.deploy.loop import ControlLoop
from footfall.deploy.replay import replay
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.train.config import load_preset

SENSING = with_foot_sensors(load_robot("go1"))


class TestFrames:
    def test_a_frame_encodes_forces_as_calculated_by_hand(self) -> None:
        """123.4 N are 1234 = 0x04d2 units; -1 N is 0xfff6; the range ends at 0x7fff; the counter follows."""
        data = foot_force.encode(np.array([123.4, -1.0, 1e9]), 0x0102)
        assert [row[:4].tobytes().hex(" ") for row in data] == ["04 d2 01 02", "ff f6 01 02", "7f ff 01 02"]

    def test_a_force_counts_until_its_sensor_repeats_itself(self) -> None:
        """Short frames and frames of another bus are ignored."""
        reader = FootForceReader(np.array([0, 1]))
        for other in (frame(0x310, "04 d2 00 01", channel=1), frame(0x310, "04 d2 00", channel=0)):
            reader.absorb(other, 0)
            assert np.isnan(reader.force(0)).all()
        reader.absorb(frame(0x311, "04 d2 00 01", channel=1), 1_000)
        np.testing.assert_allclose(reader.force(20_999), [np.nan, 123.4])
        reader.absorb(frame(0x311, "04 d2 00 01", channel=1), 20_000)
        assert np.isnan(reader.force(21_000)).all()

    def test_interfaces_pass_their_identifiers(self, go1: Robot) -> None:
        for robot, passes in ((SENSING, True), (go1, False)):
            filters = filters_of(wiring_of(robot))
            assert any(0x313 & each["can_mask"] == each["can_id"] for each in filters) is passes


def walk(robot: Robot, watch: Any = None, **settings: Any) -> Trace:
    """A walk of mpc, which uses the estimate."""
    episode = short_episode(command_source=lambda _: np.array([0.3, 0.0, 0.0]), **settings)
    return run_episode(robot, load_policy("mpc", robot), episode, watch)


def test_bad_declarations_are_refused(own_folder: Path, go1: Robot) -> None:
    """Errors of sensors need sensors; no learned policy reads them. A sensor's identifier is no motor's."""
    with content_of(own_folder / "robot.yaml") as content:
        content["feet"][2]["force_bus"] = "can0"  # one foot alone
    assert "force_bus" in refusal_of(load_robot, own_folder)
    wiring = wiring_of(SENSING)
    wiring = replace(wiring, motor_id=np.array([0x310, *wiring.motor_id[1:]]))
    assert "0x310" in refusal_of(open_driver, wiring)
    assert "foot_force_scale" in refusal_of(walk, go1, sample={"foot_force_scale": np.ones(4)})
    family = Randomisation(foot_force_scale=Distribution(0.9, 1.1))
    env = replace(load_preset("smoke").env, randomisation=family)
    assert "foot_force_scale" in refusal_of(LocomotionEnv, SENSING, env)


class TestWalk:
    @pytest.mark.parametrize("exchanged", [False, True])
    def test_wrong_sensors_do_not_make_the_robot_fall(self, exchanged: bool) -> None:
        """One is silent, the others read 0, too much and a negative force; or the plugs are exchanged."""

        def distort(loop: ControlLoop, body: Any) -> None:
            if loop.walking and loop.walking_s > 0.2:
                body.foot_sensors.silent[0] = not exchanged
                wrong = np.array([0.0, 0.0, 3000.0, -50.0])
                body.foot_sensors.distort = lambda true: np.roll(true, 2) if exchanged else wrong

        trace = walk(SENSING, distort)
        assert (trace.fell, trace.faults) == (False, ())
        assert sum("force sensor" in note for note in trace.notes) == 4
        assert np.abs(trace.estimated_velocity - trace.base_velocity)[-20:, 0].mean() < 0.005

    def test_forces_are_logged_with_the_errors_of_their_sensors(self, tmp_path: Path) -> None:
        """The run's log is also replayed: forces are part of a policy's inputs."""
        log = tmp_path / "walk.mcap"
        sample = {
            "foot_force_scale": np.array([1.0, 1.2, 1.0, 1.0]),
            "foot_force_offset_n": np.array([0.0, 0.0, 10.0, 0.0]),
            "foot_force_noise_n": np.array([0.0, 0.0, 0.0, 5.0]),
        }
        trace = walk(SENSING, duration_s=0.2, sample=sample, log=log, config=DeployConfig(stand_s=0.8))
        assert not trace.notes
        time_s, logged = read_columns(log).column("/foot_forces", 4)
        still = logged[(time_s > 0.5) & (time_s < 0.8)]
        mean, spread = still.mean(axis=0), still.std(axis=0)
        even = 9.81 * SENSING.legs.mass / 4
        np.testing.assert_allclose(mean, [even, 1.2 * even, even + 10.0, even], atol=6.0)
        assert spread[3] > 2.0 > spread[:3].max()
        assert replay(log, load_policy("mpc", SENSING)).worst_difference == 0.0
