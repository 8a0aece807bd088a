"""Collects what a scene shows, and loads what computes it once there is something to show.

That needs NumPy and MuJoCo, half a second of work. By the wall clock it is done beside the encoding, so that
a killed run's log lacks nothing; in lockstep first, so that a log is the same each time.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from footfall.deploy.telemetry.scene import Scene

Put = Callable[[str, int, bytes], None]


class SceneFeeder:
    """Feeds a scene with the parts of records, as bytes of float64."""

    def __init__(self, about: dict[str, Any], put: Put) -> None:
        """`about` is the content of the record that begins a run."""
        self._about, self._put = about, put
        self._scene: Scene | None = None
        self._loading: threading.Thread | None = None
        self._odometry = self._contact = self._footholds = b""
        self.command = bytes(24)

    def odometry(self, numbers: bytes) -> None:
        """The base's motion. Load the scene at the first one."""
        self._odometry, self._footholds = numbers, b""
        if self._loading is None:
            self._loading = threading.Thread(target=self._load)  # no daemon: it would crash at exit
            self._loading.start()
            if not self._about["paced"]:
                self._loading.join()

    def contacts(self, numbers: bytes) -> None:
        """Which feet stand."""
        self._contact = numbers

    def footholds(self, numbers: bytes) -> None:
        """Where feet shall land."""
        self._footholds = numbers

    def readings(self, time_ns: int, part: dict[str, bytes]) -> None:
        """Show the scene with these readings, if there has been odometry since the last ones."""
        if self._scene is None or not self._odometry:
            return
        import numpy as np

        from footfall.robots.readings import Sensed

        def numbers(content: bytes) -> np.ndarray:
            return np.frombuffer(content)

        sensed = Sensed(*(numbers(part[name]) for name in Sensed._fields))
        footholds = numbers(self._footholds).reshape(-1, 3) if self._footholds else None
        odometry, self._odometry = numbers(self._odometry), b""
        self._scene.show(time_ns, sensed, odometry, numbers(self._contact), footholds, numbers(self.command))

    def _load(self) -> None:
        from footfall.common.errors import UserError
        from footfall.deploy.telemetry.scene import Scene

        with suppress(UserError):  # the robot's files have changed: no markers
            self._scene = Scene(self._about["robot_folder"], self._about["robot_digest"], self._put)
