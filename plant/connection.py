"""The robot's side of its buses, with lost frames."""

from footfall.deploy.frames import Frames
from footfall.domain_rand.sample import Sample
from footfall.plant.delays import Losses
from footfall.plant.wires import Side, SimulatedWires


class Connection:
    """Receives and sends the robot's frames."""

    def __init__(self, wires: SimulatedWires, sample: Sample, seed: int) -> None:
        """`sample` has the shares of lost frames, `seed` draws which ones."""
        self._wires = wires
        self._command_losses = Losses(sample, "actions", seed)
        self._reply_losses = Losses(sample, "readings", seed)

    def receive(self, now_us: float) -> list[Frames]:
        """Frames that have arrived and are not lost."""
        arrived = self._wires.receive(Side.ROBOT, now_us)
        return list(map(self._command_losses.pass_on, arrived)) if self._command_losses.share else arrived

    def send(self, frames: Frames, now_us: float) -> None:
        """Send frames, except lost ones."""
        if self._reply_losses.share:
            frames = self._reply_losses.pass_on(frames)
        if len(frames.id):
            self._wires.send(Side.ROBOT, frames, now_us)
