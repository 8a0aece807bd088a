"""A robot's digest: a fingerprint of everything that a policy relies on."""

import hashlib
import json
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

from footfall.common.config import unstructure
from footfall.robots.actuator_net import ActuatorNet
from footfall.robots.robot_yaml import Description, MotorType

# Fields of the model that determine how the robot moves. Rotations and inertias are included as matrices.
# Only geoms that are feet or can touch something, by themselves or through a pair, are included.
BODIES = ("body_parentid", "body_mass", "body_pos", "body_ipos", "body_gravcomp")
JOINTS = (
    "jnt_type", "jnt_bodyid", "jnt_pos", "jnt_axis", "jnt_limited", "jnt_range", "jnt_stiffness",
    "jnt_solref", "jnt_solimp", "jnt_margin", "qpos_spring", "dof_armature", "dof_damping",
    "dof_frictionloss",
)  # fmt: skip
GEOMS = (
    "geom_type", "geom_bodyid", "geom_pos", "geom_size", "geom_friction", "geom_contype", "geom_conaffinity",
    "geom_condim", "geom_priority", "geom_solmix", "geom_solref", "geom_solimp", "geom_margin", "geom_gap",
)  # fmt: skip
PAIRS = (
    "pair_dim", "pair_friction", "pair_solref", "pair_solreffriction", "pair_solimp", "pair_margin",
    "pair_gap",
)  # fmt: skip
CONSTRAINTS = (
    "eq_type", "eq_obj1id", "eq_obj2id", "eq_active0", "eq_data", "eq_solref", "eq_solimp", "tendon_num",
    "tendon_stiffness", "tendon_damping", "tendon_frictionloss", "tendon_limited", "tendon_range",
    "tendon_lengthspring", "wrap_type", "wrap_objid", "wrap_prm", "exclude_signature",
)  # fmt: skip
# Optional effects of a motor: a field at its default is left out of the digest.
NOMINALLY_ABSENT = (
    "torque_bandwidth_hz", "stribeck_friction_nm", "stribeck_speed_rad_s", "load_friction", "backlash_rad",
    "gear_stiffness_nm_rad", "voltage_driven", "duty_resistance", "thermal_resistance_k_w",
    "thermal_capacity_j_k", "derating_c",
)  # fmt: skip
OPTIONS = ("gravity", "cone", "impratio")


def digest(description: Description, model: mujoco.MjModel, net: ActuatorNet | None = None) -> str:
    """The fingerprint of a robot, 16 hexadecimal digits.

    Args:
        description: the content of `robot.yaml`. Excluded, since no learned policy depends on them: the CAN
            map, the lying pose, how a run starts, the supervisor's limits, the battery, stop inputs, names
            of geoms and the commands of scenarios.
        model: the compiled MJCF with all included files. Excluded: layout, comments, names that `robot.yaml`
            does not use, visuals, sensors and actuators.
        net: the learned part of the joint law; the name of its file does not count.
    """
    sha = hashlib.sha256(json.dumps(_included(description), sort_keys=True).encode())
    for name, values in (*_figures(description, model), *_learned(net)):
        sha.update(f"\n{name} {' '.join(map(_text, np.ravel(values).tolist()))}".encode())
    return sha.hexdigest()[:16]


def _included(description: Description) -> Any:
    content = unstructure(description)
    for name in (
        "imu_bus",
        "imu_protocol",
        "actuator_net",
        "model",
        "commands",
        "safety",
        "held_start",
        "battery",
        "stop_inputs",
    ):
        del content[name]
    for joint in content["joints"]:
        del joint["bus"], joint["id"], joint["lying_rad"]
    for motor in content["motors"].values():
        for name in (
            "protocol",
            "temperature_limit_c",
            "voltage_v",
            "timeout_s",
            "watchdog_endpoints",
            "drive_gains",
            "drive_limit",
            "current_endpoint",
        ):
            del motor[name]
        for name in NOMINALLY_ABSENT:
            if motor[name] == MotorType.__dataclass_fields__[name].default:
                del motor[name]  # digests of motors without the effect stay as they were before it existed
    for foot in content["feet"]:
        del foot["geoms"], foot["force_bus"]  # `_figures` includes the geoms
    return content


def _figures(description: Description, model: mujoco.MjModel) -> Iterator[tuple[str, Any]]:
    """The parts of the model that the digest covers, by name, in a fixed order."""
    feet = [[model.geom(name).id for name in foot.geoms] for foot in description.feet]
    imu = model.site(description.imu).id
    yield "base", model.body(description.base).id
    yield "joints", [model.joint(joint.name).id for joint in description.joints]
    yield "imu", model.site_pos[imu]
    yield "imu_rotation", _rotation(model.site_quat[imu])
    for field in (*BODIES, *JOINTS):
        yield field, getattr(model, field)
    yield "body_rotation", [_rotation(quat) for quat in model.body_quat]
    yield (
        "body_inertia",
        [
            _rotation(quat) @ np.diag(principal) @ _rotation(quat).T
            for quat, principal in zip(model.body_iquat, model.body_inertia, strict=True)
        ],
    )
    touches = (model.geom_contype | model.geom_conaffinity) != 0
    touches[np.concatenate([*feet, model.pair_geom1, model.pair_geom2])] = True
    geoms = np.flatnonzero(touches)
    for foot, ids in zip(description.feet, feet, strict=True):
        yield f"foot {foot.name}", np.searchsorted(geoms, ids)
    for field in GEOMS:
        yield field, getattr(model, field)[geoms]
    yield "geom_rotation", [_rotation(quat) for quat in model.geom_quat[geoms]]
    for geom in geoms[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_MESH]:
        mesh = model.geom_dataid[geom]
        start = model.mesh_vertadr[mesh]
        yield "mesh_vert", model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
    if model.npair:
        yield "pairs", np.searchsorted(geoms, [model.pair_geom1, model.pair_geom2])
        for field in PAIRS:
            yield field, getattr(model, field)
    for field in CONSTRAINTS:
        yield field, getattr(model, field)
    for field in OPTIONS:
        yield field, getattr(model.opt, field)


def _learned(net: ActuatorNet | None) -> Iterator[tuple[str, Any]]:
    """The arrays of the learned part of the joint law."""
    if net is not None:
        yield from ((f"actuator_net layer {index}", layer) for index, layer in enumerate(net.layers))
        yield from (item for item in net._asdict().items() if item[0] != "layers")


def _rotation(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix, which is the same for q and -q."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _text(value: float) -> str:
    """Nine digits, 0 below 1e-12: the last bits depend on the compiler."""
    return f"{round(value, 12) + 0.0:.8e}"
