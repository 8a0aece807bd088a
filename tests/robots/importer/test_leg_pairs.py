"""Capsule pairs of an imported robot."""

from pathlib import Path

from foreign_robots import on_base, read

from footfall.deploy.drivers.mit import RANGES
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.create import ImportRequest, import_robot
from footfall.robots.importer.leg_pairs import LegPairs, with_leg_pairs
from footfall.robots.importer.pose import standing_pose
from footfall.robots.importer.shapes import Kind
from footfall.robots.model import training_model


def walker(*hips: tuple[str, float, float]) -> str:
    """A robot with legs of two links of 0.2 m: a shank with a radius of 1 cm ends in a sphere of 2 cm."""
    return on_base(
        *(
            f"""<body name="{name}_thigh" pos="{x} {y} 0">
              <joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>
              <joint name="{name}_hip" axis="0 1 0" range="-0.5 2"/>
              <geom type="capsule" fromto="0 0 -.03 0 0 -.15" size="0.01" mass="0.2"/>
              <body name="{name}_shank" pos="0 0 -0.2">
                <joint name="{name}_knee" axis="0 1 0" range="-2 -0.4"/>
                <geom type="capsule" fromto="0 0 -.02 0 0 -.17" size="0.01" mass="0.05"/>
                <geom name="{name}_foot" size="0.02" pos="0 0 -0.2" mass="0.05"/></body></body>"""
            for name, x, y in hips
        )
    )


CORNERS = (("fl", 0.45, 0.075), ("fr", 0.45, -0.075), ("rl", -0.45, 0.075), ("rr", -0.45, -0.075))


def paired(tmp_path: Path, text: str) -> LegPairs:
    source = read(tmp_path, text)
    machine, _ = build_machine(source, "m")
    return with_leg_pairs(machine, standing_pose(machine, source.pose_rad), 0)


def made(tmp_path: Path, text: str) -> tuple[Robot, list[str]]:
    """The imported robot, and the notes on its legs."""
    (tmp_path / "m.xml").write_text(text)
    imported = import_robot(
        ImportRequest(tmp_path / "m.xml", tmp_path / "made", RANGES, peak_torque_nm={"": 20.0})
    )
    result = [guess for guess in imported.guesses if "collide in training" in guess]
    return load_robot(tmp_path / "made"), result


def names(pairs: LegPairs) -> set[frozenset[str]]:
    return {frozenset(pair) for pair in pairs.pairs}


def test_only_legs_that_can_touch_each_other_are_paired(tmp_path: Path) -> None:
    """Hips are 0.15 m apart across and 0.9 m along the robot; legs are 0.4 m long."""
    found = paired(tmp_path, walker(*CORNERS))
    assert names(found) == {frozenset({"fl_shank", "fr_shank"}), frozenset({"rl_shank", "rr_shank"})}


def test_an_imported_robot_trains_with_its_pairs_which_touch_only_each_other(tmp_path: Path) -> None:
    robot, result = made(tmp_path, walker(*CORNERS))
    model = training_model(robot)
    assert model.npair == 2
    assert set(model.pair_dim.tolist()) == {1}
    capsules = [*model.pair_geom1, *model.pair_geom2]
    assert set(model.geom_type[capsules].tolist()) == {int(Kind.mjGEOM_CAPSULE)}
    text = robot.xml_path.read_text()
    assert 'class="leg"' in text
    assert '<geom group="3" contype="0" conaffinity="0"/>' in text
    assert result == [
        "legs collide in training through 2 pairs of capsules, each costs training time:"
        " rl_shank with rr_shank, fl_shank with fr_shank"
    ]
    assert result[0] in robot.xml_path.with_name("robot.yaml").read_text().replace("\n# ", " ")


def test_there_are_no_more_pairs_than_capsules(tmp_path: Path) -> None:
    """Eight legs close to each other on a small base make 28 pairs."""
    sides = (("l", 0.06), ("r", -0.06))
    hips = [(f"{side}{k}", 0.14 * (k - 1.5), y) for side, y in sides for k in range(4)]
    found = paired(tmp_path, walker(*hips))
    assert len(found.pairs) == 8
