"""Force sensors at the feet: frames, simulated robot, log, and the estimator's trust in them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from edited import content_of
from foot_sensors import equipped
from some_motors import frame

from footfall import Episode, Robot, Trace, UserError, load_policy, load_robot, run_episode
from footfall.deploy.drivers import foot_force
from footfall.deploy.drivers.choice import filters_of, open_driver
from footfall.deploy.drivers.foot_force import FootForceReader
from footfall.deploy.frames import Frames
from footfall.deploy.log_analysis.columns import read_columns
from footfall.deploy.loop import ControlLoop
from footfall.deploy.replay import replay
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.plant.robot import SimulatedRobot
from footfall.train.config import load_preset

Distortion = Callable[[SimulatedRobot], None]
FORWARD = np.array([0.3, 0.0, 0.0])


@pytest.fixture(scope="module")
def sensing() -> Robot:
    return equipped(load_robot("go1"))


class TestFrames:
    def test_a_frame_encodes_forces_as_calculated_by_hand(self) -> None:
        """123.4 N are 1234 = 0x04d2 units; -1 N is 0xfff6; the range ends at 0x7fff; the counter follows."""
        data = foot_force.encode(np.array([123.4, -1.0, 1e9]), 0x0102)
        assert [row[:4].tobytes().hex(" ") for row in data] == ["04 d2 01 02", "ff f6 01 02", "7f ff 01 02"]

    def test_a_force_counts_until_its_sensor_repeats_itself(self) -> None:
        reader = FootForceReader(np.array([0, 1]))
        assert np.isnan(reader.force(0)).all()
        reader.absorb(frame(0x311, "04 d2 00 01", channel=1), 1_000)
        np.testing.assert_allclose(reader.force(20_999), [np.nan, 123.4])
        reader.absorb(frame(0x311, "04 d2 00 01", channel=1), 20_000)
        assert np.isnan(reader.force(21_000)).all()

    @pytest.mark.parametrize(
        "other", [frame(0x310, "04 d2 00 01", channel=1), frame(0x310, "04 d2 00", channel=0)]
    )
    def test_short_frames_and_frames_of_another_bus_are_ignored(self, other: Frames) -> None:
        reader = FootForceReader(np.array([0, 1]))
        reader.absorb(other, 0)
        assert np.isnan(reader.force(0)).all()

    def test_interfaces_pass_their_identifiers(self, go1: Robot, sensing: Robot) -> None:
        for robot, passes in ((sensing, True), (go1, False)):
            filters = filters_of(wiring_of(robot))
            assert any(0x313 & each["can_mask"] == each["can_id"] for each in filters) is passes


class TestDeclaration:
    def written(self, folder: Path, **buses: str) -> Path:
        """A robot with force sensors on these buses, by foot."""
        with content_of(folder / "robot.yaml") as content:
            for foot in content["feet"]:
                if foot["name"] in buses:
                    foot["force_bus"] = buses[foot["name"]]
        return folder

    def test_bad_declarations_are_refused(self, own_folder: Path, go1: Robot, sensing: Robot) -> None:
        """Errors of sensors need sensors; no learned policy reads force sensors.

        A sensor's identifier is no motor's.
        """
        with pytest.raises(UserError, match="force_bus"):
            load_robot(self.written(own_folder, **{go1.description.feet[2].name: "can0"}))
        wiring = wiring_of(sensing)
        with pytest.raises(UserError, match="0x310"):
            open_driver(replace(wiring, motor_id=np.array([0x310, *wiring.motor_id[1:]])))
        with pytest.raises(UserError, match="foot_force_scale"):
            walk(go1, None, sample={"foot_force_scale": np.ones(4)})
        family = Randomisation(foot_force_scale=Distribution(0.9, 1.1))
        with pytest.raises(UserError, match="foot_force_scale"):
            LocomotionEnv(sensing, replace(load_preset("smoke").env, randomisation=family))


def walk(robot: Robot, distort: Distortion | None, duration_s: float = 1.2, **settings: object) -> Trace:
    """mpc, which uses the estimate, with sensors that become wrong 0.2 s later."""

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if distort is not None and loop.walking and loop.walking_s > 0.2:
            distort(body)

    episode = Episode(command_source=lambda _: FORWARD, duration_s=duration_s, **settings)  # type: ignore[arg-type]
    return run_episode(robot, load_policy("mpc", robot), episode, watch)


def each_otherwise(body: SimulatedRobot) -> None:
    """The first sensor is silent, the others report no force, too large a force, and a negative force."""
    assert body.foot_sensors is not None
    body.foot_sensors.silent[0] = True
    body.foot_sensors.distort = lambda true: np.array([0.0, 0.0, 3000.0, -50.0])


def exchanged(body: SimulatedRobot) -> None:
    """The plugs of front and hind feet are exchanged."""
    assert body.foot_sensors is not None
    body.foot_sensors.distort = lambda true: np.roll(true, 2)


class TestWalk:
    @pytest.mark.parametrize("distort", [each_otherwise, exchanged])
    def test_wrong_sensors_do_not_make_the_robot_fall(self, sensing: Robot, distort: Distortion) -> None:
        trace = walk(sensing, distort, 1.0)
        assert not trace.fell
        assert not trace.faults
        assert sum("force sensor" in note for note in trace.notes) == 4
        assert np.abs(trace.estimated_velocity - trace.base_velocity)[-20:, 0].mean() < 0.005

    def test_forces_are_logged_with_the_errors_of_their_sensors(self, sensing: Robot, tmp_path: Path) -> None:
        """The run's log is also replayed: forces are part of a policy's inputs."""
        log = tmp_path / "walk.mcap"
        sample = {
            "foot_force_scale": np.array([1.0, 1.2, 1.0, 1.0]),
            "foot_force_offset_n": np.array([0.0, 0.0, 10.0, 0.0]),
            "foot_force_noise_n": np.array([0.0, 0.0, 0.0, 5.0]),
        }
        trace = walk(sensing, None, 0.4, sample=sample, log=log)
        assert not trace.notes
        columns = read_columns(log)
        time_s, logged = columns.column("/foot_forces", 4)
        still = (time_s > 0.5) & (time_s < 0.9)
        mean, spread = logged[still].mean(axis=0), logged[still].std(axis=0)
        even = 9.81 * sensing.legs.mass / 4
        np.testing.assert_allclose(mean, [even, 1.2 * even, even + 10.0, even], atol=6.0)
        assert spread[3] > 2.0 > spread[:3].max()
        assert replay(log, load_policy("mpc", sensing)).worst_difference == 0.0
