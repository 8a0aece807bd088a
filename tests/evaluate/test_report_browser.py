"""The report's page as browsers show it: on a telephone and a wide screen, in the dark, and on paper."""

from collections.abc import Iterator

import pytest
from browser import Tab, chromium, tab
from report_pages import page_of, result, walked

from footfall.robots.description import Robot

pytestmark = pytest.mark.skipif(chromium() is None, reason="needs Chromium")

LUMINANCE = (
    "getComputedStyle({}).backgroundColor.match(/\\d+/g).slice(0, 3).reduce((a, b) => a + +b, 0) / 765"
)


@pytest.fixture(scope="module")
def page(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """A report of two policies, one of them with a long name."""
    folder = tmp_path_factory.mktemp("report")
    file = folder / "report.html"
    long = "/home/someone/runs/2026-11-23_go1_no-height-scan_and-more-than-90-letters_seed-7/policy.onnx"
    good = result("mine", "runs/mine", 0.1, 0, 2.0, walked())
    bad = result(long, long, 0.3, 9, 1.0, walked(5.0, fell=True))
    file.write_text(page_of(go1, good, bad), encoding="utf-8")
    with tab(folder / "profile") as opened:
        opened.go(file.as_uri())
        opened.wait_for(lambda page: page.value("document.readyState") == "complete")
        yield opened


def shown(page: Tab, width: int, media: str = "screen", colours: str = "light") -> None:
    """The page on a screen or paper of this width, px."""
    page.ask("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
    scheme = {"name": "prefers-color-scheme", "value": colours}
    page.ask("Emulation.setEmulatedMedia", media=media, features=[scheme])


def test_the_page_is_dark_on_request_and_not_too_wide(page: Tab) -> None:
    """Paper is never dark."""
    on_screens = [(width, "screen", colours) for width in (420, 1400) for colours in ("light", "dark")]
    for width, media, colours in (*on_screens, (760, "print", "dark")):
        shown(page, width, media, colours)
        assert page.value("[innerWidth, document.documentElement.scrollWidth]") == [width, width]
        dark = media == "screen" and colours == "dark"
        for element in ("document.body", "document.querySelector('header')"):
            luminance = page.value(LUMINANCE.format(element))
            assert luminance < 0.2 if dark else luminance > 0.9


def test_the_page_is_short_and_a_link_to_a_folded_part_opens_it(page: Tab) -> None:
    for width, screens in ((1280, 6), (420, 9)):
        shown(page, width)
        assert page.value("document.documentElement.scrollHeight") < 900 * screens
    identity = page.value("document.querySelector('details.plot:not([open])').id")
    page.value(f"document.querySelector('nav a[href=\"#{identity}\"]').click()")
    assert page.value(f"document.getElementById('{identity}').open")
    page.value(f"document.getElementById('{identity}').open = false")


def test_all_that_can_be_unfolded_is_open_on_paper_and_closed_again_after_it(page: Tab) -> None:
    shown(page, 1400)
    folded = "[...document.querySelectorAll('details')].filter(each => !each.open).length"
    before = page.value(folded)
    assert before > 0
    page.value(f"addEventListener('beforeprint', () => {{ window.foldedInPrint = {folded} }})")
    page.ask("Page.printToPDF")
    assert page.value("window.foldedInPrint") == 0
    assert page.value(folded) == before
    assert page.errors == []
