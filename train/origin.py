"""Where a fine-tuning starts: the networks of another run's checkpoint, or of an exported policy.

The file is copied into the run folder (`Run.start`), so that the run stands by itself.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.envs.make import make_environment
from footfall.policies.contract import Contract, Gait
from footfall.robots.description import load_robot
from footfall.train.config import PpoConfig
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Origin, Run, open_run

EXPORTED = ".onnx"
# Notes of a start: what is copied and what is not, one line each.
_FRESH = "the optimiser, the schedules and the curriculum start afresh"
CHECKPOINT_COPIED = ("actor, its noise, critic and normaliser are copied", _FRESH)
CRITIC_NOT_COPIED = (
    "actor, its noise and normaliser are copied",
    "the critic starts from the seed: it observes something else",
    _FRESH,
)
POLICY_COPIED = (
    "actor and normaliser are copied; its noise is the preset's",
    "the critic starts from the seed: an exported policy has none",
    _FRESH,
)
# Fields of a contract that must be equal, since they define inputs and outputs; fields that may differ.
MUST_EQUAL = ("joints", "control_rate_hz", "observation", "gait", "version")
MAY_CHANGE = (
    "robot",
    "digest",
    "default_pose_rad",
    "action_scale_rad",
    "kp",
    "kd",
    "commands",
    "standing_command",
)


class Source(NamedTuple):
    """Networks to start from."""

    file: Path
    contract: Contract
    hidden_dims: tuple[int, ...]  # of the actor

    @property
    def origin(self) -> Origin:
        """The record of this source in run.yaml."""
        sha = hashlib.sha256(self.file.read_bytes()).hexdigest()
        return Origin(str(self.file.resolve()), sha, self.contract.robot, self.contract.digest)


class Exported(NamedTuple):
    """The actor in an exported policy, float32."""

    mean: np.ndarray  # (observation,)
    std: np.ndarray  # (observation,)
    layers: tuple[tuple[np.ndarray, np.ndarray], ...]  # kernel (inputs, outputs) and bias, in order


def find_source(path: Path, trainer: str) -> Source:
    """The networks in a run folder, or in an ONNX file.

    Args:
        path: the run folder or the file.
        trainer: the new training's. If another trainer made the run, its exported policy is used.

    Raises:
        UserError: there are none.
    """
    if (path / "run.yaml").is_file():
        run = open_run(path)
        newest = checkpoint.latest(run.checkpoints)
        if newest is not None and run.provenance.trainer == trainer:
            return Source(newest, _contract(run), tuple(run.config.ppo.actor_hidden_dims))
        path = run.policy
    if not path.is_file():
        raise UserError(f"--from {path}: no such run folder, .onnx file or policy of the zoo")
    contract = _exported_contract(path)
    return Source(path, contract, tuple(len(bias) for _, bias in read_exported(path).layers[:-1]))


def _contract(run: Run) -> Contract:
    """The exported policy's contract; without a policy, that of the run's settings and the current robot."""
    if run.policy.is_file():
        return _exported_contract(run.policy)
    return make_environment(load_robot(run.provenance.robot), run.config.env).contract


def _exported_contract(path: Path) -> Contract:
    from footfall.policies.learned import open_network  # ONNX Runtime is needed for a policy's file only

    return open_network(path)[1]


def read_exported(path: Path) -> Exported:
    """The actor in a policy that footfall exported.

    Raises:
        UserError: the file holds another kind of network.
    """
    import onnx
    from onnx import numpy_helper

    parts = {each.name: numpy_helper.to_array(each) for each in onnx.load(path).graph.initializer}
    try:
        count = sum(name.startswith("kernel_") for name in parts)
        layers = tuple((parts[f"kernel_{i}"], parts[f"bias_{i}"]) for i in range(count))
        return Exported(parts["mean"], parts["std"], layers)
    except KeyError as error:
        raise UserError(f"{path} was not exported by footfall: it has no {error.args[0]}") from None


def check_source(source: Source, contract: Contract, ppo: PpoConfig) -> list[str]:
    """Names of the contract's fields that change and that the networks can adapt to.

    Args:
        source: the networks.
        contract: the new training's.
        ppo: the new training's settings.

    Raises:
        UserError: observations or actions differ in meaning, or the networks in size.
    """
    differing = [name for name in MUST_EQUAL if getattr(source.contract, name) != getattr(contract, name)]
    details = [f"{name} ({', '.join(_differences(name, source.contract, contract))})" for name in differing]
    if source.hidden_dims != tuple(ppo.actor_hidden_dims):
        details.append(
            f"ppo.actor_hidden_dims ({list(source.hidden_dims)} there, {list(ppo.actor_hidden_dims)} here)"
        )
    if details:
        raise UserError(f"cannot start from {source.file}: {'; '.join(details)} differ")
    return [name for name in MAY_CHANGE if getattr(source.contract, name) != getattr(contract, name)]


def _differences(name: str, old_contract: Contract, new_contract: Contract) -> Iterator[str]:
    """Differences of a field: entries that only one side has, or both values."""
    old, new = getattr(old_contract, name), getattr(new_contract, name)
    if isinstance(old, Gait) and isinstance(new, Gait):
        yield from (f"its {part}" for part in vars(old) if getattr(old, part) != getattr(new, part))
        return
    if not isinstance(old, tuple):
        old_text, new_text = ("a clock" if isinstance(each, Gait) else each for each in (old, new))
        yield f"{old_text} there, {new_text} here"
        return
    only_old = [_name(each) for each in old if each not in new]
    only_new = [_name(each) for each in new if each not in old]
    yield from (f"{each} there" for each in only_old)
    yield from (f"{each} here" for each in only_new)
    if not only_old and not only_new:
        yield "another order"


def _name(entry: object) -> str:
    history = getattr(entry, "history", 1)
    name = str(getattr(entry, "name", entry))
    return f"{name} with history {history}" if history > 1 else name
