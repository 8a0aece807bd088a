"""The digest changes with a robot's physics and with nothing else."""

import re
from collections.abc import Sequence
from pathlib import Path

from edited import edit

from footfall import Robot, load_robot
from footfall.robots.digest import digest
from footfall.robots.mjcf import load_spec


def not_counted(folder: Path, rows: Sequence[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Those of some edits (file, old and new text) that leave the digest as it is; each edit is undone."""
    before, found = load_robot(folder).digest, []
    for file, old, new in rows:
        text = (folder / file).read_text()
        edit(folder, file, old, new)
        if load_robot(folder).digest == before:
            found.append((file, old, new))
        (folder / file).write_text(text)
    return found


def with_each(text: str, *additions: str) -> list[tuple[str, str]]:
    """Edits that each add one of some attributes after a text."""
    return [(text, f"{text} {each}") for each in additions]


def all_count(folder: Path, *edits: tuple[str, str]) -> bool:
    """Whether each edit of robot.xml changes the digest."""
    return not not_counted(folder, [("robot.xml", *each) for each in edits])


JOINT = 'pos="0 0.01 0"', 'stiffness="1"', 'springref="0.1"'
LIMITS = 'margin="0.01"', 'solreflimit="0.03 1"', 'solimplimit="0.8 0.95 0.001"'
BITS = 'contype="3"', 'conaffinity="3"', 'solmix="0.7"'
CONTACT = 'margin="0.001"', 'gap="0.001"', 'solref="0.03 1"', 'solimp="0.8 0.95 0.001"'
TENDON = """<tendon>
  <fixed name="tie" limited="false" range="-1 1"><joint joint="FR_calf_joint" coef="1"/></fixed>
</tendon>"""
HIPS_TIED = '<equality><joint joint1="FR_hip_joint" joint2="RR_hip_joint" polycoef="0 1 0 0 0"/></equality>'
EXCLUDED = '<contact><exclude body1="trunk" body2="FR_calf"/></contact>'
NOT_COUNTED = (
    ("robot.yaml", "name: go1", "# a remark\nname: go1"),
    ("robot.yaml", "bus: can0, id: 1", "bus: can9, id: 7"),
    ("robot.yaml", "imu_bus: can0", "imu_bus: can3"),
    ("robot.yaml", "protocol: AK70-10", "protocol: AK10-9"),
    ("robot.yaml", "leftward_m_s: [-0.5", "leftward_m_s: [-0.6"),
    ("robot.xml", "<worldbody>", "<worldbody> <!-- here -->\n"),
    ("robot.xml", 'name="lens" rgba="0.10', 'name="lens" rgba="0.90'),
    ("robot.xml", 'size="0.13 0.075 0.038"', 'size="0.10 0.100 0.100"'),  # visual, without collisions
    ("robot.xml", 'mass="5.204"', 'mass="5.2040"'),
    ("robot.xml", '<body name="FR_hip"', '<geom size="0.01" class="visual"/><body name="FR_hip"'),
)
COUNTED = (
    ("robot.yaml", "default_rad: 0.9", "default_rad: 0.901"),
    ("robot.yaml", "speed_rad_s: 30.1", "speed_rad_s: 30"),
    ("robot.yaml", "damping_ratio: 1.0", "damping_ratio: 0.9"),
    ("robot.xml", 'mass="5.204"', 'mass="5.3"'),
    ("robot.xml", 'diaginertia="0.0716565', 'diaginertia="0.0716566'),
    ("robot.xml", 'quat="-0.003421 0.7', 'quat="-0.013421 0.7'),
    ("robot.xml", "-0.01592 -0.06659", "-0.01592 0.06659"),  # the IMU's position
    ("robot.xml", 'armature="0.00906"', 'armature="0.00907"'),
    ("robot.xml", 'frictionloss="1.0"', 'frictionloss="1.1"'),
    ("robot.xml", 'frictionloss="1.0"', 'frictionloss="1.0" damping="0.1"'),
    ("robot.xml", 'range="-2.818 -0.888"', 'range="-2.818 -0.889"'),
    ("robot.xml", 'size="0.13 0.09 0.05"', 'size="0.13 0.09 0.06"'),  # touches when the robot falls
    ("robot.xml", 'size="0.13 0.09 0.05"', 'size="0.13 0.09 0.05" quat="0.9 0.1 0 0"'),
    ("robot.xml", 'friction="0.8"', 'friction="0.9"'),
    ("robot.xml", 'impratio="10"', 'impratio="1"'),
    ("robot.xml", 'cone="elliptic"', ""),
    ("robot.xml", 'impratio="10"', 'impratio="10" gravity="0 0 -9.8"'),
    *(("robot.xml", *row) for row in with_each('<joint axis="0 1 0"', *JOINT, *LIMITS)),
    *(("robot.xml", *row) for row in with_each('size="0.023"', *BITS, *CONTACT)),
    ("robot.xml", 'condim="3" priority="1"', 'condim="4" priority="1"'),
    ("robot.xml", 'condim="3" priority="1"', 'condim="3" priority="2"'),
    ("robot.xml", '<joint axis="0 1 0"', '<joint axis="0 1 0.1"'),
    ("robot.xml", 'pos="0 -0.08 0"', 'pos="0 -0.081 0"'),
    ("robot.xml", 'pos="0 -0.08 0"', 'pos="0 -0.08 0" gravcomp="0.5"'),
    ("robot.xml", 'pos="0 -0.08 0"', 'pos="0 -0.08 0" euler="0 0 0.01"'),
    ("robot.xml", 'pos="-0.003047 0.019315', 'pos="-0.003047 0.019316'),
    ("robot.xml", "-0.00617", '-0.00617" euler="0 0.1 0'),  # the IMU's axes
    *(("robot.xml", "</mujoco>", constraint + "</mujoco>") for constraint in (HIPS_TIED, EXCLUDED, TENDON)),
)


def test_the_digest_depends_on_physics_not_on_names_and_looks(own_folder: Path) -> None:
    assert not_counted(own_folder, NOT_COUNTED) == list(NOT_COUNTED)
    assert not_counted(own_folder, COUNTED) == []


def test_names_of_the_file_and_of_geoms_do_not_count(go1: Robot, own_folder: Path) -> None:
    edit(own_folder, "robot.yaml", "model: robot.xml", "model: body.xml")
    edit(own_folder, "robot.yaml", "geoms: [FR_foot]", "geoms: [paw]")
    edit(own_folder, "robot.xml", 'name="FR_foot"', 'name="paw"')
    (own_folder / "robot.xml").rename(own_folder / "body.xml")
    assert load_robot(own_folder).digest == go1.digest


def test_feet_count_even_if_they_touch_nothing_in_the_mjcf(own_folder: Path) -> None:
    """Training lets them touch the floor."""
    edit(own_folder, "robot.xml", 'size="0.023"', 'size="0.023" contype="0" conaffinity="0"')
    assert all_count(own_folder, ('friction="0.8"', 'friction="0.9"'))


def test_included_files_count(go1: Robot, own_folder: Path) -> None:
    """A calf's mass is written in a file that robot.xml includes."""
    inertial = re.search(r'<inertial mass="0.195862".*?/>', (own_folder / "robot.xml").read_text(), re.DOTALL)
    assert inertial is not None
    (own_folder / "calf.xml").write_text(f"<mujocoinclude>{inertial[0]}</mujocoinclude>")
    edit(own_folder, "robot.xml", inertial[0], '<include file="calf.xml"/>')
    assert load_robot(own_folder).digest == go1.digest
    assert not_counted(own_folder, [("calf.xml", "0.195862", "0.25")]) == []


def test_the_last_bits_do_not_count(go1: Robot) -> None:
    """Another machine may round the last bits differently."""
    model = load_spec(go1.xml_path).compile()
    model.body_mass[1:] *= 1 + 4e-16
    model.body_ipos[:] += 1e-17
    model.body_pos[:] -= 1e-17
    model.body_quat[:] *= -1.0
    assert digest(go1.description, model) == go1.digest
    model.body_mass[1] *= 1 + 1e-7
    assert digest(go1.description, model) != go1.digest


def test_all_properties_of_tendons_and_constraints_count(own_folder: Path) -> None:
    edit(own_folder, "robot.xml", "</mujoco>", f"{TENDON}{HIPS_TIED}</mujoco>")
    losses = 'stiffness="1"', 'damping="1"', 'frictionloss="1"', 'springlength="0.1"'
    assert all_count(
        own_folder,
        *with_each('name="tie"', *losses),
        ('limited="false" range="-1 1"', 'limited="true" range="-1 1"'),
        ('limited="false" range="-1 1"', 'limited="false" range="-1 2"'),
        ('coef="1"', 'coef="2"'), ('joint="FR_calf', 'joint="FL_calf'), ('"0 1 0 0 0"', '"0 2 0 0 0"'),
        ('joint2="RR_hip', 'joint2="RL_hip'), ('joint1="FR_hip', 'joint1="FL_hip'),
        *with_each("<equality><joint", 'active="false"', 'solref="0.05 1"', 'solimp="0.8 0.9 0.01"'),
    )  # fmt: skip


def test_a_collision_mesh_counts_with_its_own_corners(own_folder: Path) -> None:
    """The first of two meshes is only visual. A smaller base touches the ground in other poses."""
    path = own_folder / "robot.yaml"
    path.write_text(re.sub(r"lying_rad: [-\d.]+, *", "", path.read_text()))
    meshes = """<mesh name="seen" vertex="0 0 0 0.1 0 0 0 0.1 0 0 0 0.1"/>
        <mesh name="shell" vertex="0 0 0 0.2 0 0 0 0.2 0 0 0 0.2"/>"""
    edit(own_folder, "robot.xml", "<asset>", f"<asset>{meshes}")
    box = '<geom class="collision" type="box" size="0.13 0.09 0.05"/>'
    geoms = '<geom type="mesh" mesh="seen"/><geom class="collision" type="mesh" mesh="shell"/>'
    edit(own_folder, "robot.xml", box, geoms)
    before = load_robot(own_folder).digest
    edit(own_folder, "robot.xml", "0.1 0 0 0 0.1 0", "0.1 0 0 0 0.15 0")
    assert load_robot(own_folder).digest == before
    edit(own_folder, "robot.xml", "0 0 0.2", "0 0.01 0.2")
    robot = load_robot(own_folder)
    assert robot.digest != before
    model = load_spec(robot.xml_path).compile()
    start = {name: model.mesh(name).vertadr[0] for name in ("seen", "shell")}
    model.mesh_vert[start["seen"]] += 0.01  # of the corners only, not of quantities derived from them
    assert digest(robot.description, model) == robot.digest
    model.mesh_vert[start["shell"] + model.mesh("shell").vertnum[0] - 1, 1] += 0.01
    assert digest(robot.description, model) != robot.digest


TAIL = """<body name="tail" pos="-0.3 0 0"><joint name="tail" axis="0 0 1" range="-1 1"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
  <geom class="collision" type="box" size="0.02 0.03 0.04"/>
  <body name="first" pos="0.01 0.02 0.03"><geom size="0.01" mass="0.1"/></body>
  <body name="second" pos="0.01 0.02 0.03"><geom name="end" class="collision" size="0.02" mass="0.1"/></body>
</body>"""


def test_limbs_without_a_motor_and_pairs_that_may_touch_count(own_folder: Path) -> None:
    edit(own_folder, "robot.xml", '<body name="FR_hip"', TAIL + '<body name="FR_hip"')
    pair = '<contact><pair geom1="FR_foot" geom2="FL_foot" condim="3"/></contact>'
    edit(own_folder, "robot.xml", "</mujoco>", pair + "</mujoco>")
    assert all_count(
        own_folder,
        ('name="tail" axis', 'name="tail" type="slide" axis'),
        ('type="box" size="0.02 0.03 0.04"', 'type="ellipsoid" size="0.02 0.03 0.04"'),
        ('size="0.02 0.03 0.04"', 'size="0.02 0.03 0.04" pos="0 0 0.01"'),
        ('geom1="FR_foot"', 'geom1="RR_foot"'),
        ('geom2="FL_foot"', 'geom2="end"'),
        ('geom2="FL_foot" condim="3"', 'geom2="FL_foot" condim="1"'),
        *with_each('geom2="FL_foot"', *CONTACT, 'friction="0.5"', 'solreffriction="0.05 1"'),
    )
    before = load_robot(own_folder).digest
    # The second part of the tail changes its parent and keeps its position in the parent's frame.
    edit(own_folder, "robot.xml", '/></body>\n  <body name="second"', '/><body name="second"')
    edit(own_folder, "robot.xml", 'size="0.02" mass="0.1"/></body>', 'size="0.02" mass="0.1"/></body></body>')
    assert load_robot(own_folder).digest != before
