"""Delay of each goal and each reading in training, if jitter, a swing or lost frames are randomised."""

import jax
import jax.numpy as jnp
import numpy as np

from footfall.domain_rand.quantity import Direction
from footfall.domain_rand.sample import Sample
from footfall.domain_rand.transport import delay_now_s, transport_of, waiting_s
from footfall.envs.actuation import KEPT_GOALS
from footfall.envs.state import State
from footfall.robots import kinds
from footfall.robots.kinds import Parts
from footfall.robots.readings import READINGS, SENSED

# Folded into a step's key, so that the step's other draws do not depend on these.
GOAL, READING = 0x60A1, 0x2EAD


class Lateness:
    """Draws delays. A lost frame delays its content until the next frame."""

    def __init__(self, joints: int, period_s: float) -> None:
        """`period_s` is the control period."""
        self._joints, self._period_s = joints, period_s
        self._motor, self._frame = np.arange(joints), _frame_of(joints)

    def initial(self, sample: Sample) -> jax.Array | None:
        """Delay of the goals before an episode, s, (KEPT_GOALS, n); None if delays are constant."""
        varies = transport_of(sample, "actions").varies
        return jnp.zeros((KEPT_GOALS, self._joints)) if varies else None

    def of_goals(self, state: State) -> jax.Array | None:
        """Delay of each goal to each motor, s, (KEPT_GOALS, n), the newest goal first.

        None if delays are constant. The state is the one before the control step.
        """
        if state.lateness_s is None:
            return None
        newest_s = self._drawn("actions", state, jax.random.fold_in(state.key, GOAL), self._motor)
        return jnp.concatenate([newest_s[None], state.lateness_s[:-1]])

    def of_readings(self, state: State, key: jax.Array) -> jax.Array | None:
        """Delay of each number of the readings, s, (numbers,); None if delays are constant.

        Args:
            state: after the control step.
            key: random key of this control step.
        """
        if not transport_of(state.sample, "readings").varies:
            return None
        return self._drawn("readings", state, jax.random.fold_in(key, READING), self._frame)

    def _drawn(self, direction: Direction, state: State, key: jax.Array, frame: np.ndarray) -> jax.Array:
        """Delay of each number, s, (k,); `frame` (k,) is the index of the frame in which it arrives."""
        transport = transport_of(state.sample, direction)
        jitter, *per_frame = jax.random.uniform(key, (2 + frame.max(),))
        delay_s = delay_now_s(transport, state.steps * self._period_s, jitter)
        waiting = 0.0 if transport.lost is None else waiting_s(transport.lost, jnp.stack(per_frame)[frame])
        return jnp.broadcast_to(delay_s + waiting, frame.shape)


def _frame_of(joints: int) -> np.ndarray:
    """Index of the frame in which each number of the readings arrives: a motor's, or a reading's own."""
    frames, next_frame = [], joints
    for declared in READINGS.values():
        size = declared.kind.size(Parts(joints))
        is_of_motors = SENSED[declared.sensed] is kinds.JOINTS
        frames.append(np.arange(size) if is_of_motors else np.full(size, next_frame))
        next_frame += not is_of_motors
    return np.concatenate(frames)
