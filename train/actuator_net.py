"""Trains actuator nets: windows of recorded motion are simulated with the net in the joint law.

Unlike in Hwangbo et al. (2019), no torque sensors at the joints are needed: the error of the simulated
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
# Limit of the learned torque: this percentile of the missing torque, times this factor.
LIMIT_PERCENTILE, LIMIT_FACTOR = 99.5, 1.5
MIN_SCALE_NM = 1e-3
MAX_LIMIT_SHARE, RIDGE = 0.9, 1e-3  # of the linear part's least squares; the inputs' mean square is 1
# Initial size of the last layer's weights over the usual size: training begins almost linear.
INITIAL_OUTPUT_SHARE = 0.1
HUBER_WIDTH = 5.0  # position error over the law's rms error, above which the loss is linear
CHECKED_WINDOWS = 128  # windows of the validation motion that each check simulates


@dataclass(frozen=True)
class NetConfig:
    """How an actuator net is trained."""

    hidden: tuple[int, ...] = (16, 16)
    window_s: float = 0.2  # of motion that is simulated
    windows: int = 64  # in a gradient step
    steps: int = 300  # gradient steps; the learning rate falls to 0 by a cosine
    check_every: int = 25  # steps; the best net of all checks is kept
    learning_rate: float = 5e-3
    seeds: int = 2  # trainings; the net with the smallest validation error is kept
    seed: int = 0

    def __post_init__(self) -> None:
        require_between(self, 0.02, 2.0, "window_s")
        require_between(self, 1, 100_000, "windows", "steps", "check_every", "seeds")
        if self.steps < self.check_every:
            raise ValueError(
                f"steps must be at least {self.check_every}, not {self.steps}: no net would be checked"
            )


class Trained(NamedTuple):
    """A net, and its errors on windows that were not trained on."""

    net: ActuatorNet
    law_rad: np.ndarray  # (n,) rms error of the physical law
    net_rad: np.ndarray  # (n,) rms error with the net
    steps: int  # gradient steps after which the net was best


def train_net(motion: DrivenMotion, validation: DrivenMotion, motor: Motor, config: NetConfig) -> Trained:
    """Train the nets of a leg's joints.

    Args:
        motion: training data.
        validation: other motion; the net with the smallest error on it is kept.
        motor: motor of the leg's joints, fields (n,).
        config: settings of the training.
    """
    initial = _law_alone(motion, motor)
    length = round(config.window_s / motion.step_s)
    data, validation_data = (_data(initial, each) for each in (motion, validation))
    motor = jax.tree.map(partial(jnp.asarray, dtype=jnp.float32), motor)
    windows = np.linspace(0, len(validation.starts) - 1, min(CHECKED_WINDOWS, len(validation.starts)))
    checked_starts = jnp.asarray(validation.starts[windows.astype(int)])
    law_rad = _rms_error(initial, motor, validation_data, checked_starts, length)
    initial = initial._replace(linear=_fitted_linear(initial, motion))
    best: Trained | None = None
    for index in range(config.seeds):
        seed = config.seed + index
        trained = _train_once(
            initial, motor, data, validation_data, checked_starts, law_rad, length, config, seed
        )
        if best is None or _score(trained) < _score(best):
            best = trained
    assert best is not None
    return best


def _score(trained: Trained) -> float:
    """Mean squared error relative to the law's; smaller is better."""
    return float(np.mean((trained.net_rad / trained.law_rad) ** 2))


def _law_alone(motion: DrivenMotion, motor: Motor) -> ActuatorNet:
    """A net without layers, which stands for the law alone; its scales and limit come from the motion."""
    command = JointCommand.of(np.moveaxis(motion.command, 1, 0))
    joints = motion.position.shape[1]
    linear = np.zeros((joints, INPUTS * (1 + len(MEMORY_S)), 1))
    plain = ActuatorNet((), linear, MEMORY_S, np.ones((joints, INPUTS)), np.ones(joints))
    inputs = inputs_of(plain, command, motion.position, motion.velocity, motion.torque)
    limit = LIMIT_FACTOR * np.percentile(np.abs(motion.missing), LIMIT_PERCENTILE, axis=0)
    return plain._replace(
        scale=np.maximum(np.sqrt((inputs**2).mean(axis=0)), MIN_SCALE_NM),
        limit=np.maximum(limit, MIN_SCALE_NM),
    )


def _inputs_along(net: ActuatorNet, motion: DrivenMotion) -> tuple[np.ndarray, np.ndarray]:
    """Inputs (T, n, INPUTS) along a motion, and the memory before each step (T, n, m, INPUTS)."""
    command = JointCommand.of(np.moveaxis(motion.command, 1, 0))
    inputs = np.asarray(inputs_of(net, command, motion.position, motion.velocity, motion.torque))
    decay = np.exp(-motion.step_s / net.memory_s)[:, None]
    memory = np.empty((*motion.position.shape, len(net.memory_s), INPUTS))
    low_passed = np.repeat(inputs[0, :, None], len(net.memory_s), axis=1)
    for row, values in enumerate(inputs[:, :, None]):
        memory[row] = low_passed
        low_passed = values + decay * (low_passed - values)
    return inputs, memory


def _fitted_linear(net: ActuatorNet, motion: DrivenMotion) -> np.ndarray:
    """The missing torque as a linear function of the inputs, by least squares, (n, inputs, 1)."""
    inputs, memory = _inputs_along(net, motion)
    features = np.concatenate([inputs[:, :, None], memory], axis=2).reshape(*inputs.shape[:2], -1)
    target = np.arctanh((motion.missing / net.limit).clip(-MAX_LIMIT_SHARE, MAX_LIMIT_SHARE))
    normal = np.einsum("tni,tnj->nij", features, features) + RIDGE * len(features) * np.eye(features.shape[2])
    linear: np.ndarray = np.linalg.solve(normal, np.einsum("tni,tn->ni", features, target)[..., None])
    return linear


class _Data(NamedTuple):
    """Recorded motion from which windows are cut: T steps, in single precision."""

    command: jax.Array  # (T, 5, n)
    position: jax.Array  # (T, n)
    velocity: jax.Array  # (T, n)
    mobility: jax.Array  # (T, n, n) inverse inertia
    bias: jax.Array  # (T, n) N m, force that keeps the accelerations at 0
    torque_before: jax.Array  # (T, n) N m, motor torque at the beginning of each step, with lag
    memory: jax.Array  # (T, n, m, INPUTS)
    starts: jax.Array  # (S,)
    step_s: float


def _data(net: ActuatorNet, motion: DrivenMotion) -> _Data:
    """A motion with its inverse inertia and the memory of the net along it."""
    _, memory = _inputs_along(net, motion)
    single = partial(jnp.asarray, dtype=jnp.float32)
    return _Data(
        command=single(motion.command),
        position=single(motion.position),
        velocity=single(motion.velocity),
        mobility=single(np.linalg.inv(motion.inertia)),
        bias=single(motion.bias),
        torque_before=single(motion.before),
        memory=single(memory),
        starts=jnp.asarray(motion.starts),
        step_s=motion.step_s,
    )


def _position_errors(
    net: ActuatorNet, motor: Motor, data: _Data, starts: jax.Array, length: int
) -> jax.Array:
    """Simulated minus recorded positions of windows, rad, (length, W, n)."""
    lag = None if motor.lag_s is None else lag_over(motor.lag_s, data.step_s)
    rows = starts + jnp.arange(length)[:, None]  # (length, W)

    def step(carry: Any, recorded: tuple[jax.Array, ...]) -> tuple[Any, jax.Array]:
        position, velocity, torque_before, memory = carry
        values, mobility, bias, recorded_position = recorded
        command = JointCommand.of(jnp.moveaxis(values, 1, 0))
        torque = motor_torque(command, position, velocity, motor)
        if lag is not None:
            torque, torque_before = lagged(torque, torque_before, lag)
        inputs = inputs_of(net, command, position, velocity, torque)
        force = torque + friction_torque(velocity, motor, torque) - bias
        if net.layers:
            learned = learned_torque(net, inputs, memory, data.step_s)
            force, memory = force + learned.torque, learned.memory
        velocity = velocity + data.step_s * jnp.einsum("wij,wj->wi", mobility, force)
        position = position + data.step_s * velocity
        return (position, velocity, torque_before, memory), position - recorded_position

    first = tuple(each[starts] for each in (data.position, data.velocity, data.torque_before, data.memory))
    over_time = data.command[rows], data.mobility[rows], data.bias[rows], data.position[rows + 1]
    return jax.lax.scan(step, first, over_time)[1]


def _rms_error(net: ActuatorNet, motor: Motor, data: _Data, starts: jax.Array, length: int) -> np.ndarray:
    error = _position_errors(net, motor, data, starts, length)
    return np.sqrt(np.asarray((error**2).mean(axis=(0, 1)), dtype=float)) + 1e-9


def _initial_layers(key: jax.Array, joints: int, config: NetConfig) -> tuple[jax.Array, ...]:
    sizes = (INPUTS * (1 + len(MEMORY_S)), *config.hidden, 1)
    pairs = list(pairwise(sizes))
    keys = jax.random.split(key, len(pairs))
    layers = [
        jax.random.normal(each, (joints, a, b)) / np.sqrt(a) for each, (a, b) in zip(keys, pairs, strict=True)
    ]
    return (*layers[:-1], INITIAL_OUTPUT_SHARE * layers[-1])


def _train_once(
    start: ActuatorNet,
    motor: Motor,
    data: _Data,
    validation_data: _Data,
    checked_starts: jax.Array,
    law_rad: np.ndarray,
    length: int,
    config: NetConfig,
    seed: int,
) -> Trained:
    """One training: the net with the smallest error on the windows that begin at `checked_starts`."""
    key, layers_key = jax.random.split(jax.random.PRNGKey(seed))
    layers = _initial_layers(layers_key, len(law_rad), config)
    weights = layers, jnp.asarray(start.linear, dtype=jnp.float32)
    optimiser = optax.chain(
        optax.clip_by_global_norm(1.0),
        optax.adam(optax.cosine_decay_schedule(config.learning_rate, config.steps)),
    )
    state, unit_rad = optimiser.init(weights), jnp.asarray(law_rad, dtype=jnp.float32)

    def with_weights(weights: Any) -> ActuatorNet:
        return start._replace(layers=weights[0], linear=weights[1])

    def loss(weights: Any, starts: jax.Array) -> jax.Array:
        error = _position_errors(with_weights(weights), motor, data, starts, length) / unit_rad
        return optax.losses.huber_loss(error, delta=HUBER_WIDTH).mean()

    @jax.jit
    def gradient_steps(weights: Any, state: Any, key: jax.Array) -> tuple[Any, Any]:
        def gradient_step(carry: Any, key: jax.Array) -> tuple[Any, None]:
            weights, state = carry
            starts = data.starts[jax.random.randint(key, (config.windows,), 0, len(data.starts))]
            updates, state = optimiser.update(jax.grad(loss)(weights, starts), state, weights)
            return (optax.apply_updates(weights, updates), state), None

        keys = jax.random.split(key, config.check_every)
        return jax.lax.scan(gradient_step, (weights, state), keys)[0]

    validation_error: Callable[[Any], jax.Array] = jax.jit(
        lambda weights: _position_errors(
            with_weights(weights), motor, validation_data, checked_starts, length
        )
    )
    zero_layers = tuple(np.zeros(layer.shape) for layer in layers)
    zero_net = start._replace(layers=zero_layers, linear=np.zeros(start.linear.shape))
    best = Trained(zero_net, law_rad, law_rad, 0)
    for number in range(1, config.steps // config.check_every + 1):
        key, steps_key = jax.random.split(key)
        weights, state = gradient_steps(weights, state, steps_key)
        error = np.sqrt(np.asarray((validation_error(weights) ** 2).mean(axis=(0, 1)), dtype=float)) + 1e-9
        net = with_weights(jax.tree.map(partial(np.asarray, dtype=float), weights))
        trained = Trained(net, law_rad, error, number * config.check_every)
        best = min(best, trained, key=_score)
    return best
