"""The page of a run, as a visitor's browser shows it."""

import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Tab, chromium, tab
from long_tests import long_test
from matplotlib.image import imread

from footfall.pages.status import WAITING
from footfall.policies.registry import ZOO
from footfall.train.config import load_preset
from footfall.train.runs.folder import Provenance, create_run

pytestmark = pytest.mark.skipif(chromium() is None, reason="needs Chromium")

WIDTH, HEIGHT = 1000, 640  # software draws each pixel
METRICS = '{{"step": {step}, "reward/total": {reward}, "episode/length_s": 2.0}}\n'


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run whose training has started."""
    made = Provenance("go1", 0, "smoke", "brax", "cpu", "unknown", "2026-01-01", {})
    folder = create_run(tmp_path / "run", made, load_preset("smoke")).folder
    lines = [METRICS.format(step=step, reward=1.0 + step / 1000) for step in range(0, 1001, 100)]
    (folder / "metrics.jsonl").write_text("".join(lines))
    return folder


@pytest.fixture
def page(run: Path, tmp_path: Path) -> Iterator[Tab]:
    """The run's page in a browser."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "footfall", "watch", run, "--port", str(port)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert str(port) in process.stdout.readline()
        with tab(tmp_path / "profile", WIDTH, HEIGHT) as opened:
            opened.go(f"http://localhost:{port}")
            yield opened
        process.terminate()


VIEW = "document.querySelector('canvas')"
PANEL = (
    "[...document.querySelectorAll('.mantine-Paper-root')]"
    ".find(each => getComputedStyle(each).position == 'fixed')"
)


def rectangle(page: Tab, element: str) -> list[int] | None:
    """Position and size of an element, px: left, top, width, height; None if it is missing."""
    sides = "['left', 'top', 'width', 'height'].map(side => Math.round(box[side]))"
    return page.value(f"(box => box && {sides})({element}?.getBoundingClientRect())")


def middle(page: Tab, path: Path) -> np.ndarray:
    """Pixels around the middle of the page, (h, w, 3), 0 to 1."""
    page.picture(path)
    seen = imread(path)[..., :3]
    height, width = seen.shape[:2]
    return seen[height // 4 : -height // 8, width // 3 : -width // 3]


def share_of_dark(seen: np.ndarray) -> float:
    """Share of dark pixels: the robot's feet and calves are dark, ground and sky are not."""
    return float((seen.max(axis=-1) < 0.25).mean())


@long_test
def test_it_waits_and_then_shows_the_policy_walking(page: Tab, run: Path, tmp_path: Path) -> None:
    page.wait_for(lambda page: WAITING.strip("*") in page.text)
    page.wait_for(lambda page: "1,000 of 4,096 steps (24%)" in page.text)
    page.wait_for(lambda page: "Reward per second" in page.text)
    assert "Push it" not in page.text
    assert page.value("document.title") == "footfall"
    page.wait_for(lambda page: share_of_dark(middle(page, tmp_path / "standing.png")) > 0.003)

    shutil.copy(ZOO / "go1-flat" / "policy.onnx", run)
    page.wait_for(lambda page: "walking" in page.text)
    for words in ("real time", "Push it", "Start again", "Forward, m/s", "0 in 1 starts"):
        assert words in page.text
    page.wait_for(lambda page: share_of_dark(middle(page, tmp_path / "before.png")) > 0.003)
    before = middle(page, tmp_path / "before.png")
    assert before.std() > 0.05

    with (run / "metrics.jsonl").open("a") as metrics:
        metrics.write(METRICS.format(step=2048, reward=3.0))
    page.wait_for(lambda page: "2,048 of 4,096 steps (50%)" in page.text)
    page.wait_for(lambda page: np.abs(middle(page, tmp_path / "after.png") - before).max() > 0.3)  # it moves

    page.value("[...document.querySelectorAll('button')].find(b => b.innerText == 'Start again').click()")
    page.wait_for(lambda page: "0 in 2 starts" in page.text)

    # On a telephone the robot is seen above the panel.
    page.ask("Emulation.setDeviceMetricsOverride", width=420, height=800, deviceScaleFactor=1, mobile=True)
    page.wait_for(lambda page: rectangle(page, VIEW) == [0, 0, 420, 440], limit_s=30.0)
    assert rectangle(page, PANEL) == [0, 440, 420, 360]

    assert page.complaints == []
    elsewhere = [address for address in page.requested if "//localhost" not in address[:25]]
    assert [address for address in elsewhere if not address.startswith("data:")] == []
