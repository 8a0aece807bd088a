"""Builds the used parts of two message packages that ROS 2 from PyPI lacks, for `check.py`.

    python -m venv jazzy && jazzy/bin/pip install "ros-jazzy-rclpy[fastrtps]" ros-jazzy-common-interfaces
    python benchmarks/ros2/interfaces.py jazzy/bin/python jazzy

A ROS 2 of a distribution has both packages. Needs cmake, ninja and a compiler; takes three minutes.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path
from typing import NamedTuple

AMENT_CMAKE = (
    "core export-definitions export-dependencies export-include-directories export-interfaces"
    " export-libraries export-link-flags export-targets gen-version-h gmock gtest include-directories"
    " libraries pytest python ros target-dependencies test vendor-package version"
)
TOOLS = (
    "ament-cmake",
    "ament-package",
    "pybind11-vendor",
    "rosidl-core-generators",
    "rosidl-default-generators",
)
OWN = {"jazzy": ("python-cmake-module",), "kilted": ("ament-cmake-ros-core",)}
BUILT_IN = "/opt/python/cp3"  # folders of the machine that built the wheels, which their files for cmake name


class Package(NamedTuple):
    """A message package."""

    name: str
    needs: str
    file: str
    content: str


PACKAGES = (
    Package(
        "tf2_msgs", "geometry_msgs", "msg/TFMessage.msg", "geometry_msgs/TransformStamped[] transforms\n"
    ),
    Package(
        "nav2_msgs",
        "nav_msgs",
        "action/FollowPath.action",
        "nav_msgs/Path path\nstring controller_id\nstring goal_checker_id\n---\nuint16 error_code\n---\n"
        "float32 distance_to_goal\nfloat32 speed\n",
    ),
)
MANIFEST = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>For tests</description>
  <maintainer email="none@example.com">none</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  <depend>{needs}</depend>
  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""
CMAKE = """cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
find_package({needs} REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces({name} "{file}" DEPENDENCIES {needs})
ament_package()
"""


def run(*command: str | Path) -> None:
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)


def correct_paths(prefix: Path, python: Path) -> None:
    """Write this environment's folders into the wheels' files for cmake."""
    ask = "import sysconfig; print(sysconfig.get_path('include')); print(sysconfig.get_path('purelib'))"
    answer = subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True)
    include, packages = answer.stdout.split()
    for file in prefix.glob("share/**/*.cmake"):
        text = file.read_text()
        if BUILT_IN in text:
            version = Path(include).name
            tag = "cp" + version.removeprefix("python").replace(".", "")
            root = f"/opt/python/{tag}-{tag}"
            text = text.replace(f"{root}/include/{version}", include)
            file.write_text(text.replace(f"{root}/lib/{version}/site-packages", packages))


def build(package: Package, prefix: Path, python: Path, folder: Path) -> None:
    source = folder / package.name
    (source / package.file).parent.mkdir(parents=True)
    (source / package.file).write_text(package.content)
    (source / "package.xml").write_text(MANIFEST.format(**package._asdict()))
    (source / "CMakeLists.txt").write_text(CMAKE.format(**package._asdict()))
    cmake_prefixes = [f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_INSTALL_PREFIX={prefix}"]
    run(
        "cmake",
        "-G",
        "Ninja",
        "-S",
        source,
        "-B",
        source / "build",
        f"-DPython3_EXECUTABLE={python}",
        *cmake_prefixes,
    )
    run("ninja", "-C", source / "build", "-j", "2", "install")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("python", type=Path, help="Python of the environment with rclpy")
    parser.add_argument("distribution", choices=OWN)
    options = parser.parse_args()
    python = options.python.absolute()
    tools = [*TOOLS, *OWN[options.distribution], *(f"ament-cmake-{part}" for part in AMENT_CMAKE.split())]
    wheels = [f"ros-{options.distribution}-{tool}" for tool in tools]
    run(python, "-m", "pip", "install", "-q", "catkin_pkg", *wheels)
    prefix = python.parents[1]
    correct_paths(prefix, python)
    with tempfile.TemporaryDirectory() as folder:
        for package in PACKAGES:
            build(package, prefix, python, Path(folder))


if __name__ == "__main__":
    main()
