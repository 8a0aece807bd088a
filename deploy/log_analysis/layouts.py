"""Layouts for viewers of logs: the robot in 3-D, plots by joint name, events."""

import json
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

QUANTITIES = {"position": "rad", "velocity": "rad/s", "effort": "N m"}  # fields of a JointState
COLOURS = ("#2380c2", "#e06000", "#009e73", "#cc79a7", "#b8860b", "#56b4e9")
CAMERA_M = 2.5  # from the base: legged robots from 0.3 to 1.3 m fill the panel


def foxglove_layout(joints: Sequence[str]) -> str:
    """A layout for Foxglove and Lichtblick, as JSON."""
    panels: dict[str, dict[str, Any]] = {
        "3D!robot": _foxglove_scene(),
        "RosOut!events": {"topicToRender": "/rosout", "searchTerms": [], "minLogLevel": 1},
        "DiagnosticSummary!health": {"topicToRender": "/diagnostics"},
    }
    for quantity, unit in QUANTITIES.items():
        paths = [
            _foxglove_series(f"/joint_states.{quantity}[{index}]", joint)
            for index, joint in enumerate(joints)
        ]
        panels[f"Plot!{quantity}"] = _foxglove_plot(f"{quantity}, {unit}", paths)
    speed = [
        _foxglove_series("/cmd_vel.twist.linear.x", "commanded"),
        _foxglove_series("/odom.twist.twist.linear.x", "estimated"),
    ]
    panels["Plot!speed"] = _foxglove_plot("forward velocity, m/s", speed)
    left = _split("column", "3D!robot", _split("row", "RosOut!events", "DiagnosticSummary!health"), 70)
    right = _split(
        "column",
        _split("column", "Plot!position", "Plot!velocity"),
        _split("column", "Plot!effort", "Plot!speed"),
    )
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", left, right),
    }
    return json.dumps(layout, indent=2) + "\n"


def _foxglove_scene() -> dict[str, Any]:
    """Settings of the 3-D panel: near the robot, on a grid, without the names and axes of its frames."""
    frames = {"showLabel": False, "axisScale": 0.0, "lineWidth": 0}
    grid = {"layerId": "foxglove.Grid", "frameId": "odom", "size": 20, "divisions": 20, "color": "#a0a0a4ff"}
    return {
        "followTf": "base_link",
        "followMode": "follow-position",
        "topics": {topic: {"visible": True} for topic in ("/markers", "/robot_description", "/tf")},
        "cameraState": {"distance": CAMERA_M, "phi": 65, "thetaOffset": 45, "perspective": True},
        "scene": {"transforms": frames},
        "layers": {"grid": {**grid, "visible": True}},
    }


def _foxglove_plot(title: str, paths: list[dict[str, Any]]) -> dict[str, Any]:
    """Settings of a panel; each of the two viewers has its own key for the title."""
    titles = {"foxglovePanelTitle": title, "lichtblickPanelTitle": title}
    return {**titles, "paths": paths, "showLegend": True, "legendDisplay": "left", "sidebarDimension": 160}


def plotjuggler_layout(joints: Sequence[str]) -> str:
    """A layout for PlotJuggler, as XML: one tab for each quantity of the joints, one for the walk."""
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for quantity in QUANTITIES:
        _tab(window, quantity, [[f"/joint_states/{joint}/{quantity}" for joint in joints]])
    forward = ["/cmd_vel/twist/linear/x", "/odom/twist/twist/linear/x"]
    _tab(window, "walk", [forward, ["/imu/data/angular_velocity/x", "/imu/data/angular_velocity/y"]])
    ElementTree.SubElement(window, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _foxglove_series(path: str, label: str) -> dict[str, Any]:
    return {"value": path, "label": label, "enabled": True, "timestampMethod": "receiveTime"}


def _split(direction: str, first: Any, second: Any, percentage: int = 50) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}


def _tab(window: ElementTree.Element, name: str, plots: Sequence[Sequence[str]]) -> None:
    tab = ElementTree.SubElement(window, "Tab", tab_name=name, containers="1")
    container = ElementTree.SubElement(tab, "Container")
    sizes = ";".join([f"{1 / len(plots):g}"] * len(plots))
    splitter = ElementTree.SubElement(
        container, "DockSplitter", orientation="-", sizes=sizes, count=str(len(plots))
    )
    for curves in plots:
        area = ElementTree.SubElement(splitter, "DockArea", name="...")
        plot = ElementTree.SubElement(area, "plot", style="Lines", mode="TimeSeries")
        ElementTree.SubElement(plot, "limitY")
        for number, curve in enumerate(curves):
            ElementTree.SubElement(plot, "curve", name=curve, color=COLOURS[number % len(COLOURS)])


LAYOUTS = {"foxglove": (foxglove_layout, ".json"), "plotjuggler": (plotjuggler_layout, ".xml")}
