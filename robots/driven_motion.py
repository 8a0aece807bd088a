"""Recorded motion of joints with what drives it, on the grid of the physics steps."""

from typing import NamedTuple

import numpy as np


class DrivenMotion(NamedTuple):
    """Motion of a leg with n joints at T physics steps, from which a joint law can be learned.

    The bodies' inertia and bias forces are those along the recorded path.
    """

    step_s: float
    command: np.ndarray  # (T, 5, n) that motors follow in each step, after its delay
    position: np.ndarray  # (T, n) rad, as the encoders measure it
    velocity: np.ndarray  # (T, n) rad/s
    acceleration: np.ndarray  # (T, n) rad/s^2
    inertia: np.ndarray  # (T, n, n) kg m^2, armature included
    bias: np.ndarray  # (T, n) N m, of gravity and velocities
    torque: np.ndarray  # (T, n) N m, of the motors by the physical law
    before: np.ndarray  # (T, n) N m, torque of motors with lag at the beginning of each step
    missing: np.ndarray  # (T, n) N m at the joints, torque that the law lacks for the recorded acceleration
    starts: np.ndarray  # (S,) steps at which a window may begin
    block: np.ndarray  # (S,) number of the stretch of the recording that the window lies in; -1: in two

    def only(self, kept: np.ndarray) -> "DrivenMotion":
        """The same motion with the starts where `kept`, (S,) bool, is true."""
        return self._replace(starts=self.starts[kept], block=self.block[kept])


def joined_motion(parts: list[DrivenMotion]) -> DrivenMotion:
    """Several motions, one after the other; windows do not cross from one to the next."""
    offsets = np.cumsum([0, *(len(part.position) for part in parts[:-1])])
    starts = [part.starts + offset for part, offset in zip(parts, offsets.tolist(), strict=True)]
    arrays = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in DrivenMotion._fields
        if name not in ("step_s", "starts")
    }
    return DrivenMotion(parts[0].step_s, starts=np.concatenate(starts), **arrays)
