"""The result of an episode, with samples of the walking phase at a fixed rate."""

from dataclasses import dataclass, field

import numpy as np

from footfall.deploy.session import SessionResult


@dataclass(frozen=True)
class Trace(SessionResult):
    """T samples of the walking phase: ground truth, except estimates, commands and targets."""

    fell: bool
    fall_reason: str  # empty if the robot did not fall
    distance_m: float  # see plant.progress
    mean_velocity: np.ndarray  # (3,) m/s, body frame
    record_rate_hz: float
    time_s: np.ndarray  # (T,) since walking began
    command: np.ndarray  # (T, 3) forward m/s, leftward m/s, yaw rad/s, before limits
    base_position: np.ndarray  # (T, 3) m, world
    base_quaternion: np.ndarray  # (T, 4) w x y z, body to world
    base_velocity: np.ndarray  # (T, 3) m/s, body frame
    base_angular_velocity: np.ndarray  # (T, 3) rad/s, body frame
    joint_position: np.ndarray  # (T, n) rad
    joint_velocity: np.ndarray  # (T, n) rad/s
    motor_torque: np.ndarray  # (T, n) N m at the joint, before gearbox friction
    joint_target: np.ndarray  # (T, n) rad, position targets that were sent
    foot_position: np.ndarray  # (T, feet, 3) m, world
    foot_contact: np.ndarray  # (T, feet) bool
    foot_velocity: np.ndarray  # (T, feet, 3) m/s, world
    foot_force: np.ndarray  # (T, feet) N, normal
    legs_touch: np.ndarray  # (T,) bool, two different legs press on each other
    qpos: np.ndarray  # (T, nq) of the plant's model, for rendering
    estimated_velocity: np.ndarray  # (T, 3) m/s, body frame; NaN without an estimator
    estimated_height: np.ndarray  # (T,) m
    electrical_power: np.ndarray  # (T,) W, mean since the previous sample: shaft power and copper loss
    mechanical_power: np.ndarray  # (T,) W, mean
    positive_power: np.ndarray  # (T,) W, mean of each motor's power where it is positive


@dataclass
class Recorder:
    """Collects samples, then stacks them into the arrays of a trace."""

    joints: int
    feet: int
    nq: int
    rows: dict[str, list] = field(default_factory=dict)

    def add(self, **values: object) -> None:
        for name, value in values.items():
            self.rows.setdefault(name, []).append(value)

    def arrays(self) -> dict[str, np.ndarray]:
        """All samples by name; empty arrays of the right width if there are none."""
        if self.rows:
            return {name: np.array(rows) for name, rows in self.rows.items()}
        n, feet = self.joints, self.feet
        widths: dict[str, tuple[int, ...]] = {
            **dict.fromkeys(_SCALARS, ()),
            **dict.fromkeys(_VECTORS, (3,)),
            **dict.fromkeys(_JOINTS, (n,)),
            "base_quaternion": (4,),
            "foot_position": (feet, 3),
            "foot_velocity": (feet, 3),
            "foot_contact": (feet,),
            "foot_force": (feet,),
            "qpos": (self.nq,),
        }
        return {
            name: np.zeros((0, *width), dtype=bool if name in _FLAGS else float)
            for name, width in widths.items()
        }


_SCALARS = (
    "time_s",
    "estimated_height",
    "electrical_power",
    "mechanical_power",
    "positive_power",
    "legs_touch",
)
_FLAGS = frozenset({"foot_contact", "legs_touch"})
_VECTORS = (
    "command",
    "base_position",
    "base_velocity",
    "base_angular_velocity",
    "estimated_velocity",
)
_JOINTS = ("joint_position", "joint_velocity", "motor_torque", "joint_target")
