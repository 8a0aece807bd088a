"""Power of the motors from torque and speed."""

import numpy as np

from footfall.robots.description import Robot

BLOCK = 128  # steps that are added up at once


class Power:
    """Mean power of all motors together over some time, W; computed when it is first read."""

    def __init__(self, meter: "EnergyMeter") -> None:
        self._meter = meter
        self._values: tuple[float, float, float] | None = None

    @property
    def electrical(self) -> float:
        """Shaft power and copper loss. The copper loss of a motor is R (torque / (gear ratio kt))^2."""
        return self._known()[0]

    @property
    def mechanical(self) -> float:
        """Shaft power."""
        return self._known()[1]

    @property
    def positive(self) -> float:
        """Shaft power of each motor where it is positive."""
        return self._known()[2]

    def set(self, mechanical: float, copper: float, positive: float) -> None:
        """Set the mean powers, W."""
        self._values = mechanical + copper, mechanical, positive

    def _known(self) -> tuple[float, float, float]:
        if self._values is None:
            self._meter.add_up()
        assert self._values is not None
        return self._values


class EnergyMeter:
    """Collects torque and speed of each physics step; adds them up in blocks.

    A block takes little more time than one step, so a power is added up when it is read, with all powers
    before it.
    """

    def __init__(self, robot: Robot) -> None:
        self._loss = robot.copper_loss
        # Torque, velocity before and velocity after of each step that is not added up yet.
        self._rows = np.zeros((BLOCK, 3, len(robot.joint_names)))
        self._steps = 0  # number of these steps
        self._taken: list[tuple[int, Power]] = []  # number of steps when a power was taken, and the power
        self._count, self._sums = 0, np.zeros(3)  # of steps, and of their powers in W, since the last power

    def add(self, torque: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """One physics step: motor torque at the joint, N m, joint velocity before and after it, rad/s; (n,).

        Power uses the mean velocity: with the velocity before the step alone, damping would create power.
        """
        row = self._rows[self._steps]
        row[0], row[1], row[2] = torque, before, after
        self._steps += 1
        if self._steps == BLOCK:
            self.add_up()

    def take(self) -> Power:
        """Mean power since the last call; zero without a step."""
        power = Power(self)
        self._taken.append((self._steps, power))
        return power

    def add_up(self) -> None:
        """Add up all steps, and set the powers that were taken."""
        powers = self._powers()
        ends = [end for end, _ in self._taken]
        starts = [0, *ends]
        counts = np.diff([*starts, len(powers) - 1])
        # Of a range without steps, `reduceat` returns the row after it.
        sums = np.add.reduceat(powers, starts) * (counts > 0)[:, None]
        sums[0] += self._sums
        counts[0] += self._count
        means = (sums[:-1] / np.maximum(counts[:-1], 1)[:, None]).tolist()
        for (_, power), mean in zip(self._taken, means, strict=True):
            power.set(*mean)
        self._count, self._sums = int(counts[-1]), sums[-1]
        self._steps = 0
        self._taken.clear()

    def _powers(self) -> np.ndarray:
        """Shaft power, copper loss and positive shaft power of each step, W, and a row of zeros."""
        rows = self._rows[: self._steps]
        torque = rows[:, 0]
        shaft = torque * (0.5 * (rows[:, 1] + rows[:, 2]))
        powers = np.zeros((len(rows) + 1, 3))
        np.add.reduce(shaft, 1, out=powers[:-1, 0])
        np.matmul(torque * torque, self._loss, out=powers[:-1, 1])
        np.add.reduce(np.maximum(shaft, 0.0), 1, out=powers[:-1, 2])
        return powers
