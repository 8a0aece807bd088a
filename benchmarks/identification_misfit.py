"""Detection of wrong models by a fit: robots with an effect that the fitted model lacks.

    python benchmarks/identification_misfit.py [--workers 2] [--json FILE]

Each case: a hidden robot of `identification.py`'s family with one more effect, recorded and fitted by the
plain model. A case is flagged if a joint's residual exceeds `MISFIT_RATIO` times the noise, or the recording
is refused. A flagged fit is repeated with each known effect; the effect with the smallest residual is named.
"""

import argparse
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from identification import FITTED_MOTION, true_parameters

from footfall.common.errors import UserError
from footfall.common.outputs import write_json
from footfall.domain_rand.sample import Sample
from footfall.identify.fit import MISFIT_RATIO, fit_leg
from footfall.identify.leg import fixed_legs
from footfall.identify.record import record
from footfall.identify.recording import read_recording
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import Robot, load_robot
from footfall.robots.mjcf import load_spec
from footfall.robots.spec_edits import make_inertia_explicit

WEIGHT_KG = 0.1  # at each foot
CLAMPED, IN_A_SOFT_FRAME = True, False


@dataclass(frozen=True)
class Case:
    """A robot with an effect that the model lacks."""

    sample: Callable[[Robot], Sample] = lambda robot: {}
    heavy: bool = False  # a weight at each foot
    clamped: bool = CLAMPED


def _all(robot: Robot, name: str, value: np.ndarray | float) -> Sample:
    return {name: np.broadcast_to(value, len(robot.joint_names)).copy()}


CASES = {
    "none": Case(),
    "Stribeck friction, 30 % of Coulomb": Case(
        lambda robot: _all(robot, "stribeck_friction", 0.3 * robot.motor.friction)
    ),
    "load friction of 5 %": Case(lambda robot: _all(robot, "load_friction", 0.05)),
    "backlash of 0.2 degrees": Case(lambda robot: _all(robot, "backlash_rad", np.deg2rad(0.2))),
    "gear stiffness of 400 N m/rad": Case(lambda robot: _all(robot, "gear_compliance", 1.0 / 400.0)),
    f"{WEIGHT_KG:g} kg at each foot": Case(heavy=True),
    "base in a soft frame": Case(clamped=IN_A_SOFT_FRAME),
}


@dataclass
class Found:
    """Result of a fit for a case."""

    case: str
    flagged: bool = False
    refused: str = ""  # reason of a refusal
    misfit: list[float] = field(default_factory=list)  # residual over noise of each joint
    without: float = 0.0  # residual over noise, worst joint, on the windows on which effects are tried
    with_effect: dict[str, float] = field(default_factory=dict)  # the same with each effect, by its name
    named: str | None = None  # effect that the fit names


def heavy_plant(robot: Robot, folder: Path) -> Path:
    """The robot's MJCF with a weight at each foot."""
    spec = load_spec(robot.xml_path)
    make_inertia_explicit(spec)
    for foot in robot.description.feet:
        geom = spec.geom(foot.geoms[0])
        body: mujoco.MjsBody = geom.parent
        position, centre = np.array(geom.pos), np.array(body.ipos)
        mass = body.mass + WEIGHT_KG
        offset = position - centre
        reduced = body.mass * WEIGHT_KG / mass
        body.ipos = centre + WEIGHT_KG / mass * offset
        body.inertia = np.array(body.inertia) + reduced * (offset @ offset - offset**2)
        body.mass = mass
    path = folder / "heavy.xml"
    path.write_text(spec.to_xml())
    return path


def run(name: str, number: int) -> Found:
    case, robot, found = CASES[name], load_robot("go1"), Found(name)
    sample = true_parameters(robot, number) | case.sample(robot)
    with tempfile.TemporaryDirectory() as folder:
        plant = heavy_plant(robot, Path(folder)) if case.heavy else None
        log = Path(folder) / "log.mcap"
        record(robot, simulated_bus(robot, sample, plant, clamped=case.clamped), log, FITTED_MOTION)
        recording = read_recording(log, robot)
    try:
        fit = fit_leg(fixed_legs(robot)[0], [recording])
    except UserError as error:
        found.flagged, found.refused = True, str(error).partition(": ")[2]
        return found
    found.misfit, found.flagged = fit.misfit.tolist(), bool((fit.misfit > MISFIT_RATIO).any())
    if fit.explanation is not None:
        found.without, found.with_effect = fit.explanation.without, fit.explanation.with_effect
        found.named = fit.explanation.best
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", type=int, default=200)
    parser.add_argument("--only", help="beginning of a case's name")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    names = [name for name in CASES if name.startswith(options.only or "")]
    results: list[Found] = []
    with ProcessPoolExecutor(options.workers) as pool:
        waiting = [pool.submit(run, name, options.draw) for name in names]
        for done in as_completed(waiting):
            found = done.result()
            results.append(found)
            ratios = ", ".join(f"{each:.1f}" for each in found.misfit)
            tried = ", ".join(f"{name} {ratio:.1f}" for name, ratio in found.with_effect.items())
            verdict = f"{'flagged' if found.flagged else 'fits'} ({found.refused or ratios})"
            print(f"{found.case}: {verdict}; named: {found.named or 'none'}; {tried}", flush=True)
            write_json(options.json, [asdict(each) for each in results])


if __name__ == "__main__":
    main()
