"""A robot folder of the iCub of a recording: its legs from the URDF, its soles, and its IMU on the pelvis.

Arms and head do not move: only the legs' joints stay. Limits of motors are placeholders, since nothing is
commanded.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import yaml

from footfall.robots.description import Robot, load_robot

JOINTS = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
SIDES = ("l", "r")
NAMES = tuple(f"{side}_{joint}" for side in SIDES for joint in JOINTS)
BASE, IMU = "root_link", "root_link_imu_frame"
HEEL_M, TOE_M, HALF_WIDTH_M = -0.05, 0.115, 0.035  # extent of a sole's skin
BALL_M = 0.001  # radius of the sphere at each corner of a sole


def icub(urdf: Path, pose: np.ndarray, folder: Path) -> Robot:
    """Write the folder and load it.

    Args:
        urdf: the recording's model.
        pose: default pose of the legs, rad, (12,), in the order of `NAMES`.
        folder: output folder.
    """
    spec = _legs(urdf)
    for body in spec.bodies:
        for side in SIDES:
            if body.name == f"{side}_sole":
                for corner, (x, y) in enumerate(
                    (x, y) for x in (HEEL_M, TOE_M) for y in (-HALF_WIDTH_M, HALF_WIDTH_M)
                ):
                    body.add_geom(
                        name=f"{side}_corner_{corner}",
                        type=mujoco.mjtGeom.mjGEOM_SPHERE,
                        size=[BALL_M, 0, 0],
                        pos=[x, y, BALL_M],
                        mass=0.0,
                    )
    model = spec.compile()
    (folder / "robot.xml").write_text(spec.to_xml())
    (folder / "robot.yaml").write_text(yaml.safe_dump(_description(_standing_height(model, pose), pose)))
    return load_robot(folder)


def imu_rotation(robot: Robot) -> np.ndarray:
    """Rotation from the IMU's axes to the base's, (3, 3)."""
    model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, model.site("imu").quat)
    return rotation.reshape(3, 3)


def _legs(urdf: Path) -> mujoco.MjSpec:
    root = ET.parse(urdf).getroot()
    for link in root.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)
    for part in root.findall("joint") + root.findall("link"):  # an empty link above the pelvis
        if part.get("name") == "base_link" or part.find("parent[@link='base_link']") is not None:
            root.remove(part)
    for joint in root.findall("joint"):
        if joint.get("type") != "fixed" and joint.get("name") not in NAMES:
            joint.set("type", "fixed")
    extension = ET.SubElement(root, "mujoco")
    ET.SubElement(
        extension,
        "compiler",
        fusestatic="false",
        balanceinertia="true",
        boundmass="1e-6",
        boundinertia="1e-9",
    )
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    base = next(body for body in spec.bodies if body.name == BASE)
    if not base.joints:
        base.add_freejoint()
    frame = next(body for body in spec.bodies if body.name == IMU)
    base.add_site(name="imu", pos=frame.pos, quat=frame.quat)
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            joint.armature, joint.frictionloss = 0.01, 0.0
    return spec


def _standing_height(model: mujoco.MjModel, pose: np.ndarray) -> float:
    data = mujoco.MjData(model)
    for name, angle in zip(NAMES, pose, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    lowest = min(data.geom_xpos[geom][2] for geom in range(model.ngeom)) - BALL_M
    return float(data.body(BASE).xpos[2] - lowest)


def _description(standing_height_m: float, pose: np.ndarray) -> dict:
    motor = {
        "peak_torque_nm": 60.0,
        "stall_torque_nm": 60.0,
        "no_load_speed_rad_s": 8.0,
        "friction_speed_rad_s": 0.2,
        "gear_ratio": 100.0,
        "torque_constant_nm_a": 0.1,
        "winding_resistance_ohm": 0.1,
        "protocol": "AK10-9",
    }
    return {
        "name": "icub",
        "model": "robot.xml",
        "base": BASE,
        "imu": "imu",
        "standing_height_m": round(standing_height_m, 5),
        "gains": {"natural_frequency_hz": 8.0, "damping_ratio": 1.0, "torque_share": 0.3},
        "soft_limit_factor": 1.0,
        "target_rate_rad_s": 5.0,
        "motors": {"leg": motor},
        "joints": [
            {"name": name, "motor": "leg", "default_rad": float(angle), "bus": "can0", "id": number}
            for number, (name, angle) in enumerate(zip(NAMES, pose, strict=True), 1)
        ],
        "feet": [
            {
                "name": side,
                "geoms": [f"{side}_corner_{corner}" for corner in range(4)],
                "joints": [f"{side}_{joint}" for joint in JOINTS],
            }
            for side in SIDES
        ],
        "imu_bus": "can0",
        "commands": {"forward_m_s": [-0.2, 0.2], "leftward_m_s": [-0.1, 0.1], "yaw_rad_s": [-0.3, 0.3]},
    }
