"""Errors of identified parameters on simulated robots whose randomised parameters are known.

    python benchmarks/identification.py --robot go1 --draws 20 --workers 2 [--json FILE]

Each draw is a robot with parameters from `FAMILY` and a clamped base. The code of `footfall identify record`
records it twice, over the quantised frames of its bus. Each leg is fitted to the first recording. The second
one, of another motion with other gains, is held out. Parameter errors are against the draw, position errors
against the held-out recording.
"""

import argparse
import json
import tempfile
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from footfall.common.outputs import write_json
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.domain_rand.sample import Sample, draw
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.fit import MISFIT_RATIO, LegFit, fit_leg
from footfall.identify.leg import FixedLeg, fixed_legs
from footfall.identify.record import record
from footfall.identify.recording import Recording, read_recording
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model
from footfall.robots.stability import PLANT_TIMESTEP_S

FAMILY = Randomisation(
    armature=Distribution(0.8, 1.4),
    joint_friction=Distribution(0.6, 1.8),
    joint_damping=Distribution(0.03, 0.12),
    torque_lag_s=Distribution(0.001, 0.006),
    action_delay_s=Distribution(0.0, 0.008),
    encoder_bias=Distribution(-0.02, 0.02),
    motor_strength=Distribution(0.9, 1.1),
    kp=Distribution(0.9, 1.1),
    kd=Distribution(0.95, 1.05),
    link_mass=Distribution(0.9, 1.1),
)
FITTED_MOTION = ExcitationConfig()
HELD_OUT_MOTION = ExcitationConfig(
    amplitude_rad=0.2,
    swing_rad=0.2,
    triangle_s=2.0,
    chirp_s=6.0,
    highest_hz=6.0,
    stiffness=(0.7, 0.7),
    damping=(0.9, 0.9),
)


@dataclass(frozen=True)
class Target:
    """Limit of a quantity's error."""

    unit: str
    limit: float
    per_unit: float  # factor from the quantity's unit to the error's unit
    relative: bool  # whether the error is divided by the true value


TARGETS = {
    "armature": Target("%", 3.0, 100.0, True),
    "joint_friction": Target("%", 3.0, 100.0, True),
    "joint_damping": Target("%", 5.0, 100.0, True),
    "delay_s": Target("ms", 0.3, 1e3, False),
    "torque_lag_s": Target("ms", 0.3, 1e3, False),
    "encoder_bias": Target("mrad", 1.0, 1e3, False),
    "motor_strength x kp": Target("%", 1.0, 100.0, True),
    "link_mass": Target("%", 2.0, 100.0, True),
}
# Further targets: maximum rms error of held-out motion, minimum ratio of the nominal error to it, minimum
# share of true values that lie in their intervals.
HELD_OUT_MRAD, MIN_GAIN, COVERED = 2.0, 5.0, 0.9


@dataclass
class Outcome:
    """One leg of one draw."""

    draw: int
    leg: str
    errors: dict[str, list[float]] = field(default_factory=dict)  # by quantity, in the units of `TARGETS`
    # By quantity: error as a multiple of the interval's half-width.
    interval_errors: dict[str, list[float]] = field(default_factory=dict)
    undetermined: list[str] = field(default_factory=list)
    held_out_mrad: list[float] = field(default_factory=list)
    nominal_mrad: list[float] = field(default_factory=list)
    misfit: list[float] = field(default_factory=list)


def true_parameters(robot: Robot, number: int, family: Randomisation = FAMILY, seed: int = 32) -> Sample:
    """The parameters of a draw, with delays rounded to physics steps, as in the plant."""
    bodies = plant_model(robot).nbody - 1
    rng = np.random.default_rng([seed, number])
    sample = draw(family, rng.random, len(robot.joint_names), bodies)
    steps = np.round(sample["action_delay_s"] / PLANT_TIMESTEP_S)
    return sample | {"action_delay_s": steps * PLANT_TIMESTEP_S}


def recorded(robot: Robot, sample: Sample, motion: ExcitationConfig, seed: int, folder: Path) -> Recording:
    """A recording of the robot with a sample's parameters."""
    log = folder / f"{seed}.mcap"
    outcome = record(robot, simulated_bus(robot, sample, seed=seed), log, motion)
    if outcome.faults or outcome.final_state != "IDLE":
        raise SystemExit(f"the recording ended in {outcome.final_state}: {', '.join(outcome.faults)}")
    return read_recording(log, robot)


def truth_of(
    robot: Robot, leg: FixedLeg, sample: Sample, recording: Recording
) -> dict[tuple[str, str], float]:
    """The draw's values by quantity and owner.

    A delay is the command's delay plus the reading's: the time from the tick at which the plant takes the
    reading to its arrival.
    """
    model = plant_model(robot)
    reading_s = np.mod(recording.read_s[:, leg.joints] - recording.time_s[:, None] + 1e-9, recording.period_s)
    found = {
        ("delay_s", name): float(sample["action_delay_s"] + reading_s[:, index].mean())
        for index, name in enumerate(leg.joint_names)
    }
    for quantity, values in sample.items():
        if np.ndim(values) and len(values) == len(robot.joint_names):
            for joint, name in zip(leg.joints, leg.joint_names, strict=True):
                found[quantity, name] = float(values[joint])
    for name in leg.body_names:
        found["link_mass", name] = float(sample["link_mass"][model.body(name).id - 1])
    return found


def outcome_of(number: int, leg: FixedLeg, fit: LegFit, truth: dict[tuple[str, str], float]) -> Outcome:
    """Errors of a leg's fit against the truth."""
    outcome = Outcome(number, leg.name, undetermined=[each.label for each in fit.frozen])
    errors, interval_errors = defaultdict(list), defaultdict(list)

    def compare(quantity: str, value: float, true: float) -> None:
        target = TARGETS.get(quantity)
        if target is not None:
            errors[quantity].append(target.per_unit * (value - true) / (true if target.relative else 1.0))

    for each in fit.estimates:
        quantity, owner = each.parameter.quantity, each.parameter.owner
        true = truth.get((quantity, owner), each.parameter.declaration.nominal)
        interval_errors[quantity].append(2.0 * (each.value - true) / (each.high - each.low))
        offset = (
            float(leg.motor.damping[leg.joint_names.index(owner)]) if quantity == "joint_damping" else 0.0
        )
        compare(quantity, each.value + offset, true + offset)
    for name in leg.joint_names:
        strength, kp = fit.value("motor_strength", name), fit.value("kp", name)
        if strength is not None and kp is not None:
            compare("motor_strength x kp", strength * kp, truth["motor_strength", name] * truth["kp", name])
    outcome.errors, outcome.interval_errors = dict(errors), dict(interval_errors)
    outcome.held_out_mrad = (1e3 * fit.held_out_rad).tolist()
    outcome.nominal_mrad = (1e3 * fit.nominal_rad).tolist()
    outcome.misfit = fit.misfit.tolist()
    return outcome


def run(name: str, number: int, legs: int) -> list[Outcome]:
    """Record, fit and evaluate some legs of one draw; the next draw takes other legs."""
    robot = load_robot(name)
    sample, all_legs = true_parameters(robot, number), fixed_legs(robot)
    with tempfile.TemporaryDirectory() as folder:
        fitted, held_out = (
            recorded(robot, sample, motion, 2 * number + index, Path(folder))
            for index, motion in enumerate((FITTED_MOTION, HELD_OUT_MOTION))
        )
    outcomes = []
    for index in range(legs):
        leg = all_legs[(number + index) % len(all_legs)]
        fit = fit_leg(leg, [fitted], [held_out])
        outcomes.append(outcome_of(number, leg, fit, truth_of(robot, leg, sample, fitted)))
    return outcomes


def summary(outcomes: list[Outcome]) -> dict:
    """Medians and worst errors, coverage of intervals and held-out errors over all legs."""
    rows = {}
    for name, target in TARGETS.items():
        sizes = np.abs([each for outcome in outcomes for each in outcome.errors.get(name, [])])
        inside = [abs(each) <= 1.0 for outcome in outcomes for each in outcome.interval_errors.get(name, [])]
        rows[name] = {
            "unit": target.unit,
            "target": target.limit,
            "count": len(sizes),
            "median": float(np.median(sizes)) if len(sizes) else None,
            "worst": float(sizes.max(initial=0.0)),
            "within": float((sizes <= target.limit).mean()) if len(sizes) else None,
            "covered": float(np.mean(inside)) if inside else None,
        }
    interval_errors = [values for outcome in outcomes for values in outcome.interval_errors.values()]
    covered = [abs(each) <= 1.0 for values in interval_errors for each in values]
    held_out = np.array([each for outcome in outcomes for each in outcome.held_out_mrad])
    nominal = np.array([each for outcome in outcomes for each in outcome.nominal_mrad])
    return {
        "legs": len(outcomes),
        "quantities": rows,
        "covered": float(np.mean(covered)),
        "held_out_mrad": {"median": float(np.median(held_out)), "worst": float(held_out.max())},
        "nominal_mrad": {"median": float(np.median(nominal)), "least": float(nominal.min())},
        "min_gain": float((nominal / held_out).min()),
        "misfits": sum(any(ratio > MISFIT_RATIO for ratio in each.misfit) for each in outcomes),
    }


def show(found: dict) -> None:
    print(f"{found['legs']} legs")
    print(f"{'quantity':20s} {'median':>8s} {'worst':>8s} {'target':>8s}  unit  within  covered  count")
    for name, row in found["quantities"].items():
        if row["count"]:
            covered = "" if row["covered"] is None else f"{row['covered']:.0%}"
            print(
                f"{name:20s} {row['median']:8.3f} {row['worst']:8.3f} {row['target']:8.1f}  {row['unit']:4s}"
                f"  {row['within']:6.0%}  {covered:>7s}  {row['count']:5d}"
            )
    held_out, nominal = found["held_out_mrad"], found["nominal_mrad"]
    print(
        f"held out: median {held_out['median']:.3f}, worst {held_out['worst']:.3f} mrad rms"
        f" (target {HELD_OUT_MRAD:g}); nominal: median {nominal['median']:.2f};"
        f" smallest gain {found['min_gain']:.0f} (target {MIN_GAIN:g})"
    )
    print(f"intervals cover {found['covered']:.1%} (target {COVERED:.0%}); misfits: {found['misfits']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first draw")
    parser.add_argument("--legs", type=int, default=1, help="number of fitted legs of each draw")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="file for all outcomes, written after each draw")
    options = parser.parse_args()
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.workers) as pool:
        numbers = range(options.first, options.first + options.draws)
        waiting = [pool.submit(run, options.robot, number, options.legs) for number in numbers]
        for done in as_completed(waiting):
            outcomes += done.result()
            print(json.dumps({"draw": outcomes[-1].draw, "of": options.draws}), flush=True)
            if options.json is not None:
                legs = [asdict(each) for each in outcomes]
                write_json(options.json, {"summary": summary(outcomes), "legs": legs})
    show(summary(outcomes))


if __name__ == "__main__":
    main()
