"""Height scans by UDP: accepted from holders of the token and if newer; their age counts."""

import math
import socket
import time

import numpy as np
import pytest
from fake_time import Watch

from footfall.common.errors import UserError
from footfall.operate.height_scan_udp import UdpScans, scans_by_udp
from footfall.operate.udp import MAX_SENDERS
from footfall.operate.udp_client import SCAN, UdpHeightScan, pack

TOKEN = "a token of the tests, shared"
CONTENT = {"sender": "s", "number": 7, "age_s": 0.1, "heights": [-0.3, None, 0.1]}


def test_a_scans_age_counts_from_its_measurement() -> None:
    watch = Watch()
    scans = UdpScans(TOKEN, watch)
    assert scans.newest(0) is None
    assert scans.receive(pack(CONTENT, TOKEN, SCAN)) == ""
    watch.now_s += 0.25
    found = scans.newest(2_000_000)
    assert found is not None
    assert found.taken_us == pytest.approx(2_000_000 - 350_000, abs=1)
    np.testing.assert_array_equal(found.heights, [-0.3, math.nan, 0.1])


@pytest.mark.parametrize(
    "wrong",
    [
        {"number": 6},
        {"number": None},
        {"sender": 3},
        {"age_s": -1.0},
        {"age_s": "old"},
        {"age_s": math.nan},
        {"heights": "flat"},
        {"heights": [0.1, "x"]},
        {"heights": [True]},
        {"heights": [10**400]},
    ],
)
def test_a_wrong_or_old_scan_is_refused(wrong: dict[str, object]) -> None:
    scans = UdpScans(TOKEN, Watch())
    assert scans.receive(pack(CONTENT, TOKEN, SCAN)) == ""
    assert scans.receive(pack(CONTENT | {"number": 8, "heights": [9.0]} | wrong, TOKEN, SCAN)) != ""
    found = scans.newest(0)
    assert found is not None
    assert len(found.heights) == 3


def test_a_mapping_program_may_restart_any_number_of_times() -> None:
    """A second sender that keeps sending is remembered all the time: its old datagrams stay refused."""
    scans = UdpScans(TOKEN, Watch())
    steady = pack(CONTENT | {"sender": "steady", "number": 0}, TOKEN, SCAN)
    assert scans.receive(steady) == ""
    for restart in range(2 * MAX_SENDERS):
        assert scans.receive(pack(CONTENT | {"sender": f"{restart}", "number": 1}, TOKEN, SCAN)) == ""
        assert scans.receive(pack(CONTENT | {"sender": "steady", "number": restart + 1}, TOKEN, SCAN)) == ""
    assert scans.receive(steady) != ""
    assert len(scans._last_numbers) == MAX_SENDERS


def test_scans_arrive_over_a_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TOKEN", TOKEN)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    with scans_by_udp(f"127.0.0.1:{port}") as scans, UdpHeightScan("127.0.0.1", TOKEN, port) as sender:
        deadline_s = time.monotonic() + 20.0
        while scans.newest(0) is None and time.monotonic() < deadline_s:
            sender.send([-0.31, math.nan], age_s=0.02)
            time.sleep(0.02)
    found = scans.newest(0)
    assert found is not None
    np.testing.assert_array_equal(found.heights, [-0.31, math.nan])


def test_without_a_secret_nothing_is_received(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TOKEN", "short")
    with pytest.raises(UserError, match="FOOTFALL_TOKEN"), scans_by_udp():
        pass
    monkeypatch.setenv("FOOTFALL_TOKEN", TOKEN)
    with pytest.raises(UserError, match=r"9871.*nowhere"), scans_by_udp("nowhere"):  # the scans' port
        pass
