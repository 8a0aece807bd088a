"""Force sensors at the simulated robot's feet: the ground's force with delay and errors, as CAN frames."""

from collections.abc import Callable

import numpy as np

from footfall.deploy.drivers import foot_force
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.domain_rand.foot_force import measured, randomised_sensors
from footfall.domain_rand.sample import Sample
from footfall.plant.delays import DelayLine

SEED = 0xF007  # combined with an episode's seed, so that other draws do not change


class SimulatedFootSensors:
    """One sensor at each foot. All take their samples at the same times."""

    def __init__(
        self, wiring: Wiring, force: Callable[[], np.ndarray], sample: Sample, step_s: float, seed: int
    ) -> None:
        """`force` returns the normal force on each foot in the last physics step, N, (feet,)."""
        feet = len(wiring.foot_channel)
        self._force, self._sensors = force, randomised_sensors(sample)
        self._delay_line: DelayLine[np.ndarray] = DelayLine(sample, step_s, seed)
        self._rng = np.random.default_rng([seed, SEED])
        self._frames = Frames(
            wiring.foot_channel,
            foot_force.identifiers(feet),
            np.zeros((feet, 8), np.uint8),
            np.full(feet, foot_force.FRAME_BYTES),
        )
        self._counter = 0
        self.silent = np.zeros(feet, bool)  # sensors that send nothing; set by fault injection
        self.distort: Callable[[np.ndarray], np.ndarray] | None = None  # changes reports, N, (feet,)

    def remember(self) -> None:
        """Store the current forces, to be read after the observation delay. Call at each physics step."""
        self._delay_line.push(self._force())

    def sample(self) -> Frames:
        """The frames of the next sample."""
        force_n = measured(self._delay_line.delayed(), self._sensors, self._rng.random(len(self.silent)))
        if self.distort is not None:
            force_n = self.distort(force_n)
        self._counter += 1
        frames = self._frames._replace(data=foot_force.encode(force_n, self._counter))
        return frames.take(~self.silent) if self.silent.any() else frames
