"""Source of a run's height scans."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from footfall.common.errors import UserError

if TYPE_CHECKING:
    from footfall.deploy.height_scan import HeightScanSource
    from footfall.policies.policy import Policy

AUTO, OFF, UDP, ROS2 = "auto", "off", "udp", "ros2"


def arrive_in_real_time(chosen: str) -> bool:
    """Whether scans come from another program, in real time."""
    return chosen.partition(":")[0] in (UDP, ROS2)


def check_scans_are_read(chosen: str, policies: "Sequence[Policy]") -> None:
    """Check that a run for which scans are to arrive has a policy that reads them.

    Raises:
        UserError: none of these policies does, or two of them use different scans.
    """
    from footfall.policies.height_scan import common_height_scan

    if arrive_in_real_time(chosen) and common_height_scan([each.contract for each in policies]) is None:
        raise UserError(f"--height-scan {chosen}: no policy of this run reads height scans; leave it out")


@contextmanager
def height_scan_source(chosen: str) -> "Iterator[HeightScanSource | None]":
    """Source named by `--height-scan`; None for the simulated robot's own scans.

    Raises:
        UserError: there is no such source, or it cannot be opened.
    """
    kind, _, argument = chosen.partition(":")
    if chosen == AUTO:
        yield None
    elif chosen == OFF:
        from footfall.deploy.height_scan import NoScans

        yield NoScans()
    elif kind == UDP:
        from footfall.operate.height_scan_udp import scans_by_udp

        with scans_by_udp(argument) as scans:
            yield scans
    elif kind == ROS2:
        from footfall.operate.ros2.height_scans import scans_by_ros2

        with scans_by_ros2(argument) as (scans, warning):
            if warning:
                print(warning, flush=True)
            yield scans
    else:
        raise UserError(
            f"--height-scan {chosen}: give {AUTO}, {OFF}, {UDP}, {UDP}:HOST:PORT, {ROS2} or {ROS2}:FILE.yaml"
        )
