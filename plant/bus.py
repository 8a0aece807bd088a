"""The simulated robot as a bus, instead of CAN interfaces."""

from threading import Lock

from footfall.deploy.bus import BusStatistics
from footfall.deploy.frames import Frames
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import Side, SimulatedWires


class SimulatedBus:
    """The controller's end of simulated wires. Receiving simulates the robot up to the current time.

    A lock is needed, because a guard (`deploy/guard.py`) sends from its own thread, possibly during a step.
    """

    def __init__(self, wires: SimulatedWires, robot: SimulatedRobot) -> None:
        self._wires, self._robot, self._lock = wires, robot, Lock()

    def send(self, frames: Frames, now_us: int) -> int:
        with self._lock:
            return self._wires.send(Side.HOST, frames, now_us)

    def receive(self, now_us: int) -> list[Frames]:
        with self._lock:
            self._robot.advance(now_us)
            return self._wires.receive(Side.HOST, now_us)

    def fault(self) -> str:
        return self._wires.fault()

    def statistics(self) -> list[BusStatistics]:
        elapsed = max(self._robot.time_us, 1)
        wires = self._wires
        sent, received, busy = wires.sent(Side.HOST), wires.sent(Side.ROBOT), wires.busy_us()
        return [
            BusStatistics(
                name=name,
                frames_sent=int(sent[i]),
                frames_received=int(received[i]),
                frames_refused=int(wires.refused[Side.HOST, i]),
                load=float(busy[i]) / elapsed,
            )
            for i, name in enumerate(wires.names)
        ]

    def close(self) -> None:
        """Nothing to close."""
