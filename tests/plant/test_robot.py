"""The simulated robot: its initial position, its time, its pushes and its IMU."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from plant_bodies import body_of, thrown

from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses


class TestStart:
    def test_the_robot_starts_on_the_highest_ground_below_its_feet(
        self, odd: Robot, own_folder: Path
    ) -> None:
        """A step under one foot raises the robot by the step's height; the gate stays at its position."""
        text = odd.xml_path.read_text()
        step = '<geom type="plane" size="0 0 1" pos="0 0 -1"/>'
        step += '<geom type="box" size="0.1 0.1 0.2" pos="0.19 0.13 -0.9"/>'
        (own_folder / "step.xml").write_text(text.replace("<worldbody>", f"<worldbody>{step}"))
        body = body_of(odd, plant=own_folder / "step.xml")
        data = body.data
        np.testing.assert_array_equal(data.qpos[joint_addresses(body.model, odd)[0]], odd.default_pose)
        assert data.qpos[:3].tolist() == [0.7, 0.0, 0.0]
        assert data.qpos[4:8].tolist() == [1.0, 0.0, 0.0, 0.0]
        assert data.qpos[3] == pytest.approx(odd.description.standing_height_m - 0.7, abs=1e-4)
        lowest = data.geom("FL_foot").xpos[2] - 0.023
        assert -1e-6 < -0.7 - lowest < 1e-6

    def test_a_plant_over_an_abyss_is_refused(self, go1: Robot, tmp_path: Path) -> None:
        text = go1.xml_path.read_text()
        deep = '<worldbody><geom type="plane" size="0 0 1" pos="0 0 -6"/>'
        (tmp_path / "deep.xml").write_text(text.replace("<worldbody>", deep))
        with pytest.raises(Exception, match="4 m"):
            body_of(go1, plant=tmp_path / "deep.xml")

    def test_a_push_is_in_the_worlds_axes_and_acts_on_the_base_only(self, odd: Robot) -> None:
        body = body_of(odd)
        thrown(body)
        before = body.data.qvel.copy()
        body.push((0.1, -0.2, 0.3))
        np.testing.assert_allclose((body.data.qvel - before)[:5], [0.0, 0.1, -0.2, 0.3, 0.0], atol=1e-12)
        assert not (body.data.qvel - before)[5:].any()

    def test_time_passes_in_whole_steps_that_fit(self, go1: Robot) -> None:
        body = body_of(go1)
        times = []
        for now_us in (0, 999, 1000, 3999, 3999, 4000):
            body.advance(now_us)
            times.append(body.time_us)
        assert times == [0, 0, 1000, 3000, 3000, 4000]
        assert body.data.time == pytest.approx(0.004)

    def test_the_imu_reports_every_two_milliseconds_with_the_next_count(self, go1: Robot) -> None:
        wiring = wiring_of(go1)
        wires = SimulatedWires(wiring.buses)
        body = SimulatedRobot(go1, wiring, wires)

        def received_ids(until_us: int) -> list[int]:
            """Counters of the gyro frames that arrived, which are only on the IMU's bus."""
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


def test_a_shifted_centre_of_mass_removes_no_contact(go1: Robot, tmp_path: Path) -> None:
    """Bounding volumes are relative to a body's inertial frame, which moves.

    With a box in the scene MuJoCo uses them.
    """
    shapes = '<geom type="box" size=".2 .2 .05" pos="0 0 .1"/><geom type="box" size=".1 .1 .1" pos="9 0 0"/>'
    hull = '<geom size=".01" pos=".2 0 .1" mass="0"/>'
    text = go1.xml_path.read_text().replace("<worldbody>", f"<worldbody><body>{shapes}</body>")
    text = text.replace('<freejoint name="base"/>', f'<freejoint name="base"/>{hull}')
    (tmp_path / "block.xml").write_text(text)
    rng, found = np.random.default_rng(0), 0
    nominal, shifted = (
        body_of(go1, plant=tmp_path / "block.xml", sample={"com_offset_m": np.array(offset)})
        for offset in ([0.0, 0.0, 0.0], [0.3, -0.2, 0.4])
    )
    for _ in range(50):
        position = [*rng.uniform(-0.2, 0.2, 2), rng.uniform(0.1, 0.3)]
        turn = rng.normal(size=4)
        pairs = []
        for body in (nominal, shifted):
            body.data.qpos[:7] = *position, *(turn / np.linalg.norm(turn))
            mujoco.mj_forward(body.model, body.data)
            pairs.append(sorted(map(tuple, body.data.contact.geom.tolist())))
        assert pairs[0] == pairs[1]
        trunk = body.model.body("trunk").id
        found += sum(trunk in body.model.geom_bodyid[list(pair)] for pair in pairs[0])
    assert found > 50
