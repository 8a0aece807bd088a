"""Launches a run that ROS 2 steers: `ros2 launch footfall_launch.py robot:=go1 policy:=trot rviz:=true`.

The command `footfall` must be on the PATH, or be given by `footfall:=/path/to/.venv/bin/footfall`.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

ARGUMENTS = {
    "footfall": ("footfall", "command to run"),
    "robot": ("go1", "name or folder of the robot"),
    "policy": ("trot", "name or folder of the policy"),
    "bus": ("sim", "sim, socketcan, or another python-can interface"),
    "cmd_vel": ("twist", "type of /cmd_vel: twist or stamped"),
    "rviz": ("false", "whether to open RViz, too"),
}


def generate_launch_description() -> LaunchDescription:
    """The run, and RViz if requested; the launch ends with the run."""
    values = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    command = [
        values["footfall"],
        "deploy",
        values["policy"],
        "--robot",
        values["robot"],
        "--bus",
        values["bus"],
    ]
    run = ExecuteProcess(
        cmd=[*command, "--from", ["ros2:", values["cmd_vel"]]],
        output="screen",
        on_exit=Shutdown(),
    )
    rviz = Node(
        package="rviz2",
        executable="rviz2",
        arguments=["-d", str(Path(__file__).with_name("footfall.rviz"))],
        condition=IfCondition(values["rviz"]),
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=about)
        for name, (default, about) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, run, rviz])
