"""A learned policy: an ONNX network with its contract."""

from pathlib import Path

import numpy as np

from footfall.common.errors import UserError
from footfall.policies.action import joint_target
from footfall.policies.contract import CONTRACT_KEY, TRAINER_KEY, Contract
from footfall.policies.observation import (
    Inputs,
    history_length,
    observation,
    observation_size,
    push_history,
    size_per_step,
    step_values,
    term_sources,
)
from footfall.policies.onnx_runtime import onnxruntime
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.readings import read


def open_network(path: Path) -> tuple[onnxruntime.InferenceSession, Contract]:
    """Open an exported policy on one thread.

    Raises:
        UserError: the file is missing, is not ONNX, has no contract, or its sizes contradict the contract.
    """
    if not path.is_file():
        raise UserError(f"no policy file at {path}")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors share no base class below Exception
        reason = " ".join(str(error).split())
        raise UserError(f"{path} is not a readable ONNX file: {reason}") from None
    text = session.get_modelmeta().custom_metadata_map.get(CONTRACT_KEY)
    if text is None:
        raise UserError(f"{path} has no footfall contract: export it with 'footfall export RUN'")
    contract = Contract.from_json(text, str(path))
    for kind, found, expected in (
        ("input", session.get_inputs(), observation_size(contract)),
        ("output", session.get_outputs(), len(contract.joints)),
    ):
        if len(found) != 1 or found[0].shape[-1] != expected:
            raise UserError(f"{path}: its {kind} must be one vector of {expected} (see its contract)")
    return session, contract


class LearnedPolicy:
    """Runs an exported network: readings to observation, observation to action, action to joint targets."""

    needs_estimate = False
    notes = ()

    def __init__(self, path: Path, robot: Robot, name: str | None = None) -> None:
        """Raises UserError if the file is not a policy or does not fit the robot; the message lists the
        differences."""
        self._session, self.contract = open_network(path)
        differences = self.contract.mismatches(robot)
        if differences:
            trained_for = self.contract.robot
            hint = f" (add --robot {trained_for}: the policy was trained for it)"
            hint = "" if trained_for == robot.name else hint
            raise UserError(f"{path} does not fit robot '{robot.name}': {'; '.join(differences)}{hint}")
        self.name = name or path.stem
        self.trainer = self._session.get_modelmeta().custom_metadata_map.get(TRAINER_KEY)
        self.rate_hz = self.contract.control_rate_hz
        self._input = self._session.get_inputs()[0].name
        self._kp, self._kd = np.asarray(self.contract.kp), np.asarray(self.contract.kd)
        self._zeros = np.zeros(len(self.contract.joints))
        self._sources = term_sources(self.contract)
        shape = history_length(self.contract), size_per_step(self.contract)  # of the history
        # Indices of an observation's values in the history: computed once, so that each step needs one
        # look-up.
        self._indices = observation(np.arange(np.prod(shape)).reshape(shape), self.contract)
        self._begin()
        self._dry_run(path)  # the first call is slow, so it must not be the first of a run

    def _dry_run(self, path: Path) -> None:
        """Raises UserError for a network that does not run, or whose output is not finite and of the right
        shape."""
        try:
            action = self.network(self.observed)
        except Exception as error:  # ONNX Runtime's errors share no base class below Exception
            raise UserError(f"{path}: its network does not run: {' '.join(str(error).split())}") from None
        if action.dtype != np.float32 or action.shape != self._zeros.shape:
            raise UserError(
                f"{path}: its network returns {action.dtype} of shape {action.shape},"
                f" expected float32 of shape {self._zeros.shape}"
            )
        if not np.isfinite(action).all():
            raise UserError(f"{path}: its network returns NaN or infinity for an observation of zeros")

    def network(self, observed: np.ndarray) -> np.ndarray:
        """Action for one observation, float32: (observation_size,) to (n,)."""
        return self._session.run(None, {self._input: observed[None]})[0][0]

    def reset(self, inputs: PolicyInput) -> None:
        """Start an episode: zero last action, clock at zero, empty history."""
        self._begin()

    def _begin(self) -> None:
        self._action = np.zeros(len(self.contract.joints), dtype=np.float32)
        self._history: np.ndarray | None = None
        self._steps = 0
        self.observed = np.zeros(observation_size(self.contract), dtype=np.float32)

    def act(self, inputs: PolicyInput) -> JointCommand:
        """Position targets with the contract's gains, arrays of shape (n,)."""
        contract = self.contract
        phase = np.array([self._phase()])
        readings = read(inputs.sensed)
        sources = Inputs(readings, self._action, inputs.command, phase, inputs.height_scan)
        newest = step_values(sources, contract, self._sources)
        if self._history is None:
            self._history = np.tile(newest, (history_length(contract), 1))
        else:
            self._history = push_history(self._history, newest)
        self.observed = self._history.ravel()[self._indices].astype(np.float32)
        self._action = self.network(self.observed)
        self._steps += 1
        target = joint_target(self._action.astype(np.float64), phase, inputs.command, contract)
        return JointCommand(target, self._zeros, self._kp, self._kd, self._zeros)

    @property
    def action(self) -> np.ndarray:
        """Last action, shape (n,)."""
        return self._action

    def stance(self) -> None:
        """A learned policy has no contact plan."""
        return None

    def _phase(self) -> float:
        gait = self.contract.gait
        return 0.0 if gait is None else self._steps * gait.frequency_hz / self.rate_hz % 1.0
