"""IMUs of footfall's own protocol and of makers: frames to the bit, damaged, repeated and old samples."""

import os
import time
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from changed_robots import described
from refused import refusal_of
from some_motors import frame

from footfall import Robot
from footfall.deploy.bus import BusStatistics
from footfall.deploy.drivers import imu as own_imu
from footfall.deploy.drivers import vectornav, xbus
from footfall.deploy.drivers.choice import open_imu
from footfall.deploy.drivers.imu import ImuReader, Inertial
from footfall.deploy.drivers.serial_imu import Sample, SerialImu, to_frames
from footfall.deploy.drivers.vectornav import VectorNavImu
from footfall.deploy.drivers.xbus import XbusImu
from footfall.deploy.drivers.xsens_can import IDS, XsensCanImu
from footfall.deploy.frames import Frames, joined
from footfall.deploy.serial_line import SerialLine, WithSerialLine, port_of
from footfall.deploy.wiring import wiring_of
from footfall.plant.imu_ends import open_imu_end
from footfall.robots.checks import inconsistencies

PORT = "serial:/dev/ttyUSB0"
BUS_OF = {"vectornav": PORT, "xsens": PORT, "xsens-can": "can0"}
TILTED = Inertial((0.1, -0.25, 2.5), (1.5, -2.25, 9.75), (0.8, 0.0, 0.6, 0.0))

# Movella, "MT low level communication protocol example": counter 57285, no quaternion.
OF_MOVELLA = bytes.fromhex(
    "FA FF 36 31 10 20 02 DF C5 10 60 04 00 45 9D A0 40 20 0C BE DC 9A FA 3F 54 9F 37 41 1C BB 70"
    "80 20 0C BB AA 5C 80 3B 8C 55 01 BB 81 33 00 E0 20 04 00 00 00 81 45"
)
# VectorNav UM001, 4.3.7, example case 1: yaw, pitch and roll. (Case 2 has a misprint in its header.)
OF_VECTORNAV = bytes.fromhex("FA 01 08 00 93 50 2E 42 83 3E F1 3F 48 B5 04 BB 92 88")


def own_frames(counter: int, gyro: float = 0.1, arrived_us: np.ndarray | None = None) -> Frames:
    """A reading of footfall's own IMU on bus 1."""
    data = own_imu.encode(Inertial([gyro, 0.2, 0.3], [1.0, 2.0, 9.0], [0.8, 0.0, 0.6, 0.0]), counter).copy()
    return Frames(np.full(3, 1), np.array(own_imu.IDS), data, np.full(3, 8), arrived_us)


class TestOwn:
    @pytest.mark.parametrize("row_groups", [[[0, 1, 2]], [[0], [1], [2]]], ids=["at once", "one by one"])
    def test_each_part_must_be_renewed_by_complete_frames(self, row_groups: list[list[int]]) -> None:
        for part, columns, content, length in (
            (0, slice(6, 8), [0, 1], 8),  # the counter stays
            (1, slice(6, 8), [0, 1], 8),
            (2, slice(8), 0, 8),
            (2, 0, 0, 8),  # too short to be a rotation
            (2, 2, 0x7F, 8),  # too long
            (0, slice(0), 0, 7),
            (1, slice(0), 0, 2),
            (2, slice(0), 0, 1),
        ):
            reader = ImuReader(channel=1)
            reader.absorb(own_frames(1), 1000)
            before = reader.reading
            for counter in (2, 3):
                batch = own_frames(counter)
                batch.data[part, columns], batch.length[part] = content, length
                for rows in row_groups:
                    reader.absorb(batch.take(np.array(rows)), 1000 * counter)
            assert (reader.arrived_us, reader.oldest) == (1000, Inertial._fields[part])
            assert reader.reading.quaternion == before.quaternion

    def test_the_frames_of_a_reading_to_the_bit(self) -> None:
        """1.5 rad/s are 1500 = 0x05dc units, -1 m/s^2 is -200 = 0xff38, 0.6 is 19660 = 0x4ccc of 32767."""
        reading = Inertial([1.5, -0.001, 0.002], [-1.0, 0.005, 10.0], [0.0, 0.6, -0.8, 1.0])
        assert own_imu.IDS == (0x300, 0x301, 0x302)
        rows = [row.tobytes() for row in own_imu.encode(reading, 0x1234)]
        hexed = [row.hex(" ", 2) for row in rows]
        assert hexed == ["05dc ffff 0002 1234", "ff38 0001 07d0 1234", "0000 4ccc 999a 7fff"]
        assert own_imu.decode_gyro(rows[0]) == (pytest.approx(reading.gyro), 0x1234)
        assert own_imu.decode_acceleration(rows[1]) == pytest.approx(reading.acceleration)
        for row in own_imu.encode(Inertial([0.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]), 0x3FFFF)[:2]:
            assert row.tobytes().hex(" ", 2) == "0000 0000 0000 ffff"
        beyond = own_imu.encode(Inertial([99.0, -99.0, 0.0], [999.0, -999.0, 0.0], [2.0, -2.0, 0.0, 0.0]), 0)
        assert [row.tobytes().hex(" ", 2)[:9] for row in beyond] == ["7fff 8000"] * 3

    def test_a_higher_counter_is_a_new_reading_and_an_older_or_far_off_one_is_ignored(self) -> None:
        for counters, last in (
            *(((0xFFFE, 0xFFFF, 0x10000), 2), ((0xFFFF, 0), 1), ((7, 30), 1), ((0,), 0)),
            *(((7, 9, 8), 1), ((7, 8, 0x4008), 1), ((0, 1, 0xFFFF), 1)),
        ):
            reader = ImuReader(channel=1)
            for k, counter in enumerate(counters):
                reader.absorb(own_frames(counter, gyro=0.1 * k), 1000 * k)
                assert reader.arrived_us == 1000 * min(k, last)
            assert reader.reading.gyro[0] == pytest.approx(0.1 * last)

    @pytest.mark.parametrize("before", [1, 2, 3])
    def test_a_part_has_the_time_of_its_frames_arrival(self, before: int) -> None:
        """A queued frame is older than its counter suggests."""
        reader = ImuReader(channel=1)
        for counter in range(before):
            reader.absorb(own_frames(counter), 1000 * counter)
        reader.absorb(own_frames(before, arrived_us=np.array([40_700, 40_500, 40_600])), 90_000)
        assert (reader.arrived_us, reader.oldest) == (40_500, "acceleration")


class TestDocumented:
    def test_the_example_message_of_movella_is_read_with_and_without_a_quaternion(self) -> None:
        assert XbusImu.length_of(OF_MOVELLA) == len(OF_MOVELLA)
        assert XbusImu.is_intact(OF_MOVELLA)
        assert XbusImu.decode(OF_MOVELLA) is None  # it holds no quaternion
        body = OF_MOVELLA[4:-1] + bytes.fromhex("2010103F7F7DC4BC10107D3BA15770BD7EC656")
        message = bytes((0xFA, 0xFF, 0x36, len(body))) + body
        counter, reading = XbusImu.decode(message + bytes((-sum(message[1:]) % 256,)))
        assert counter == 57285
        assert reading.acceleration == pytest.approx((-0.43087, 0.83055, 9.79576), abs=1e-5)
        assert reading.gyro == pytest.approx((-0.0051990, 0.0042826, -0.0039428), abs=1e-7)
        quaternion = (0.99801278, -0.00879299, 0.00492375, -0.06220087)
        assert reading.quaternion == pytest.approx(quaternion, abs=1e-8)

    def test_a_message_of_a_vectornav_is_checked_and_read(self) -> None:
        """The IMU is at rest, nose up by 0.2 rad; its own axes are x forward, z down."""
        assert VectorNavImu.is_intact(OF_VECTORNAV)
        assert not VectorNavImu.is_intact(OF_VECTORNAV[:-1] + b"\x89")
        assert VectorNavImu.length_of(OF_VECTORNAV) == 0  # another message than the driver's
        half = 0.1
        own = np.array([0.0, np.sin(half), 0.0, np.cos(half)], "<f4").tobytes()  # x y z w, pitch up
        own += np.array([0.0, 0.3, 0.0, 9.81 * np.sin(0.2), 0.0, -9.81 * np.cos(0.2)], "<f4").tobytes()
        head = vectornav.HEADER + (5_000_000).to_bytes(8, "little") + own
        counter, reading = VectorNavImu.decode(head + vectornav.checksum(head[1:]).to_bytes(2, "big"))
        assert counter == 5
        assert reading.gyro == pytest.approx((0.0, -0.3, 0.0), abs=1e-6)
        assert reading.acceleration == pytest.approx((9.81 * np.sin(0.2), 0.0, 9.81 * np.cos(0.2)), abs=1e-5)
        assert reading.quaternion == pytest.approx((np.cos(half), 0.0, -np.sin(half), 0.0), abs=1e-6)

    def test_frames_of_an_mti_on_can_are_read_by_the_documents_units(self) -> None:
        imu = XsensCanImu(0)
        turned = (0x006, "1234"), (0x021, "7642 0000 0000 30FC")  # yaw 45 degrees
        rows = *turned, (0x032, "0033 FF80 0500"), (0x034, "0180 FDC0 09CF")
        imu.absorb(joined([frame(*row) for row in rows]), 7000)
        assert imu.arrived_us == 7000
        assert imu.reading.gyro == pytest.approx((51 / 512, -0.25, 2.5))
        assert imu.reading.acceleration == pytest.approx((1.5, -2.25, 9.80859375))
        assert imu.reading.quaternion == pytest.approx((0.92388, 0.0, 0.0, 0.38268), abs=1e-4)


@pytest.mark.parametrize("protocol", BUS_OF)
class TestEveryMaker:
    def test_repeated_samples_age_and_older_samples_are_ignored(self, go1: Robot, protocol: str) -> None:
        wiring = wiring_of(described(go1, imu_protocol=protocol, imu_bus=BUS_OF[protocol]))
        imu, end = open_imu(wiring), open_imu_end(wiring)
        first, second = end.encode(TILTED), end.encode(TILTED._replace(gyro=(0.0, 0.0, 0.0)))
        imu.absorb(first, 5000)
        for part, sent in zip(imu.reading, TILTED, strict=True):
            np.testing.assert_allclose(part, sent, atol=2e-3)
        assert imu.arrived_us == 5000
        for later, frames in enumerate((second, second, first)):
            imu.absorb(frames, 6000 + 1000 * later)
        assert (imu.arrived_us, imu.older) == (6000, 1)  # type: ignore[attr-defined]
        np.testing.assert_allclose(imu.reading.gyro, 0.0)

    def test_an_imu_is_refused_on_the_wrong_kind_of_bus(self, go1: Robot, protocol: str) -> None:
        other = "can0" if BUS_OF[protocol] == PORT else PORT
        wrong = described(go1, imu_protocol=protocol, imu_bus=other)
        assert "imu_bus" in refusal_of(open_imu, wiring_of(wrong))


@pytest.mark.parametrize(("driver", "encode"), [(XbusImu, xbus.encode), (VectorNavImu, vectornav.encode)])
def test_a_message_after_a_damaged_or_half_a_message_is_decoded(driver: type, encode) -> None:  # type: ignore[no-untyped-def]
    """The whole message begins within the length of the first."""
    damaged = bytearray(encode(Sample(1, TILTED._replace(gyro=(9.0, 9.0, 9.0)))))
    damaged[30] ^= 4
    for before in (b"noise" + damaged, damaged[:20]):
        imu: SerialImu = driver(0)
        imu.absorb(to_frames(0, before + encode(Sample(2, TILTED))), 3000)
        assert imu.reading.gyro == pytest.approx(TILTED.gyro, abs=1e-6)
        assert (imu.damaged >= 1, imu.arrived_us) == (True, 3000)


def test_bytes_of_a_port_reach_the_driver_beside_can() -> None:
    far, near = os.openpty()
    can = Mock(**{"send.return_value": 0, "receive.return_value": [], "fault.return_value": ""})
    can.statistics.return_value = [BusStatistics("can0"), BusStatistics("can1")]
    bus = WithSerialLine(can, SerialLine(f"serial:{os.ttyname(near)}@115200", 1), 1)
    try:
        os.write(far, xbus.encode(Sample(1, TILTED)))
        imu, deadline = XbusImu(1), time.monotonic() + 20.0
        while imu.arrived_us is None and time.monotonic() < deadline:
            for frames in bus.receive(4000):
                imu.absorb(frames, 4000)
        assert imu.arrived_us == 4000
        channels, data = np.array([0, 1, 2]), np.zeros((3, 8), np.uint8)
        bus.send(Frames(channels, np.array(IDS[:3]), data, np.full(3, 8)), 4000)
        assert can.send.call_args.args[0].channel.tolist() == [0, 1]
        assert [each.name[:6] for each in bus.statistics()] == ["can0", "serial", "can1"]
        os.close(far)
        assert bus.receive(5000) == []
        assert "serial" in bus.fault()
    finally:
        bus.close()
        os.close(near)


def test_a_missing_port_a_wrong_name_and_motors_on_a_port_are_refused(go1: Robot) -> None:
    assert "no_such_port" in refusal_of(SerialLine, "serial:/dev/no_such_port", 0)
    for name in ("serial:", "serial:/dev/ttyS0@fast"):
        assert "serial:" in refusal_of(port_of, name)
    joints = (replace(go1.description.joints[0], bus=PORT), *go1.description.joints[1:])
    assert any(PORT in each for each in inconsistencies(replace(go1.description, joints=joints)))
