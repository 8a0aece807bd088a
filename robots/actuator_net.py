"""A learned part of the joint law: torque that the physical law lacks (`footfall identify net`).

A small network of each joint reads the position error, the joint velocity and the torque of the physical law:
now, and as a short memory of each. Written once, for both NumPy and JAX arrays, as the joint law is.

After Hwangbo et al., Science Robotics 4 (2019), eaau5872, whose network reads a history of position errors
and velocities. Here first-order low-passes stand for the history, so that the length of a physics step does
not matter, and the network adds to the physical law, so that limits, gains and friction keep their meaning.
"""

from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from footfall.common.arrays import library
from footfall.common.errors import UserError
from footfall.robots.actuator import JointCommand

Array = Any  # a NumPy or a JAX array

INPUTS = 3  # position error, velocity, torque
KERNEL = "kernel_"  # prefix of the names of the layers' arrays in a file
ARRAYS = ("linear", "memory_s", "scale", "limit_nm")  # names of the other arrays


class ActuatorNet(NamedTuple):
    """Networks of n joints. Layers have no biases, so that both directions are equal, and rest stays rest."""

    layers: tuple[Array, ...]  # two kernels (n, inputs, outputs) at least; the last one has 1 output
    linear: Array  # (n, inputs, 1) kernel from the first inputs to the last output
    memory_s: np.ndarray  # (m,) time constants of the low-passes, s
    scale: Array  # (n, INPUTS) rad, rad/s, N m: typical sizes of the inputs
    limit: Array  # (n,) N m, the largest torque that is added; 0 for a joint without network

    @property
    def joints(self) -> int:
        """Number of joints, n."""
        return int(self.limit.shape[0])

    def of(self, joints: np.ndarray) -> "ActuatorNet":
        """The networks of some joints, by their indices."""
        layers = tuple(layer[joints] for layer in self.layers)
        rest = {name: getattr(self, name)[joints] for name in ("linear", "scale", "limit")}
        return self._replace(layers=layers, **rest)

    def rest(self, lead: tuple[int, ...] = ()) -> np.ndarray:
        """The memory of motors at rest, (*lead, n, m, INPUTS)."""
        return np.zeros((*lead, self.joints, len(self.memory_s), INPUTS))


class Learned(NamedTuple):
    """Results of the networks for one physics step."""

    torque: Array  # (..., n) N m, to be added at the joints
    damping: Array  # (..., n) N m s/rad, at least 0: minus its slope in the current velocity
    memory: Array  # (..., n, m, INPUTS) at the end of the step


def inputs_of(
    net: ActuatorNet, command: JointCommand, position: Array, velocity: Array, torque: Array
) -> Array:
    """The current inputs of the networks, in units of their scales, (..., n, INPUTS).

    Args:
        net: the networks.
        command: command to the motors. A command without stiffness has no position error.
        position: joint positions as the encoders measure them, rad, (..., n).
        velocity: joint velocities, rad/s.
        torque: torque of the physical law, N m, before friction.
    """
    xp = library(velocity)
    error = xp.where(command.kp > 0.0, command.position - position, 0.0)
    return xp.stack([error, velocity, torque], axis=-1) / net.scale


def learned_torque(net: ActuatorNet, inputs: Array, memory: Array, step_s: float) -> Learned:
    """The torque that the physical law lacks in one physics step.

    Args:
        net: the networks.
        inputs: see `inputs_of`, (..., n, INPUTS).
        memory: low-passed inputs at the beginning of the step, (..., n, m, INPUTS).
        step_s: length of the step. The low-passes are exact for inputs that are constant over it.
    """
    xp = library(inputs)
    features = xp.concatenate([inputs[..., None, :], memory], axis=-2)
    signal = hidden = features.reshape(*features.shape[:-2], 1, -1)  # (..., n, 1, inputs)
    *layers, last = net.layers
    slope = None  # of a layer's outputs in the current velocity
    for layer in layers:
        hidden = xp.tanh(xp.matmul(hidden, layer))
        slope = (1.0 - hidden * hidden) * (layer[:, 1:2] if slope is None else xp.matmul(slope, layer))
    output = xp.tanh(xp.matmul(hidden, last) + xp.matmul(signal, net.linear))
    slope = (1.0 - output * output) * (xp.matmul(slope, last) + net.linear[:, 1:2])
    damping = -net.limit * slope[..., 0, 0] / net.scale[:, 1]
    decay = np.exp(-float(step_s) / net.memory_s)[:, None]
    now = inputs[..., None, :]
    return Learned(net.limit * output[..., 0, 0], xp.maximum(damping, 0.0), now + decay * (memory - now))


def save_net(path: Path, net: ActuatorNet, joints: tuple[str, ...]) -> None:
    """Write networks as plain arrays (NPZ). The file must not exist."""
    arrays = {f"{KERNEL}{index}": np.asarray(layer) for index, layer in enumerate(net.layers)}
    arrays |= {name: np.asarray(values) for name, values in zip(ARRAYS, net[1:], strict=True)}
    with path.open("xb") as file:
        np.savez(file, allow_pickle=False, joints=np.array(joints), **arrays)


def load_net(path: Path, joints: tuple[str, ...]) -> ActuatorNet:
    """Read networks.

    Args:
        path: NPZ of `save_net`.
        joints: names of the robot's joints, in joint order.

    Raises:
        UserError: there is no such file, or it does not fit the robot.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files}
        count = sum(name.startswith(KERNEL) for name in found)
        layers = tuple(found[f"{KERNEL}{index}"].astype(float) for index in range(count))
        net = ActuatorNet(layers, *(found[name].astype(float) for name in ARRAYS))
        names = tuple(found["joints"].tolist())
    except (OSError, KeyError, ValueError) as error:
        raise UserError(f"{path} is not a file of 'footfall identify net': {error}") from None
    if names != joints:
        raise UserError(f"{path} was learned for other joints than the robot's: {', '.join(map(str, names))}")
    if reason := _misfit(net, len(joints)):
        raise UserError(f"{path}: {reason}")
    return net


def _misfit(net: ActuatorNet, joints: int) -> str:
    """Why the arrays are not networks of this many joints; empty if they are."""
    sizes = [INPUTS * (1 + net.memory_s.size), *(layer.shape[-1] for layer in net.layers)]
    shapes = [(joints, *pair) for pair in pairwise(sizes)]
    fits = net.linear.shape == (joints, sizes[0], 1) and sizes[-1] == 1 and net.memory_s.ndim == 1
    if len(shapes) < 2 or [layer.shape for layer in net.layers] != shapes or not fits:
        return "the shapes of its layers do not fit each other"
    if net.scale.shape != (joints, INPUTS) or net.limit.shape != (joints,):
        return "scale or limit_nm has another shape than its joints"
    if not all(np.isfinite(each).all() for each in (*net.layers, *net[1:])):
        return "it has values that are not finite"
    if (net.memory_s <= 0.0).any() or (net.scale <= 0.0).any() or (net.limit < 0.0).any():
        return "memory_s and scale must be positive, limit_nm not negative"
    return ""
