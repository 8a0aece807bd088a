"""Small, asymmetric robots in other makers' formats."""

from pathlib import Path
from tempfile import mkdtemp

from footfall.deploy.drivers.mit import RANGES
from footfall.policies.gaits import gaits_of
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.create import Imported, ImportRequest, import_robot
from footfall.robots.importer.read import read_source
from footfall.robots.importer.source import Source

HIPS = {"FL": (0.21, 0.11), "FR": (0.21, -0.11), "RL": (-0.24, 0.13), "RR": (-0.24, -0.13)}
BALL = '<collision><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.02"/></geometry></collision>'


def quadruped(
    *,
    knee_limit: str = "",
    knee_kind: str = "revolute",
    knee_extra: str = "",
    thigh: str = "",
    foot: str = BALL,
    shank_mass: float = 0.37,
    upside_down: bool = False,
) -> str:
    """A URDF: roll, hip and knee on each leg. Legs differ in mass; the link between roll and hip has none.

    The trunk carries a tilted box, an IMU, and an arm whose range does not contain zero.
    """
    parts = [
        _link("trunk", 5.3, '<collision><geometry><box size="0.3 0.16 0.1"/></geometry></collision>'),
        _link("box", 0.9, turn="0.3 -0.2 0.5"),
        '<link name="imu_link"/>',
        _link("arm_link", 0.4),
        _joint("box_fixed", "trunk", "box", "0.02 0.03 0.07", kind="fixed", turn="0.1 0.2 -0.4"),
        _joint("imu_fixed", "trunk", "imu_link", "0.03 -0.02 0.05", kind="fixed"),
        _joint("arm", "trunk", "arm_link", "0.2 0.01 0.1", limit='<limit lower="0.4" upper="2" effort="5"/>'),
    ]
    down = 1.0 if upside_down else -1.0
    for index, (leg, (x, y)) in enumerate(HIPS.items()):
        knee = knee_limit or f'<limit lower="-2.3{index}" upper="-0.4" effort="23" velocity="17"/>'
        at = f"0.01 0 {down * 0.2}"
        shank = foot.replace('"0 0 -0.2"', f'"0 0 {down * 0.2}"')
        bracket, knee_options = f"{leg}_bracket", {"kind": knee_kind, "extra": knee_extra}
        parts += [
            f'<link name="{bracket}"/>',
            _link(f"{leg}_thigh", 0.8 + 0.05 * index, thigh),
            _link(f"{leg}_shank", shank_mass, shank),
            _joint(f"{leg}_roll", "trunk", bracket, f"{x} {y} 0.01", axis="1 0 0", number=1, turn="0 0.1 0"),
            _joint(f"{leg}_hip", bracket, f"{leg}_thigh", "0.02 0.01 0", number=2, turn="0 -0.1 0"),
            _joint(f"{leg}_knee", f"{leg}_thigh", f"{leg}_shank", at, number=3, **knee_options, limit=knee),
        ]
    return f'<robot name="dog">{"".join(parts)}</robot>'


def _link(name: str, mass: float, collision: str = "", turn: str = "0.1 0 0.2") -> str:
    moments = {"ixx": 4e-3, "iyy": 5e-3, "izz": 3e-3, "ixy": 4e-4, "ixz": 0.0, "iyz": 0.0}
    attributes = " ".join(f'{name}="{mass * each}"' for name, each in moments.items())
    inertial = f'<inertial><origin xyz="0.01 -0.004 -0.05" rpy="{turn}"/><mass value="{mass}"/>'
    inertial += f"<inertia {attributes}/></inertial>"
    return f'<link name="{name}">{inertial}{collision}</link>'


def _joint(
    name: str,
    parent: str,
    child: str,
    at: str,
    *,
    kind: str = "revolute",
    axis: str = "0 1 0",
    limit: str = "",
    number: int = 0,
    turn: str = "0 0 0",
    extra: str = "",
) -> str:
    limit = limit or f'<limit lower="-1.{number}" upper="1.4" effort="2{number}" velocity="{14 + number}"/>'
    losses = f'<dynamics damping="0.1{number}" friction="0.2{number}"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{at}" rpy="{turn}"/>'
    inside = "" if kind == "fixed" else f'<axis xyz="{axis}"/>{limit}{losses}{extra}'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def _leg(side: str, y: float, roll: str) -> str:
    return f"""
    <body name="{side}_hip_link" pos="0 {y} -0.05">
      <joint name="{side}_yaw" axis="0 0 1" range="-0.5 0.5"/>
      <joint name="{side}_roll" axis="1 0 0" range="{roll}"/>
      <joint name="{side}_hip" axis="0 1 0" range="-1.8 0.6"/>
      <geom type="capsule" fromto="0 0 -0.05 0 0 -0.3" size="0.05" mass="2.1"/>
      <body name="{side}_shin" pos="0 0 -0.35">
        <joint name="{side}_knee" axis="0 1 0" range="0 2.2" armature="0.03"/>
        <geom type="capsule" fromto="0 0 -0.05 0 0 -0.27" size="0.04" mass="1.3"/>
        <body name="{side}_foot" pos="0 0 -0.33">
          <joint name="{side}_ankle" axis="0 1 0" range="-0.9 0.8" actuatorfrcrange="-50 50"/>
          <joint name="{side}_ankle_roll" axis="1 0 0" range="-0.4 0.4"/>
          <geom type="box" pos="0.03 0 -0.045" size="0.12 0.05 0.015" mass="0.6"/>
        </body>
      </body>
    </body>"""


def _motors(side: str) -> str:
    geared = f'<motor joint="{side}_hip" gear="40" ctrlrange="-1.5 1.5"/>'
    bounded = f'<position joint="{side}_knee" kp="300" forcerange="-70 70"/>'
    parts = ("yaw", "roll", "ankle", "ankle_roll")
    other_motors = (f'<motor joint="{side}_{part}" ctrlrange="-60 60"/>' for part in parts)
    return geared + bounded + "".join(other_motors)


BIPED_MJCF = f"""
<mujoco model="walker">
  <compiler angle="radian" autolimits="true"/>
  <default><joint armature="0.02" damping="0.4"/></default>
  <worldbody>
    <geom name="ground" type="plane" size="5 5 1"/>
    <body name="pelvis" pos="0 0 1">
      <freejoint name="root"/>
      <geom type="box" size="0.08 0.12 0.1" pos="0.01 0 0.1" mass="9"/>
      {_leg("left", 0.1, "-0.3 0.6")}
      {_leg("right", -0.1, "-0.6 0.3")}
    </body>
  </worldbody>
  <actuator>{_motors("left")}{_motors("right")}</actuator>
</mujoco>
"""


def read(tmp_path: Path, text: str) -> Source:
    path = tmp_path / "m.xml"
    path.write_text(text)
    return read_source(path)


def make(tmp_path: Path, text: str, **options: object) -> tuple[Robot, Imported]:
    """Write a model, import it, and load the result, in a folder of its own."""
    folder = Path(mkdtemp(dir=tmp_path))
    (folder / "m.xml").write_text(text)
    request = ImportRequest(folder / "m.xml", folder / "made", RANGES, **{"gaits_of": gaits_of, **options})
    made = import_robot(request)
    return load_robot(made.folder), made


def limb(name: str, y: float, length: float, inner: str = "") -> str:
    """A limb of one hinge with a sphere at its end."""
    return f"""<body name="{name}" pos="0 {y} 0"><joint name="{name}_joint" axis="0 1 0" range="-1 1"/>
      <geom name="{name}_sphere" size="0.02" pos="0 0 {0.02 - length}" mass="0.3"/>{inner}</body>"""


def on_base(*limbs: str, extra: str = "") -> str:
    return f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
      <body name="base" pos="0 0 2"><freejoint/><geom size="0.1" mass="3"/>{"".join(limbs)}</body>
      </worldbody>{extra}</mujoco>"""


UNUSUAL_LEG = """<body name="{0}_hip" pos="0.1 {1} 0" euler="0.1 0.2 {2}">
  <joint name="{0}_roll" axis="1 0.1 0" pos="0.01 0.02 -0.03" ref="0.3" range="-0.6 0.9" damping="0.3"/>
  <joint name="{0}_pitch" axis="0 1 0.1" pos="0 -0.01 0.02" range="-1.2 1" frictionloss="0.4"/>
  <geom type="capsule" fromto="0 0 0 0.02 0 -0.2" size="0.03" mass="1.1"/>
  <body name="{0}_bracket" pos="0.02 0 -0.2" euler="0.3 0 0.2"><geom size="0.01" mass="0.1"/>
    <body name="{0}_shank" pos="0.01 0.01 0" euler="0 1.2 0">
      <joint name="{0}_knee" axis="0 1 0" ref="-0.5" range="-2 -0.1"/>
      <geom type="box" pos="0.1 0 0" size="0.1 0.01 0.02" mass="0.5" euler="0.1 0 0"/>
      <body name="{0}_foot" pos="0.22 0 0" euler="0.2 0.1 0.3">
        <geom name="{0}_sphere" size="0.025" pos="0.01 0 0" mass="0.07" friction="1.3"
          contype="2" conaffinity="5"/>
      </body></body></body></body>"""
UNUSUAL = f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="stand" pos="9 9 9"><joint name="crank"/><geom size="0.3" mass="7"/></body>
  <body name="pelvis" pos="0.3 0.2 1" euler="0.3 -0.2 0.9"><freejoint/>
    <geom type="box" size="0.1 0.05 0.08" mass="4"/>
    <body name="mount" pos="0.05 0.01 0.1" euler="0 0.5 0"><geom size="0.03" mass="0.4"/>
      <site name="My_IMU" pos="0.02 0 0.01"/><body name="imu_box" pos="1 1 1"/></body>
    <body name="chest" pos="0 0 0.2"><joint name="waist" axis="0 0 1" range="0.2 1"/>
      <geom size="0.1" mass="2"/>
      <body name="arm" pos="0 0.3 0"><joint name="arm" axis="0 1 0" range="0.4 2"/>
        <geom name="hand" size="0.04" pos="0.2 0 0" mass="0.6"/></body>
      {UNUSUAL_LEG.format("l", 0.1, 0.4)}{UNUSUAL_LEG.format("r", -0.1, -0.3)}</body>
  </body></worldbody></mujoco>"""
