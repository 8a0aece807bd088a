"""`footfall bring-up`."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json
from footfall.confirm import Yes, confirm
from footfall.options import (
    SIMULATED,
    VIRTUAL,
    JsonFile,
    Names,
    OptionalPath,
    PolicyName,
    RobotName,
    VelocityCommand,
)
from footfall.robot_bus import interface_bus
from footfall.robots.default import DEFAULT_ROBOT

if TYPE_CHECKING:
    from footfall.deploy.bring_up.steps import Setting, Step, Verdict
    from footfall.deploy.bus import Bus
    from footfall.deploy.wiring_check.verdict import Verdict as WiringVerdict
    from footfall.robots.description import Robot

FAILED = 1
UNEVEN_FROM_M = 0.5  # distance from the start at which uneven ground begins in simulation
HANGS = "Does the robot hang in a frame, with its feet in the air"
HELD = "Does a person hold the robot up, feet just on the ground, and let go once it steps in place"
GROUND = "Does the robot lie or stand on the ground, with nobody within its reach"


@Parameter(name="*")
@dataclass(frozen=True)
class BringUpOptions:
    """Steps, strength and bus."""

    robot: RobotName = DEFAULT_ROBOT
    bus: str = "sim"
    """sim for the simulated robot, or socketcan for the CAN interfaces named in robot.yaml."""
    steps: Names = ()
    """Only these steps: hold, joints, legs, wiring, stand, shift, walk, uneven."""
    scale: Annotated[float, Parameter(validator=Number(gte=0.01, lte=1.0))] = 0.5
    """Scale of stiffness, damping and torque in the motors' commands."""
    command: VelocityCommand = (0.2, 0.0, 0.0)
    """Velocity command in the last two steps."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    limits: OptionalPath = None
    """YAML file with the motion and the limits of the steps (see docs/bring_up.md)."""
    yes: Yes = False
    json: JsonFile = None


def bring_up(policy: PolicyName, /, *, options: BringUpOptions = BringUpOptions()) -> int:
    """First steps of a robot, each with its own test; exit 1 at the first failure.
    The motors are disabled between steps.
    """
    check_outputs(options.json)
    setting, steps = _setting(policy, options), _chosen(options.steps)
    robot = setting.robot
    verdicts: list[Verdict] = []
    for step in steps:
        if reason := step.skipped_by(robot):
            print(f"{step.name}: skipped, since {reason}", flush=True)
            continue
        if options.bus != SIMULATED:
            question = HANGS if step.hangs else HELD if robot.description.held_start else GROUND
            if step.uneven:
                question += f". Boards or mats up to {setting.config.uneven_m} m high lie ahead of it"
            confirm(f"{step.name}: {step.about}. {question}?", options.yes)
        verdicts.append(_run_step(step, setting, options.bus))
        write_json(options.json, _figures(verdicts, options))
        print(f"{step.name}: {step.about}: {'passed' if verdicts[-1].passed else 'failed'}", flush=True)
        for finding in verdicts[-1].findings:
            print(f"  {finding}")
        if not verdicts[-1].passed:
            return FAILED
    if not verdicts:  # only now: a refused question must not replace the verdicts of an earlier run
        write_json(options.json, _figures(verdicts, options))
    return 0


def _setting(policy: str, options: BringUpOptions) -> "Setting":
    import numpy as np

    from footfall.common.config import load
    from footfall.deploy.bring_up.config import BringUpConfig
    from footfall.deploy.bring_up.steps import Setting
    from footfall.deploy.config import deploy_config
    from footfall.policies.registry import load_policy
    from footfall.robots.description import load_robot

    robot, command = load_robot(options.robot), np.array(options.command)
    config = BringUpConfig() if options.limits is None else load(options.limits, BringUpConfig)
    loop = deploy_config(robot, options.config, options.bus == SIMULATED)
    return Setting(
        robot,
        load_policy(policy, robot),
        lambda _: command,
        config,
        # A robot that cannot stand still is held up until the policy is in control.
        replace(loop, scale=options.scale, in_place_s=loop.in_place_s + config.slew_s),
        realtime=options.bus != SIMULATED,
        on_wiring_passed=partial(_keep_proof, robot, options.bus),
    )


def _keep_proof(robot: "Robot", bus: str, verdicts: "Sequence[WiringVerdict]") -> None:
    """Record that a real robot's wiring is right, so that `footfall deploy` does not check it again."""
    from footfall.deploy.wiring_check.proof import SIMULATED as SIMULATED_BUSES
    from footfall.deploy.wiring_check.proof import keep_proof

    if bus not in SIMULATED_BUSES:
        print(keep_proof(robot, bus, verdicts), flush=True)


def _chosen(names: tuple[str, ...]) -> "list[Step]":
    """Steps with these names, in their order; all steps without names."""
    from footfall.deploy.bring_up.steps import STEPS

    known = [step.name for step in STEPS]
    for name in names:
        if name not in known:
            raise UserError(f"no step '{name}': there are {', '.join(known)}")
    return [step for step in STEPS if not names or step.name in names]


def _run_step(step: "Step", setting: "Setting", bus_name: str) -> "Verdict":
    from footfall.deploy.bring_up.steps import run_step

    with _bus_of(setting, step, bus_name) as bus:
        return run_step(step, setting, bus)


@contextmanager
def _bus_of(setting: "Setting", step: "Step", bus_name: str) -> "Iterator[Bus]":
    """Bus to the robot; a simulated robot starts as the step requires."""
    from footfall.deploy.wiring import wiring_of

    robot, wiring = setting.robot, wiring_of(setting.robot)
    plant = None
    with ExitStack() as resources:
        if bus_name in (SIMULATED, VIRTUAL):
            from footfall.plant.robot import PlantConfig, SimulatedRobot
            from footfall.terrain.declaration import load_ground

            uneven = f"rough,roughness_m={setting.config.uneven_m},start_m={UNEVEN_FROM_M}"
            lies = not step.hangs and robot.lying_pose is not None
            plant = PlantConfig(
                motor_timeout_s=setting.deploy.motor_timeout_s,
                lying=lies,
                hanging=step.hangs,
                ground=load_ground(uneven) if step.uneven else None,
                release_after_s=setting.deploy.held_up_s,
            )
        if bus_name == SIMULATED:
            from footfall.plant.bus import SimulatedBus
            from footfall.plant.wires import SimulatedWires

            wires = SimulatedWires(wiring.buses)
            yield SimulatedBus(wires, SimulatedRobot(robot, wiring, wires, plant))
            return
        from footfall.deploy.stop_inputs.open import filters_of

        yield resources.enter_context(
            interface_bus(robot, wiring, bus_name, filters_of(robot, wiring), plant)
        )


def _figures(verdicts: "list[Verdict]", options: BringUpOptions) -> dict[str, Any]:
    return {
        "robot": options.robot,
        "bus": options.bus,
        "scale": options.scale,
        "steps": [
            {
                "step": verdict.step,
                "passed": verdict.passed,
                "findings": list(verdict.findings),
                "final_state": verdict.outcome.final_state,
                "run_s": verdict.outcome.run_s,
                "notes": list(verdict.outcome.notes),
            }
            for verdict in verdicts
        ],
    }
