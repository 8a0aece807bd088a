"""The simulated robot: its initial position, its time, its pushes and its IMU."""

from pathlib import Path

import numpy as np
import pytest
from plant_bodies import body_of, throw

from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses


class TestStart:
    def test_the_robot_starts_on_the_highest_ground_below_its_feet(
        self, altered: Robot, own_folder: Path
    ) -> None:
        """A step under one foot raises the robot by the step's height; the gate stays at its position."""
        text = altered.xml_path.read_text()
        step = '<geom type="plane" size="0 0 1" pos="0 0 -1"/>'
        step += '<geom type="box" size="0.1 0.1 0.2" pos="0.19 0.13 -0.9"/>'
        (own_folder / "step.xml").write_text(text.replace("<worldbody>", f"<worldbody>{step}"))
        body = body_of(altered, plant=own_folder / "step.xml")
        data = body.data
        np.testing.assert_array_equal(
            data.qpos[joint_addresses(body.model, altered)[0]], altered.default_pose
        )
        assert data.qpos[:3].tolist() == [0.7, 0.0, 0.0]
        assert data.qpos[4:8].tolist() == [1.0, 0.0, 0.0, 0.0]
        assert data.qpos[3] == pytest.approx(altered.description.standing_height_m - 0.7, abs=1e-4)
        lowest = data.geom("FL_foot").xpos[2] - 0.023
        assert -1e-6 < -0.7 - lowest < 1e-6

    def test_a_plant_over_an_abyss_is_refused(self, go1: Robot, tmp_path: Path) -> None:
        text = go1.xml_path.read_text()
        deep = '<worldbody><geom type="plane" size="0 0 1" pos="0 0 -6"/>'
        (tmp_path / "deep.xml").write_text(text.replace("<worldbody>", deep))
        with pytest.raises(Exception, match="4 m"):
            body_of(go1, plant=tmp_path / "deep.xml")

    def test_a_push_is_in_the_worlds_axes_and_acts_on_the_base_only(self, altered: Robot) -> None:
        body = body_of(altered)
        throw(body)
        before = body.data.qvel.copy()
        body.push((0.1, -0.2, 0.3))
        np.testing.assert_allclose((body.data.qvel - before)[:5], [0.0, 0.1, -0.2, 0.3, 0.0], atol=1e-12)
        assert not (body.data.qvel - before)[5:].any()

    def test_the_imu_reports_every_two_milliseconds_with_the_next_count(self, go1: Robot) -> None:
        wiring = wiring_of(go1)
        wires = SimulatedWires(wiring.buses)
        body = SimulatedRobot(go1, wiring, wires)

        def received_ids(until_us: int) -> list[int]:
            """Counters of arrived gyro frames. Only the IMU's bus has gyro frames."""
            body.advance(until_us)
            frames = wires.receive(Side.HOST, until_us)
            assert all((batch.channel == wiring.imu_channel).all() for batch in frames)
            assert all(batch.id.tolist() == [0x300, 0x301, 0x302] for batch in frames)
            return [int.from_bytes(batch.data[0, 6:].tobytes(), "big") for batch in frames]

        assert received_ids(1000) == [1]
        assert received_ids(2500) == []
        assert received_ids(7000) == [2, 3, 4]
        body.faults.imu_stuck = True
        assert received_ids(9000) == [4]
        body.faults.imu_silent = True
        assert received_ids(13_000) == []
        body.faults.imu_silent = body.faults.imu_stuck = False
        assert received_ids(15_000) == [5]
