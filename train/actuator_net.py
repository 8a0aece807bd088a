"""Trains actuator nets: windows of recorded motion are simulated with the net in the joint law.

No torque sensors at the joints are needed, as Hwangbo et al. (2019) have them: the error of the simulated
positions is differentiated through the joint law and the bodies. The bodies' inertia and bias forces are
those along the recorded path.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax

from footfall.common.config import require_between
from footfall.robots.actuator import JointCommand, Motor, friction_torque, lag_over, lagged, motor_torque
from footfall.robots.actuator_net import INPUTS, ActuatorNet, inputs_of, learned_torque
from footfall.robots.driven_motion import DrivenMotion

MEMORY_S = np.array([0.004, 0.016])  # time constants of the low-passes
LIMIT_SHARE, LIMIT_FACTOR = 99.5, 1.5  # percentile of the missing torque, and times that
MIN_SCALE_NM = 1e-3
MAX_LIMIT_SHARE, RIDGE = 0.9, 1e-3  # of the linear part's least squares; the inputs' mean square is 1
FIRST_OUTPUT = 0.1  # share of the usual size of the last layer's first weights: training begins as linear
HUBER_WIDTH = 5.0  # of a position error, in errors of the law, beyond which it counts linearly
CHECKED_WINDOWS = 128  # that decide when to stop


@dataclass(frozen=True)
class NetConfig:
    """How an actuator net is trained."""

    hidden: tuple[int, ...] = (16, 16)
    window_s: float = 0.2  # of motion that is simulated
    windows: int = 64  # in a step
    steps: int = 300  # of gradient descent; the step length falls to 0 by a cosine
    check_every: int = 25  # steps; the best net of all checks is kept
    learning_rate: float = 5e-3
    seeds: int = 2  # trainings; the one that does best on the windows that decide is kept
    seed: int = 0

    def __post_init__(self) -> None:
        require_between(self, 0.02, 2.0, "window_s")
        require_between(self, 1, 100_000, "windows", "steps", "check_every", "seeds")
        if self.steps < self.check_every:
            raise ValueError(
                f"steps must be at least {self.check_every}, not {self.steps}: no net would be checked"
            )


class Trained(NamedTuple):
    """A net, and how well it does on windows that were not trained on."""

    net: ActuatorNet
    law_rad: np.ndarray  # (n,) rms error of the physical law
    net_rad: np.ndarray  # (n,) with the net
    steps: int  # after which the net was best


def train_net(motion: DrivenMotion, deciding: DrivenMotion, motor: Motor, config: NetConfig) -> Trained:
    """Train the nets of a leg's joints.

    Args:
        motion: training data.
        deciding: other motion, which decides which net of which training is kept.
        motor: motor of its joints, fields (n,).
        config: settings of the training.
    """
    start = _begin(motion, motor)
    length = round(config.window_s / motion.step_s)
    data, judge = (_data(start, each) for each in (motion, deciding))
    motor = jax.tree.map(partial(jnp.asarray, dtype=jnp.float32), motor)
    windows = np.linspace(0, len(deciding.starts) - 1, min(CHECKED_WINDOWS, len(deciding.starts)))
    chosen = jnp.asarray(deciding.starts[windows.astype(int)])
    law = _rms(start, motor, judge, chosen, length)
    start = start._replace(linear=_first_linear(start, motion))
    best: Trained | None = None
    for number in range(config.seeds):
        found = _trained(start, motor, data, judge, chosen, law, length, config, config.seed + number)
        if best is None or _score(found) < _score(best):
            best = found
    assert best is not None
    return best


def _score(found: Trained) -> float:
    return float(np.mean((found.net_rad / found.law_rad) ** 2))


def _begin(motion: DrivenMotion, motor: Motor) -> ActuatorNet:
    """The law alone: nets without layers, with the sizes of their inputs and of the missing torque."""
    command = JointCommand.of(np.moveaxis(motion.command, 1, 0))
    joints = motion.position.shape[1]
    linear = np.zeros((joints, INPUTS * (1 + len(MEMORY_S)), 1))
    plain = ActuatorNet((), linear, MEMORY_S, np.ones((joints, INPUTS)), np.ones(joints))
    inputs = inputs_of(plain, command, motion.position, motion.velocity, motion.torque)
    limit = LIMIT_FACTOR * np.percentile(np.abs(motion.missing), LIMIT_SHARE, axis=0)
    return plain._replace(
        scale=np.maximum(np.sqrt((inputs**2).mean(axis=0)), MIN_SCALE_NM),
        limit=np.maximum(limit, MIN_SCALE_NM),
    )


def _along(net: ActuatorNet, motion: DrivenMotion) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (T, n, INPUTS) along a motion, and the memory before each step (T, n, m, INPUTS)."""
    command = JointCommand.of(np.moveaxis(motion.command, 1, 0))
    inputs = np.asarray(inputs_of(net, command, motion.position, motion.velocity, motion.torque))
    kept = np.exp(-motion.step_s / net.memory_s)[:, None]
    memory = np.empty((*motion.position.shape, len(net.memory_s), INPUTS))
    now = np.repeat(inputs[0, :, None], len(net.memory_s), axis=1)
    for row, read in enumerate(inputs[:, :, None]):
        memory[row] = now
        now = read + kept * (now - read)
    return inputs, memory


def _first_linear(net: ActuatorNet, motion: DrivenMotion) -> np.ndarray:
    """The missing torque as a linear function of the inputs, by least squares, (n, inputs, 1)."""
    inputs, memory = _along(net, motion)
    read = np.concatenate([inputs[:, :, None], memory], axis=2).reshape(*inputs.shape[:2], -1)
    target = np.arctanh((motion.missing / net.limit).clip(-MAX_LIMIT_SHARE, MAX_LIMIT_SHARE))
    normal = np.einsum("tni,tnj->nij", read, read) + RIDGE * len(read) * np.eye(read.shape[2])
    found: np.ndarray = np.linalg.solve(normal, np.einsum("tni,tn->ni", read, target)[..., None])
    return found


class _Data(NamedTuple):
    """What windows are cut from; T steps, in single precision."""

    command: jax.Array  # (T, 5, n)
    position: jax.Array  # (T, n)
    velocity: jax.Array  # (T, n)
    mobility: jax.Array  # (T, n, n) inverse inertia
    bias: jax.Array  # (T, n)
    before: jax.Array  # (T, n)
    memory: jax.Array  # (T, n, m, INPUTS)
    starts: jax.Array  # (S,)
    step_s: float


def _data(net: ActuatorNet, motion: DrivenMotion) -> _Data:
    """A motion with its inverse inertia and the memory of the net along it."""
    _, memory = _along(net, motion)
    single = partial(jnp.asarray, dtype=jnp.float32)
    return _Data(
        command=single(motion.command),
        position=single(motion.position),
        velocity=single(motion.velocity),
        mobility=single(np.linalg.inv(motion.inertia)),
        bias=single(motion.bias),
        before=single(motion.before),
        memory=single(memory),
        starts=jnp.asarray(motion.starts),
        step_s=motion.step_s,
    )


def _windows(net: ActuatorNet, motor: Motor, data: _Data, starts: jax.Array, length: int) -> jax.Array:
    """Simulated minus recorded positions of windows, rad, (length, W, n)."""
    lag = None if motor.lag_s is None else lag_over(motor.lag_s, data.step_s)
    rows = starts + jnp.arange(length)[:, None]  # (length, W)

    def step(carried: Any, now: tuple[jax.Array, ...]) -> tuple[Any, jax.Array]:
        position, velocity, before, memory = carried
        values, mobility, bias, target = now
        command = JointCommand.of(jnp.moveaxis(values, 1, 0))
        torque = motor_torque(command, position, velocity, motor)
        if lag is not None:
            torque, before = lagged(torque, before, lag)
        inputs = inputs_of(net, command, position, velocity, torque)
        force = torque + friction_torque(velocity, motor, torque) - bias
        if net.layers:
            learned = learned_torque(net, inputs, memory, data.step_s)
            force, memory = force + learned.torque, learned.memory
        velocity = velocity + data.step_s * jnp.einsum("wij,wj->wi", mobility, force)
        position = position + data.step_s * velocity
        return (position, velocity, before, memory), position - target

    first = tuple(each[starts] for each in (data.position, data.velocity, data.before, data.memory))
    along = data.command[rows], data.mobility[rows], data.bias[rows], data.position[rows + 1]
    return jax.lax.scan(step, first, along)[1]


def _rms(net: ActuatorNet, motor: Motor, data: _Data, starts: jax.Array, length: int) -> np.ndarray:
    error = _windows(net, motor, data, starts, length)
    return np.sqrt(np.asarray((error**2).mean(axis=(0, 1)), dtype=float)) + 1e-9


def _first_layers(key: jax.Array, joints: int, config: NetConfig) -> tuple[jax.Array, ...]:
    sizes = (INPUTS * (1 + len(MEMORY_S)), *config.hidden, 1)
    pairs = list(pairwise(sizes))
    keys = jax.random.split(key, len(pairs))
    layers = [
        jax.random.normal(each, (joints, a, b)) / np.sqrt(a) for each, (a, b) in zip(keys, pairs, strict=True)
    ]
    return (*layers[:-1], FIRST_OUTPUT * layers[-1])


def _trained(
    start: ActuatorNet,
    motor: Motor,
    data: _Data,
    judge: _Data,
    chosen: jax.Array,
    law_rad: np.ndarray,
    length: int,
    config: NetConfig,
    seed: int,
) -> Trained:
    """One training: the net that was best on the chosen windows."""
    key, first = jax.random.split(jax.random.PRNGKey(seed))
    layers = _first_layers(first, len(law_rad), config)
    weights = layers, jnp.asarray(start.linear, dtype=jnp.float32)
    optimiser = optax.chain(
        optax.clip_by_global_norm(1.0),
        optax.adam(optax.cosine_decay_schedule(config.learning_rate, config.steps)),
    )
    state, unit = optimiser.init(weights), jnp.asarray(law_rad, dtype=jnp.float32)

    def with_weights(weights: Any) -> ActuatorNet:
        return start._replace(layers=weights[0], linear=weights[1])

    def loss(weights: Any, starts: jax.Array) -> jax.Array:
        error = _windows(with_weights(weights), motor, data, starts, length) / unit
        return optax.losses.huber_loss(error, delta=HUBER_WIDTH).mean()

    @jax.jit
    def several(weights: Any, state: Any, key: jax.Array) -> tuple[Any, Any]:
        def one(carried: Any, key: jax.Array) -> tuple[Any, None]:
            weights, state = carried
            starts = data.starts[jax.random.randint(key, (config.windows,), 0, len(data.starts))]
            change, state = optimiser.update(jax.grad(loss)(weights, starts), state, weights)
            return (optax.apply_updates(weights, change), state), None

        keys = jax.random.split(key, config.check_every)
        return jax.lax.scan(one, (weights, state), keys)[0]

    judged: Callable[[Any], jax.Array] = jax.jit(
        lambda weights: _windows(with_weights(weights), motor, judge, chosen, length)
    )
    none = tuple(np.zeros(layer.shape) for layer in layers)
    nothing = start._replace(layers=none, linear=np.zeros(start.linear.shape))
    best = Trained(nothing, law_rad, law_rad, 0)
    for number in range(1, config.steps // config.check_every + 1):
        key, now = jax.random.split(key)
        weights, state = several(weights, state, now)
        error = np.sqrt(np.asarray((judged(weights) ** 2).mean(axis=(0, 1)), dtype=float)) + 1e-9
        kept = with_weights(jax.tree.map(partial(np.asarray, dtype=float), weights))
        found = Trained(kept, law_rad, error, number * config.check_every)
        best = min(best, found, key=_score)
    return best
