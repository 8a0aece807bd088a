"""The built site in a browser: no request to another server; the fault table sorts and filters."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import Tab, chromium, tab

ROOT = Path(__file__).parents[2]
SITE = ROOT / "build" / "site"
SHOWN = "[...document.querySelectorAll('#faults tbody tr')].filter(row => !row.hidden)"
INPUT = "document.querySelector('#faults input')"

pytestmark = [
    pytest.mark.skipif(chromium() is None, reason="no Chromium: apt-get install chromium"),
    pytest.mark.skipif(not SITE.is_dir(), reason="no site: make docs"),
]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    pytest.importorskip("websockets")
    with tab(tmp_path_factory.mktemp("profile")) as opened:
        opened.go((SITE / "faults.html").as_uri())
        opened.wait_for(lambda page: bool(page.value("!!document.querySelector('#faults output')")))
        yield opened


def search(page: Tab, words: str) -> None:
    page.value(f"{INPUT}.value = '{words}'; {INPUT}.dispatchEvent(new Event('input'))")


def cells(page: Tab, column: int) -> list[str]:
    return page.value(f"{SHOWN}.map(row => row.cells[{column}].textContent)")


def test_pages_load_no_other_server(page: Tab) -> None:
    local = ("file:", "data:", "blob:")
    assert page.errors == []
    assert [address for address in page.requested if not address.startswith(local)] == []


def test_every_row_of_the_data_is_shown_and_search_words_filter_rows(page: Tab) -> None:
    search(page, "")
    rows = json.loads((ROOT / "docs/faults.json").read_text())["rows"]
    assert cells(page, 2) == [row["fault"] for row in rows]
    search(page, "gyro mpc")
    assert set(cells(page, 0)) == {"mpc"}
    assert all("gyro" in fault for fault in cells(page, 2))


def test_a_click_on_a_heading_sorts_by_number(page: Tab) -> None:
    search(page, "go1-flat")
    longest = 6
    for reverse in (False, True):
        page.value(f"document.querySelectorAll('#faults th')[{longest}].click()")
        times = [int(text) for text in cells(page, longest) if text.isdigit()]
        assert times == sorted(times, reverse=reverse)
