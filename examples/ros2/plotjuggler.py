"""Writes a layout for PlotJuggler: `python plotjuggler.py go1 > go1.xml`; `plotjuggler --layout go1.xml`.

The layout fits the topics of a run in ROS 2 and those of a log (`footfall deploy … --log walk.mcap`).
"""

import sys
from collections.abc import Iterator
from xml.etree import ElementTree

from footfall import load_robot

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf")
Plots = dict[str, list[str]]  # curves by title of the plot


def tabs(robot: str) -> Iterator[tuple[str, Plots]]:
    """A tab for the base, and one for each leg with its joints' positions, speeds and torques."""
    yield (
        "base",
        {
            "velocity": [f"/odom/twist/twist/linear/{axis}" for axis in "xyz"],
            "angular velocity": [f"/imu/data/angular_velocity/{axis}" for axis in "xyz"],
            "acceleration": [f"/imu/data/linear_acceleration/{axis}" for axis in "xyz"],
        },
    )
    for foot in load_robot(robot).description.feet:
        yield (
            foot.name,
            {
                "position and target": [
                    f"/{topic}/{joint}/position"
                    for joint in foot.joints
                    for topic in ("joint_states", "joint_commands")
                ],
                "speed": [f"/joint_states/{joint}/velocity" for joint in foot.joints],
                "torque": [f"/joint_states/{joint}/effort" for joint in foot.joints],
            },
        )


def layout(robot: str) -> str:
    """The layout as XML."""
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(root, "tabbed_widget", {"name": "Main Window", "parent": "main_window"})
    for name, plots in tabs(robot):
        tab = ElementTree.SubElement(window, "Tab", tab_name=name, containers="1")
        share = f"{1 / len(plots):.4f}"
        splitter = ElementTree.SubElement(
            ElementTree.SubElement(tab, "Container"),
            "DockSplitter",
            orientation="-",
            count=str(len(plots)),
            sizes=";".join([share] * len(plots)),
        )
        for title, curves in plots.items():
            area = ElementTree.SubElement(splitter, "DockArea", name=title)
            plot = ElementTree.SubElement(area, "plot", mode="TimeSeries", style="Lines")
            for number, curve in enumerate(curves):
                colour = COLOURS[number % len(COLOURS)]
                ElementTree.SubElement(plot, "curve", name=curve, color=colour)
    ElementTree.SubElement(window, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


if __name__ == "__main__":
    print(layout(sys.argv[1] if len(sys.argv) > 1 else "go1"))
