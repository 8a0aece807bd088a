"""Comparisons made by hand, and the page that the report makes of them."""

from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
from traces import walk

from footfall import EvaluationConfig, Robot, Trace, load_robot
from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.report.films import Film
from footfall.evaluate.report.page import render
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.statistics import wilson_interval
from footfall.evaluate.suite import CourseWalk

FILE = load_scenarios(load_robot("go1"))
(COURSE,) = plan_episodes("course", FILE.scenarios["course"], 0, 1)
FILM = Film(b"film", b"poster")


def summary(error: float, falls: int, episodes: int = 24, **more: Any) -> dict[str, Any]:
    return {
        "episodes": episodes, "failed_episodes": [], "notes": [],
        "falls": falls, "fall_rate": falls / episodes,
        "fall_rate_interval": list(wilson_interval(falls, episodes)),
        "lin_vel_rmse": error, "lin_vel_rmse_interval": [0.9 * error, 1.1 * error],
        "troubles": {"the base touched the ground": falls} if falls else {},
        **more,
    }  # fmt: skip


def pushed(dv50: float, falls: int) -> dict[str, Any]:
    rows = [
        {"push_m_s": push, "episodes": 8, "falls": fell, "fall_rate_interval": list(wilson_interval(fell, 8))}
        for push, fell in ((1.0, 0), (2.0, 3), (3.0, 8))
    ]
    half = {"dv50": dv50, "dv50_interval": [dv50 - 0.1, dv50 + 0.1], "dv50_width": 0.2, "strongest_push": 3.0}
    return summary(0.5, falls, rows=rows, **half)


def walked(seconds: float = 12.0, fell: bool = False) -> Trace:
    """The course walked exactly, feet of a trot at 2 Hz; it may end in a fall."""
    trace = walk(seconds)
    command = np.array([COURSE.schedule(time) for time in trace.time_s])
    first_pair = (trace.time_s * 2.0) % 1.0 < 0.5
    contact = np.stack([first_pair, ~first_pair, ~first_pair, first_pair], axis=1)
    moving = {"base_velocity": command * [1, 1, 0], "base_angular_velocity": command * [0, 0, 1]}
    return replace(trace, command=command, foot_contact=contact, fell=fell, **moving)


def result(name: str, spec: str, error: float, falls: int, dv50: float, trace: Trace | None) -> PolicyResult:
    scenarios = {"nominal": summary(error, falls), "push": pushed(dv50, 11)}
    compute = {"compute_ms": {"p50": 0.21, "p99": 0.4}}
    course = CourseWalk(COURSE, trace, compute, "" if trace else "its process died")
    return PolicyResult(name, spec, "made by hand", 20.0, {"scenarios": scenarios}, course)


def comparison(go1: Robot, *results: PolicyResult) -> Comparison:
    config = EvaluationConfig("go1", ("nominal", "push"), seed=3, episodes=24)
    return Comparison(go1, config, FILE, results, {"footfall": "1.2.3", "mujoco": "3.1"})


def page_of(go1: Robot, *results: PolicyResult) -> str:
    film, none = TaskResult(FILM), TaskResult(None, "no light")
    films = {each.name: film if each.course.trace else none for each in results}
    return render(comparison(go1, *results), films)


class Page(HTMLParser):
    """References and texts of a page; checks that its elements close."""

    VOID = frozenset({"meta", "link", "br", "img", "hr", "input", "source"})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.identities: list[str] = []
        self.words = ""
        self._open: list[str] = []
        self.feed(text)
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self._open.append(tag)
        references = {"src", "href", "poster", "xlink:href"}
        self.references += [value or "" for name, value in attrs if name in references]
        self.identities += [value or "" for name, value in attrs if name == "id"]

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "script" not in self._open and "style" not in self._open:
            self.words += " " + " ".join(data.split())
