"""`footfall deploy`."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from footfall.common.engines import DEFAULT_ENGINE
from footfall.common.errors import UserError
from footfall.common.files import release, spare_descriptors
from footfall.common.outputs import check_outputs
from footfall.deploy_options import DEFAULTS, FULL, LYING, DeployOptions
from footfall.options import SIMULATED, VIRTUAL, PolicyName
from footfall.robot_bus import virtual_robot
from footfall.run_pages import NO_PAGES, RunPageOptions, inbox_of, run_pages

if TYPE_CHECKING:
    import numpy as np

    from footfall.deploy.config import DeployConfig
    from footfall.deploy.height_scan import HeightScanSource
    from footfall.deploy.loop import ControlLoop
    from footfall.deploy.recovery import GetUp
    from footfall.deploy.session import SessionResult
    from footfall.policies.policy import Policy
    from footfall.robots.description import Robot
    from footfall.steered import Steered

Others = Mapping[str, "Policy"]  # by spec
SAFE, FALLEN = "IDLE", "FALLING"  # final states: safe end, fall
WIRING_CHECK = "wiring check first: one joint after the other moves slightly; keep away from the robot"


class Run(NamedTuple):
    """Everything that a run needs on any bus."""

    robot: "Robot"
    policy: "Policy"
    spec: str  # spec of the policy for the log
    others: Others
    consent: "GetUp | None"
    options: DeployOptions
    steering: "Steered"
    scans: "HeightScanSource | None"


def deploy(
    policy: PolicyName, /, *, options: DeployOptions = DEFAULTS, pages: RunPageOptions = NO_PAGES
) -> int:
    """Run a policy on a bus, simulated by default; exit 0 if it ended safely, 1 if not."""
    check_outputs(options.json, options.log, inputs=[policy, options.source, options.config, options.plant])
    from footfall.common.config import unstructure
    from footfall.deploy_summary import show
    from footfall.height_scan_source import check_scans_are_read, height_scan_source
    from footfall.policies.registry import lasting_spec, load_policy, load_settings
    from footfall.policies.spec import add_settings
    from footfall.result import write_and_show
    from footfall.robots.description import load_robot
    from footfall.steered import COCKPIT, mission_policies, steered

    if options.source == COCKPIT:
        options, pages = replace(options, source=None), replace(pages, cockpit=True)
    robot = load_robot(options.robot)
    spec, *other_specs = add_settings([policy, *options.also], options.settings)
    policy_to_run, consent = load_policy(spec, robot), _consent(options, robot)
    others = {lasting_spec(each): load_policy(each, robot) for each in other_specs}
    others |= mission_policies(options.source, [policy_to_run, *others.values()], robot)
    get_up = [consent.policy] if consent is not None else []
    check_scans_are_read(options.height_scan, [policy_to_run, *others.values(), *get_up])
    run_on_bus = _simulated if options.bus == SIMULATED else _on_interface
    about = {"policy": spec, "robot": robot.name, "settings": unstructure(load_settings(spec, robot))}
    with spare_descriptors() as spare:
        all_policies, inbox = {spec: policy_to_run, **others}, inbox_of(pages)
        with (
            steered(
                options.source, options.command, options.duration, all_policies, robot, inbox
            ) as steering,
            run_pages(pages, robot, options.feed, steering, inbox) as (steering, feed),
            height_scan_source(options.height_scan) as scans,
        ):
            options = replace(options, feed=feed)
            run = Run(robot, policy_to_run, lasting_spec(spec), others, consent, options, steering, scans)
            figures = about | run_on_bus(run)
        release(spare)
        safe = figures["final_state"] == SAFE and not figures["fell"]
        status = 0 if safe and not steering.failed() else 1
        return write_and_show(figures, options.json, lambda: show(figures), status)


def _simulated(run: Run) -> dict[str, Any]:
    """Run on the simulated robot; returns the figures."""
    from footfall.deploy.wiring_check.proof import must_check
    from footfall.height_scan_source import arrive_in_real_time
    from footfall.plant.episode import Episode, run_episode
    from footfall.terrain.declaration import load_ground

    robot, options, steering = run.robot, run.options, run.steering
    if steering.odometry and options.ground_truth:
        raise UserError("--ground-truth replaces the odometry that --from and the pages need: leave it out")

    def display(loop: "ControlLoop", velocity: "Callable[[], np.ndarray]") -> AbstractContextManager[None]:
        return _display(loop, velocity, (), steering)

    episode = Episode(
        command_source=steering.source,
        duration_s=steering.duration_s,
        seed=options.seed,
        plant=options.plant,
        engine=options.engine,
        ground=load_ground(options.ground, options.seed) if options.ground else None,
        lying=options.start == LYING,
        charge=options.charge,
        lie_down=options.lie_down,
        ground_truth=options.ground_truth,
        realtime=options.realtime or steering.realtime or arrive_in_real_time(options.height_scan),
        log=options.log,
        log_frames=options.log_frames,
        feed=_feed(options, steering),
        policy_spec=run.spec,
        others=run.others,
        get_up=run.consent,
        record=False,
        config=_config(robot, options, steering),
        display=display,
        check_wiring=must_check(robot, options.bus, options.wiring),
        height_scans=run.scans,
    )
    trace = run_episode(robot, run.policy, episode)
    return _figures(trace, options, steering) | {
        "fell": trace.fell,
        "fall_reason": trace.fall_reason,
        "distance_m": trace.distance_m,
        "mean_velocity_m_s": trace.mean_velocity,
    }


def _on_interface(run: Run) -> dict[str, Any]:
    """Run on CAN interfaces; returns the figures."""
    from footfall.deploy.log_store import default_store
    from footfall.deploy.session import Session, run_on_interface
    from footfall.deploy.wiring_check.proof import keep_proof, must_check, unproven_note

    robot, options, steering = run.robot, run.options, run.steering
    if option := _simulation_only(options):
        raise UserError(f"{option} needs the simulated robot: leave --bus at '{SIMULATED}'")
    facts = {"seed": options.seed, "policy_spec": run.spec, "bus": options.bus, "plant": None}
    check = must_check(robot, options.bus, options.wiring)
    notes = [] if check else [unproven_note(robot, options.bus)]
    lines = [*filter(None, notes), *[WIRING_CHECK] * check]
    if robot.description.held_start:
        lines.append(f"{robot.name} cannot stand still: hold it up, and let go once it steps in place")

    def display(loop: "ControlLoop") -> AbstractContextManager[None]:
        return _display(loop, lambda: loop.estimate[0], lines, steering)

    config = _config(robot, options, steering)
    store, log = None, options.log
    if log is None and options.bus != VIRTUAL:  # the record of a real robot must not be lost
        store = default_store(round(config.logs_most_mb * 1e6))
        log = store.new_log(robot.name)
        lines.append(f"the log is {log}")
    session = Session(
        command_source=steering.source,
        duration_s=steering.duration_s,
        log=log,
        log_store=store,
        log_frames=options.log_frames,
        feed=_feed(options, steering),
        facts=facts,
        others=run.others,
        get_up=run.consent,
        config=config,
        lie_down=options.lie_down,
        display=display,
        check_wiring=check,
        height_scans=run.scans,
        on_wiring_passed=lambda verdicts: notes.append(keep_proof(robot, options.bus, verdicts)),
    )
    with virtual_robot(robot, options.bus, seed=options.seed):
        outcome = run_on_interface(robot, run.policy, options.bus, session)
    fell = outcome.final_state == FALLEN
    return _figures(outcome, options, steering) | {
        "notes": [*outcome.notes, *filter(None, notes)],
        "fell": fell,
        "fall_reason": outcome.faults[0] if fell else "",
        "distance_m": math.nan,  # not measured
        "mean_velocity_m_s": [math.nan] * 3,
    }


def _consent(options: DeployOptions, robot: "Robot") -> "GetUp | None":
    """Consent to get up after a fall, with the get-up policy; None without --recover."""
    from footfall.deploy.recovery import GetUp
    from footfall.policies.registry import get_up_name, lasting_spec, load_policy

    if not options.recover:
        if options.get_up is not None:
            raise UserError("--get-up names the policy of --recover: give --recover, too")
        return None
    spec = options.get_up or get_up_name(robot)
    return GetUp(load_policy(spec, robot), lasting_spec(spec))


def _simulation_only(options: DeployOptions) -> str:
    """First given option that applies only to the simulated robot; empty if there is none."""
    given = {
        "--plant": options.plant is not None,
        "--engine": options.engine != DEFAULT_ENGINE,
        "--ground": bool(options.ground),
        "--ground-truth": options.ground_truth,
        "--start": options.start == LYING,
        "--charge": options.charge != FULL,
    }
    return next((option for option, is_given in given.items() if is_given), "")


def _display(
    loop: "ControlLoop", velocity: "Callable[[], np.ndarray]", lines: Sequence[str], steering: "Steered"
) -> AbstractContextManager[None]:
    """Print the lines for the operator, after the buses are open and before anything moves; then show the
    state."""
    from footfall.live_state import live_state

    for line in (*lines, *steering.about):
        print(line, flush=True)
    steering.attach(loop)
    return live_state(loop, velocity, steering.duration_s, steering=steering.line)


def _feed(options: DeployOptions, steering: "Steered") -> Path | None:
    """Socket for the run's telemetry; linked to the place where the command source expects it."""
    if options.feed is not None and steering.feed is not None:
        steering.feed.symlink_to(options.feed.absolute())
    return options.feed or steering.feed


def _config(robot: "Robot", options: DeployOptions, steering: "Steered") -> "DeployConfig":
    from footfall.deploy.config import deploy_config

    config = deploy_config(robot, options.config, simulated=options.bus == SIMULATED)
    path_logged = options.log is not None and not options.ground_truth  # a log includes the robot's path
    return replace(config, odometry=config.odometry or steering.odometry or path_logged)


def _figures(outcome: "SessionResult", options: DeployOptions, steering: "Steered") -> dict[str, Any]:
    """Figures that every run has."""
    return {
        "bus": options.bus,
        "seed": options.seed,
        **steering.figures(),
        "duration_s": steering.duration_s,
        "walked_s": outcome.walked_s,
        "final_state": outcome.final_state,
        "faults": list(outcome.faults),
        "recoveries": [each._asdict() for each in outcome.recoveries],
        "notes": list(outcome.notes),
        "timing": outcome.timing,
        "buses": [asdict(bus) for bus in outcome.buses],
        "wall_s": outcome.wall_s,
        "run_s": outcome.run_s,
    }
