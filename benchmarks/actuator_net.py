"""Actuator nets beside the fitted physical law, on motion that neither has seen.

    python benchmarks/actuator_net.py planted
    python benchmarks/actuator_net.py xl330 --data FOLDER

planted: a hidden go1 of `identification.py`'s family, with Stribeck friction, load friction and backlash. It
is recorded three times, as `footfall identify record` does. One leg is fitted to the first recording without
these effects (with --effects also with them). The net corrects that fit and is trained on the same recording.
The second recording decides which net is kept. The third, with another amplitude and other gains, is the test
set.

xl330: FOLDER holds JSON files of github.com/Rhoban/bam, commit af22604 (Apache-2.0). A Dynamixel XL330 moves
a pendulum, with three gains and three motions. Each is held out in turn; --hold-out takes parts of their
names. The joint law is fitted to the others by least squares, as in `servos.py`. The net is trained beside it
on the same recordings, of which the last one decides which net is kept. Recordings in which the torque is
released are left out.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from identification import FITTED_MOTION, HELD_OUT_MOTION, recorded, true_parameters
from recordings.servo_leg import delay_of, servo_leg, servo_recording
from recordings.servo_logs import SERVOS, Log, logs, problem
from recordings.tables import table

from footfall.common.outputs import write_json
from footfall.identify.driven import driven_motion
from footfall.identify.fit import FitConfig, fit_leg, held_out_error
from footfall.identify.leg import fixed_legs
from footfall.learned_law import learn
from footfall.robots.description import load_robot
from footfall.robots.driven_motion import joined_motion
from footfall.train.actuator_net import NetConfig, train_net

EFFECTS = ("stribeck_friction", "load_friction", "backlash_rad")
MOTIONS = FITTED_MOTION, replace(FITTED_MOTION, seed=1, amplitude_rad=0.25), HELD_OUT_MOTION
MODEL = "joint law"
HELD_OUT = ("kp 100", "kp 200", "kp 800", "sin_sin", "up_and_down", "sin_time_square")


def planted(number: int, effects: bool, config: NetConfig) -> list[list[str]]:
    """Joint, and rms errors in mrad: nominal, law, net, and with `effects` the law with effects."""
    robot = load_robot("go1")
    sample = true_parameters(robot, number)
    joints = len(robot.joint_names)
    sample |= {
        "stribeck_friction": 0.3 * robot.motor.friction,
        "load_friction": np.full(joints, 0.05),
        "backlash_rad": np.full(joints, np.deg2rad(0.2)),
    }
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        *fitted, judging = (
            recorded(robot, sample, motion, seed, folder) for seed, motion in enumerate(MOTIONS)
        )
        leg, fit_config = fixed_legs(robot)[0], FitConfig(explain=False)
        plain = fit_leg(leg, fitted[:1], [judging], fit_config)
        (learned,) = learn(robot, [plain], fitted, [judging], folder / "learned", config)
        print(table(["joint", "nominal", "law", "net"], learned.rows()), flush=True)
        if not effects:
            return learned.rows()
        with_effects = fit_leg(leg, fitted[:1], [judging], replace(fit_config, effects=EFFECTS))
    values = {each.parameter: each.value for each in with_effects.estimates}
    errors_mrad = 1e3 * held_out_error(leg, fitted, [judging], values, fit_config)
    return [[*row, f"{each:.2f}"] for row, each in zip(learned.rows(), errors_mrad.tolist(), strict=True)]


def xl330(folder: str, held_out: str, config: NetConfig) -> list[str]:
    """The held-out name, rms errors in mrad over windows of 1 s (law, net), and the steps of the kept net."""
    driven_logs = [log for log in logs(folder, "xl330") if _driven(log)]
    windows = problem(folder, "xl330", MODEL)
    used = [
        index for index, log in enumerate(logs(folder, "xl330")) if _driven(log) and held_out not in log.name
    ]
    numbers = windows.of(used).fit()
    value = dict(zip((each.name for each in windows.parameters), numbers.tolist(), strict=True))
    leg = servo_leg(value, driven_logs[0])
    stall, duty = float(leg.motor.stall_torque[0]), SERVOS["xl330"].duty_per_rad
    learning = [servo_recording(log, duty * stall) for log in driven_logs if held_out not in log.name]
    judging = [servo_recording(log, duty * stall) for log in driven_logs if held_out in log.name]
    bias, delay_s = np.array([-value["offset"]]), np.array([value["delay"]])
    motions = [driven_motion(leg, each, bias, delay_s, config.window_s, 1.0) for each in learning]
    trained = train_net(joined_motion(motions[:-1]), motions[-1], leg.motor, config)
    values = delay_of(leg, value)
    errors = [
        held_out_error(each, judging, judging, values, FitConfig(rate_hz=100.0))
        for each in (leg, replace(leg, net=trained.net))
    ]
    return [held_out, *(f"{1e3 * each[0]:.1f}" for each in errors), f"{trained.steps}"]


def _driven(log: Log) -> bool:
    """Whether the torque is on throughout."""
    return bool((log.inputs[:, 1] > 0.5).all())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("case", choices=("planted", "xl330"))
    parser.add_argument("--data", type=Path, help="folder of the JSON files")
    parser.add_argument("--draw", type=int, default=200, help="number of the hidden robot")
    parser.add_argument("--hold-out", nargs="+", default=HELD_OUT, help="parts of recordings' names")
    parser.add_argument("--effects", action="store_true", help="fit the law with the planted effects, too")
    parser.add_argument("--steps", type=int, default=300, help="steps of gradient descent")
    parser.add_argument("--seeds", type=int, default=2, help="trainings of each net")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    config = NetConfig(steps=options.steps, seeds=options.seeds)
    if options.case == "planted":
        head = ["held out, mrad rms", "nominal", "law", "net", *["law with the effects"] * options.effects]
        rows = planted(options.draw, options.effects, config)
    elif options.data is None:
        parser.error("xl330 needs --data")
    else:
        head = ["held out, mrad rms", "law", "net", "steps"]
        rows = []
        for held_out in options.hold_out:
            rows.append(xl330(str(options.data.resolve()), held_out, config))
            print(table(head, rows[-1:]), flush=True)
    print(table(head, rows))
    write_json(options.json, [dict(zip(head, row, strict=True)) for row in rows])


if __name__ == "__main__":
    main()
