"""Buses through python-can, with a fake python-can."""

import sys
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from fake_time import FakeTime

from footfall.deploy import interface_time, python_can_bus
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.python_can_bus import PythonCanBus


class FakeBus:
    """The part of python-can's bus that ours uses."""

    def __init__(self, **options: Any) -> None:
        self.options, self.shutdown = options, Mock()
        self.sent: list[Any] = []
        self.waiting: list[Any] = []

    def send(self, message: Any) -> None:
        if message.arbitration_id == REFUSED:
            raise can_error
        self.sent.append(message)

    def recv(self, timeout: float) -> Any:
        assert timeout == 0
        found = self.waiting.pop(0) if self.waiting else None
        if found == "failure":
            raise ValueError  # as for a datagram of another program
        return found


REFUSED = 3  # an identifier
can_error = type("CanError", (Exception,), {})
ALL_FRAMES: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0, "extended": False},)


def received(identifier: int, data: bytes | None, timestamp: float = 0.0, **special: bool) -> Any:
    flags = dict.fromkeys(("is_error_frame", "is_remote_frame", "is_extended_id", "is_fd"), False)
    flags = flags | {"is_rx": True} | special
    return SimpleNamespace(arbitration_id=identifier, data=data, timestamp=timestamp, **flags)


@pytest.fixture
def buses(monkeypatch: pytest.MonkeyPatch) -> list[FakeBus]:
    """The buses that python-can has opened, in order."""
    buses: list[FakeBus] = []
    can: Any = SimpleNamespace(CanError=can_error, Message=SimpleNamespace)
    can.VALID_INTERFACES = frozenset({"slcan", "virtual", "udp_multicast"})
    can.Bus = lambda **options: buses.append(FakeBus(**options)) or buses[-1]
    monkeypatch.setitem(sys.modules, "can", can)
    return buses


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeTime:
    """The clock of the buses and of the frames' times."""
    fake = FakeTime()
    monkeypatch.setattr(interface_time, "time", fake)
    monkeypatch.setattr(python_can_bus, "time", fake)
    return fake


class TestPythonCanBus:
    def test_buses_are_opened_by_name_or_by_port(self, buses: list[FakeBus]) -> None:
        filters = ({"can_id": 1, "can_mask": 2, "extended": False},)
        PythonCanBus("slcan", ("can0", "can7"), filters)
        PythonCanBus("udp_multicast", ("can0", "can7"), filters)
        assert buses[1].options == {"interface": "slcan", "channel": "can7"}
        assert [each.options.get("port") for each in buses] == [None, None, 43113, 43114]
        assert (buses[3].options["channel"], buses[3].options["fd"]) == ("239.74.163.2", False)

    def test_each_frame_goes_to_its_bus_with_its_bytes(self, buses: list[FakeBus]) -> None:
        bus = PythonCanBus("slcan", ("can0", "can1"), ())
        data, lengths = np.arange(32, dtype=np.uint8).reshape(4, 8), np.array([8, 8, 3, 8])
        identifiers = np.array([4, REFUSED, 2, REFUSED])
        assert bus.send(Frames(np.array([1, 0, 1, 1]), identifiers, data, lengths), 0) == 2
        sent = [[(m.arbitration_id, m.data) for m in each.sent] for each in buses]
        assert sent == [[], [(4, bytes(range(8))), (2, bytes([16, 17, 18]))]]
        statistics = [(s.name, s.frames_sent, s.frames_refused) for s in bus.statistics()]
        assert statistics == [("can0", 0, 1), ("can1", 2, 1)]
        bus.close()
        bus.close()
        assert [each.shutdown.call_count for each in buses] == [1, 1]

    def test_plain_frames_of_all_buses_come_in_one_batch(self, buses: list[FakeBus]) -> None:
        bus = PythonCanBus("udp_multicast", ("can0", "can1"), ALL_FRAMES)
        kinds = "is_error_frame", "is_remote_frame", "is_extended_id"
        buses[0].waiting = [
            received(5, b"\x01\x02"),
            *(received(6, b"", **{kind: True}) for kind in kinds),
            received(6, b"123456789"),
            received(6, b"echo", is_rx=False),
            received(7, b"abcdefgh"),
            "failure",
            received(6.5, b""),  # type: ignore[arg-type]
            received(6, None),
            received(8, b"late"),
        ]
        buses[1].waiting = [received(9, b"\xff")]
        (batch,) = bus.receive(0)
        assert (batch.channel.tolist(), batch.id.tolist()) == ([0, 0, 0, 1], [5, 7, 8, 9])
        assert batch.length.tolist() == [2, 8, 4, 1]
        assert [bytes(row).rstrip(b"\0") for row in batch.data] == [b"\1\2", b"abcdefgh", b"late", b"\xff"]
        assert [s.frames_received for s in bus.statistics()] == [3, 1]
        assert bus.receive(0) == []

    def test_identifiers_keep_their_length_and_pass_their_filters(self, buses: list[FakeBus]) -> None:
        """Identifiers have 29 or 11 bits."""
        accepted = (
            {"can_id": 0x0200_0000, "can_mask": 0x1F00_0000, "extended": True},
            {"can_id": 0x100, "can_mask": 0x780, "extended": False},
            {"can_id": 0x305, "can_mask": 0x7FF, "extended": False},
        )
        bus = PythonCanBus("slcan", ("can0",), accepted)
        ids = np.array([EXTENDED | 0x0112_3401, 0x101])
        bus.send(Frames(np.zeros(2, int), ids, np.zeros((2, 8), np.uint8), np.full(2, 8)), 0)
        sent = [(m.arbitration_id, m.is_extended_id) for m in buses[0].sent]
        assert sent == [(0x0112_3401, True), (0x101, False)]
        buses[0].waiting = [
            *(received(each, b"x", is_extended_id=True) for each in (0x0200_01FD, 0x0300_01FD)),
            *(received(each, b"") for each in (0x200, 0x017, 0x17F, 0x180, 0x304, 0x305, 0x101)),
        ]
        assert bus.receive(0)[0].id.tolist() == [EXTENDED | 0x0200_01FD, 0x17F, 0x305, 0x101]
        assert bus.statistics()[0].frames_received == 4

    def test_a_frame_has_its_arrivals_time(self, buses: list[FakeBus], fake: FakeTime) -> None:
        """Frames are read 2 ms later: two are 1.5 and 0.5 ms old, one is older, one has a future time."""
        bus = PythonCanBus("slcan", ("can0",), ALL_FRAMES)
        fake.ns += 2_000_000
        now_s = fake.time()
        buses[0].waiting = [received(1, b"", now_s + each) for each in (-0.0015, -0.0005, -3600.0, 3600.0)]
        (batch,) = bus.receive(10_000)
        np.testing.assert_allclose(batch.time_us, [8500, 9500, 8000, 10_000], atol=1.0)

    def test_error_frames_and_states(self, buses: list[FakeBus]) -> None:
        for identifier, data, reason in (
            (0x040, b"", "bus can1 is bus-off"),
            (0x004, b"\0\x20", "bus can1 is error-passive"),
            (0x024, b"\0\x10", "bus can1 is error-passive"),
            (0x004, b"\0\x01", "bus can1 lost frames"),
            (0x004, b"\0\x08", ""),  # a warning
            (0x004, b"", ""),
            (0x088, b"\0\0\x04", ""),  # one frame was garbled, and was sent again
            (0x020, b"\0\x30", ""),  # only byte 1 is the controller's state
        ):
            bus = PythonCanBus("slcan", ("can0", "can1"), ())
            buses[-1].waiting = [received(identifier, data, is_error_frame=True)]
            assert bus.receive(0) == []
            assert bus.fault().startswith(reason) if reason else bus.fault() == ""
            assert [each.errors for each in bus.statistics()] == [0, 1]

    @pytest.mark.usefixtures("buses")
    @pytest.mark.parametrize("reason", ["", "passive", "bus-off"])
    def test_a_state_without_error_frames_is_read_ten_times_a_second(
        self, fake: FakeTime, monkeypatch: pytest.MonkeyPatch, reason: str
    ) -> None:
        """A fault stays, so the state is not read again."""
        read_ns: list[int] = []  # times at which the state was read
        name = {"": "ACTIVE", "passive": "PASSIVE", "bus-off": "ERROR"}[reason]
        state = property(lambda _: read_ns.append(fake.ns) or SimpleNamespace(name=name))
        monkeypatch.setattr(FakeBus, "state", state, raising=False)
        bus, begun_ns = PythonCanBus("virtual", ("can0",), ()), fake.ns
        assert bus.fault() == ""
        for _ in range(36):
            fake.ns += 10_000_000
            bus.fault()
        assert [round((ns - begun_ns) / 1e8) for ns in read_ns] == ([1] if reason else [1, 2, 3])
        assert reason in bus.fault() if reason else bus.fault() == ""
