"""Linux's CAN interfaces: bytes sent to the kernel and received from it."""

import errno
import socket
import struct
import time
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.deploy import socketcan_bus
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.interfaces import open_interfaces
from footfall.deploy.socketcan_bus import SocketCanBus

FILTERS: tuple[CanFilter, ...] = (
    {"can_id": 0x100, "can_mask": 0x780, "extended": False},
    {"can_id": 0x0200_0000, "can_mask": 0x1F00_0000, "extended": True},
)


def can_frame(identifier: int, data: bytes, length: int | None = None) -> bytes:
    """<linux/can.h>: struct can_frame in this machine's byte order."""
    return struct.pack("=IB3x8s", identifier, len(data) if length is None else length, data)


def batch(*rows: tuple[int, int, bytes]) -> Frames:
    """Frames of (channel, identifier, data)."""
    channels, identifiers, contents = zip(*rows, strict=True)
    data = np.array([list(content.ljust(8, b"\0")) for content in contents], np.uint8)
    return Frames(np.array(channels), np.array(identifiers), data, np.array([*map(len, contents)]))


Ends = dict[str, socket.socket]


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Ends:
    """The other ends of the sockets: datagrams with time stamps, as CAN's raw sockets have them."""
    ends: Ends = {}

    def open_socket(name: str, _: Any) -> socket.socket:
        near, ends[name] = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        near.setsockopt(socket.SOL_SOCKET, socketcan_bus.SO_TIMESTAMPNS, 1)
        near.setblocking(False)
        return near

    monkeypatch.setattr(socketcan_bus, "open_socket", open_socket)
    return ends


class TestFrames:
    def test_each_frame_is_sent_to_its_interface(self, ends: Ends) -> None:
        bus = SocketCanBus(("a", "b"), FILTERS)
        sent = batch((1, 0x7FF, b"12345678"), (0, 5, b"abc"), (1, EXTENDED | 0x1234567, b""))
        assert bus.send(sent, 0) == 0
        assert ends["a"].recv(100) == can_frame(5, b"abc")
        assert ends["b"].recv(100) == can_frame(0x7FF, b"12345678")
        assert ends["b"].recv(100) == can_frame(0x8000_0000 | 0x1234567, b"")
        assert [(each.name, each.frames_sent) for each in bus.statistics()] == [("a", 1), ("b", 2)]

    def test_waiting_frames_of_all_interfaces_come_in_one_batch(self, ends: Ends) -> None:
        """Bytes beyond a frame's length are not data."""
        bus = SocketCanBus(("a", "b", "c"), FILTERS)
        assert bus.receive(0) == []
        ends["c"].send(can_frame(0x101, b"12345678"))
        ends["a"].send(can_frame(0x102, b"xyrubbis", length=2))
        ends["a"].send(can_frame(0x8200_01FD, b"abcdefgh"))
        (got,) = bus.receive(0)
        assert (got.channel.tolist(), got.length.tolist()) == ([0, 0, 2], [2, 8, 8])
        assert got.id.tolist() == [0x102, EXTENDED | 0x0200_01FD, 0x101]
        assert [row.tobytes() for row in got.data] == [b"xy\0\0\0\0\0\0", b"abcdefgh", b"12345678"]
        assert [each.frames_received for each in bus.statistics()] == [2, 0, 1]
        assert bus.receive(0) == []

    def test_a_frame_has_the_time_at_which_the_kernel_got_it(self, ends: Ends) -> None:
        bus = SocketCanBus(("a",), FILTERS)
        ends["a"].send(can_frame(0x101, b""))
        time.sleep(0.02)
        ends["a"].send(can_frame(0x101, b""))
        (got,) = bus.receive(50_000)
        early, late = got.time_us.tolist()
        assert early + 20_000 <= late <= 50_000


class TestFaults:
    def test_error_frames_set_the_fault_and_are_no_readings(self, ends: Ends) -> None:
        bus = SocketCanBus(("a", "b"), FILTERS)
        ends["b"].send(can_frame(0x2000_0000 | 0x088, b"\0\0\x04\0\0\0\0\0"))  # one was sent again
        assert (bus.receive(0), bus.fault()) == ([], "")
        ends["b"].send(can_frame(0x101, b"reading"))
        ends["b"].send(can_frame(0x2000_0000 | 0x040, bytes(8)))
        (got,) = bus.receive(0)
        ends["b"].send(can_frame(0x2000_0000 | 0x088, bytes(8)))  # an empty one changes nothing
        fault = bus.fault()
        assert (got.id.tolist(), bus.receive(0), bus.fault()) == ([0x101], [], fault)
        assert fault.startswith("bus b is bus-off")
        assert [(each.errors, each.frames_received) for each in bus.statistics()] == [(0, 0), (3, 1)]

    @pytest.mark.usefixtures("ends")
    def test_a_frame_that_is_refused_is_counted_and_an_interface_that_is_down_is_named(self) -> None:
        for number, down in ((errno.ENETDOWN, True), (errno.ENODEV, True), (errno.ENOBUFS, False)):
            bus = SocketCanBus(("a", "b"), FILTERS)
            failing = Mock(side_effect=OSError(number, "no"))
            bus._sockets[1].close()
            bus._sockets[1] = Mock(send=failing, recvmsg=failing)
            assert bus.receive(0) == []
            assert bus.fault().startswith("bus b is down: ") if down else bus.fault() == ""
            assert bus.send(batch((1, 1, b""), (0, 1, b""), (1, 2, b"")), 0) == 2
            assert [(each.frames_sent, each.frames_refused) for each in bus.statistics()] == [(1, 0), (0, 2)]


class TestOpening:
    @pytest.fixture
    def opening(self, monkeypatch: pytest.MonkeyPatch) -> Mock:
        """Opens sockets that record what is called."""
        opening = Mock()
        monkeypatch.setattr(socket, "socket", opening)
        return opening

    def test_the_kernel_filters_and_stamps(self, opening: Mock) -> None:
        """Masks include the bits of 29-bit identifiers and remote frames: none passes for another kind."""
        SocketCanBus(("can3",), FILTERS)
        opening.assert_called_once_with(29, 3, 1)  # AF_CAN, SOCK_RAW, CAN_RAW
        opened = opening.return_value
        opened.bind.assert_called_once_with(("can3",))
        opened.setblocking.assert_called_once_with(False)
        assert [each.args for each in opened.setsockopt.call_args_list] == [
            (101, 1, struct.pack("=4I", 0x100, 0xC000_0780, 0x8200_0000, 0xDF00_0000)),  # CAN_RAW_FILTER
            (101, 2, 0x1FFF_FFFF),  # every class of error frame
            (socket.SOL_SOCKET, 35, 1),
        ]

    def test_a_failure_closes_all(self, opening: Mock, monkeypatch: pytest.MonkeyPatch) -> None:
        """The message names the interface, even on a system without CAN."""
        opening.side_effect = first, second = Mock(), Mock()
        second.bind.side_effect = OSError(errno.ENODEV, "No such device")
        with pytest.raises(UserError, match="'broken'"):
            SocketCanBus(("can0", "broken"), FILTERS)
        assert (first.close.called, second.close.called) == (True, True)
        monkeypatch.delattr(socket, "AF_CAN")
        with pytest.raises(UserError, match=r"'can0'.*AF_CAN"):
            SocketCanBus(("can0",), FILTERS)

    @pytest.mark.usefixtures("opening")
    def test_interfaces_are_opened_by_their_kind(self) -> None:
        assert isinstance(open_interfaces("socketcan", ("can0",), FILTERS), SocketCanBus)
        with pytest.raises(UserError, match=r"'morse'.*canalystii, "):
            open_interfaces("morse", ("can0",), FILTERS)
        with pytest.raises(UserError, match="--bus"):  # that is a bus
            open_interfaces("can0", ("can0",), FILTERS)


def has_vcan() -> bool:
    try:
        socketcan_bus.open_socket("can0", ()).close()
    except (OSError, AttributeError):
        return False
    return True


@pytest.mark.skipif(not has_vcan(), reason="there is no interface can0, as by: ip link add can0 type vcan")
class TestKernel:
    def test_frames_reach_the_host_and_the_kernel_drops_foreign_frames(self) -> None:
        host, robot = SocketCanBus(("can0",), FILTERS), SocketCanBus(("can0",), FILTERS)
        robot.send(batch((0, 0x101, b"plain"), (0, 0x181, b"foreign"), (0, EXTENDED | 0x101, b"foreign"),
                         (0, EXTENDED | 0x0200_0001, b"extended"), (0, 0x17F, b"")), 0)  # fmt: skip
        (got,) = host.receive(0)
        assert got.id.tolist() == [0x101, EXTENDED | 0x0200_0001, 0x17F]
        assert [row.tobytes() for row in got.data] == [b"plain\0\0\0", b"extended", bytes(8)]
        assert robot.receive(0) == []  # a socket does not receive its own frames
        host.close()
        robot.close()
