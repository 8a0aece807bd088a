"""Collects the data for a scene, and loads the scene as soon as there is data.

A scene needs NumPy and MuJoCo, which take half a second to import. With the wall clock they are imported in
parallel with the encoding, so the log of a killed run is complete; in lockstep before it, so the log is
reproducible.
"""

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from footfall.deploy.telemetry.scene import Scene

Put = Callable[[str, int, bytes], None]


class SceneFeeder:
    """Passes parts of records, as bytes of float64, to a scene."""

    def __init__(self, begin: dict[str, Any], put: Put) -> None:
        """`about` is the content of a run's first record."""
        self._begin, self._put = begin, put
        self._scene: Scene | None = None
        self._loading: threading.Thread | None = None
        self._odometry = self._contact = self._footholds = b""
        self.command = bytes(24)

    def odometry(self, numbers: bytes) -> None:
        """Set the base's motion. The first call loads the scene."""
        self._odometry, self._footholds = numbers, b""
        if self._loading is None:
            self._loading = threading.Thread(target=self._load)  # not a daemon, which would crash at exit
            self._loading.start()
            if not self._begin["paced"]:
                self._loading.join()

    def contacts(self, numbers: bytes) -> None:
        """Set the contact probability of each foot."""
        self._contact = numbers

    def footholds(self, numbers: bytes) -> None:
        """Set the planned footholds."""
        self._footholds = numbers

    def readings(self, time_ns: int, part: dict[str, bytes]) -> None:
        """Update the scene with these readings, if there has been odometry since the previous ones."""
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

        with suppress(UserError):  # if the robot's files have changed: no markers
            self._scene = Scene(self._begin["robot_folder"], self._begin["robot_digest"], self._put)
