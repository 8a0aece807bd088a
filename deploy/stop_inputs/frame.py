"""A CAN frame that stops the robot. If it is a heartbeat, its absence stops the robot, too."""

import numpy as np

from footfall.deploy.bus import Bus
from footfall.deploy.command_source import Stop
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.wrapped_bus import WrappedBus
from footfall.robots.stop_inputs import StopFrame


def filter_of(frame: StopFrame) -> CanFilter:
    """Filter that passes only this frame."""
    mask = 0x1FFF_FFFF if frame.extended else 0x7FF
    return {"can_id": frame.id, "can_mask": mask, "extended": frame.extended}


class StopFrameBus(WrappedBus):
    """Bus that removes the stop frames from the received ones: a `Bus` and a `StopSource`.

    Drivers do not see these frames, since some drivers identify the sender by the content.
    """

    def __init__(self, inner: Bus, frame: StopFrame, channel: int) -> None:
        """`channel` is the index of the frame's bus."""
        super().__init__(inner)
        self._frame, self._channel = frame, channel
        self._id = frame.id | frame.extended * EXTENDED
        self._address = f"{frame.id:#x} on {frame.bus}"
        self._arrived_us: int | None = None
        self.stopped: Stop | None = None

    def receive(self, now_us: int) -> list[Frames]:
        batches = super().receive(now_us)
        if self._arrived_us is None:
            self._arrived_us = now_us
        for index, frames in enumerate(batches):
            own = (frames.id == self._id) & (frames.channel == self._channel)
            if np.count_nonzero(own):
                self._take(frames.take(own), now_us)
                batches[index] = frames.take(~own)
        limit_s = self._frame.heartbeat_s
        if limit_s is not None and now_us - self._arrived_us > limit_s * 1e6:
            self._stop(f"no stop frame {self._address} for {limit_s * 1e3:.0f} ms")
        return batches

    def _take(self, frames: Frames, now_us: int) -> None:
        self._arrived_us = now_us
        if ((frames.length == 0) | (frames.data[:, 0] != 0)).any():
            self._stop(f"stopped by the stop frame {self._address}")

    def _stop(self, reason: str) -> None:
        self.stopped = self.stopped or Stop(reason, self._frame.damp, f"the stop frame {self._address}")
