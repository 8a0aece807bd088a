"""Time to equal quality of footfall and MuJoCo Playground on one GPU, with policies scored on one plant.

    python benchmarks/time_to_quality.py train --out quality            # on the machine with the GPU
    python benchmarks/time_to_quality.py score --out quality            # on any machine
    python benchmarks/time_to_quality.py plot --out quality

`train` runs one training of footfall and one of Playground, one after the other, each in its own process with
an empty compilation cache, and keeps intermediate policies. The clock of each starts with its command, so it
includes imports and compilation.

`score` lets every kept policy walk in the same MuJoCo plant, over the same joint layer and motor frames, with
the same commands (scenario `walk`) and pushes (scenario `push`). Playground's policy uses the base's true
velocity, which its observation needs and no robot can measure; footfall's does not.

`plot` plots velocity error and the push that half survive over wall-clock time. It prints from what time on
footfall was as good as Playground's last policy in both, without more falls.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any

from playground_policy import PlaygroundPolicy, SavedActors, load_actors
from rich.console import Console
from rich.table import Table

from footfall.common.errors import UserError
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task, run_with
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.pool import run_all
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.summary import summarise
from footfall.robots.description import load_robot

HERE = Path(__file__).parent
ROBOT = "go1"  # the robot of Playground's task
PLAYGROUND, FOOTFALL = "playground", "footfall"
SCENARIOS = {"walk": 48, "push": 96}  # number of episodes of each scenario


def main() -> None:
    """Run the chosen step: train, score or plot."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["train", "score", "plot"])
    parser.add_argument("--out", type=Path, required=True, help="folder of policies and scores")
    parser.add_argument("--only", choices=[PLAYGROUND, FOOTFALL], help="train or score only this one")
    parser.add_argument("--preset", default="gpu", help="preset of footfall")
    parser.add_argument("--impl", default="jax", choices=["jax", "warp"], help="Playground's physics")
    parser.add_argument("--seeds", type=int, default=1, help="number of footfall's trainings")
    parser.add_argument("--every", type=float, default=8.0, help="seconds between footfall's kept policies")
    parser.add_argument("--until", type=float, default=1e9, help="time limit of footfall's training, s")
    parser.add_argument("--plant", type=Path, help="MJCF to score on, instead of footfall's robot")
    parser.add_argument("--workers", type=int)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    try:
        {"train": train, "score": score, "plot": plot}[options.what](options)
    except UserError as error:
        parser.error(str(error))


# -- train ---------------------------------------------------------------------------------------------------


def train(options: argparse.Namespace) -> None:
    """Run one process for each training, one after the other."""
    if options.only != PLAYGROUND:
        for seed in range(options.seeds):
            command = ["footfall_training.py", "--out", str(options.out / f"{FOOTFALL}-{seed}")]
            command += ["--preset", options.preset, "--seed", str(seed)]
            run_with_empty_cache([*command, "--every", str(options.every), "--until", str(options.until)])
    if options.only != FOOTFALL:
        command = ["playground_training.py", "--out", str(options.out / f"{PLAYGROUND}.npz")]
        run_with_empty_cache([*command, "--impl", options.impl])


def run_with_empty_cache(command: list[str]) -> None:
    """Run a script of this folder; its clock starts now."""
    with tempfile.TemporaryDirectory() as cache_folder:
        environment = os.environ | {"JAX_COMPILATION_CACHE_DIR": cache_folder, "PYTHONUNBUFFERED": "1"}
        environment["WARP_CACHE_PATH"] = str(Path(cache_folder) / "warp")
        script, *rest = command
        began = ["--began", repr(time.time())]
        subprocess.run([sys.executable, str(HERE / script), *rest, *began], env=environment, check=True)


# -- score ---------------------------------------------------------------------------------------------------


def score(options: argparse.Namespace) -> None:
    """Evaluate the kept policies that have no scores yet."""
    path = options.out / "scores.json"
    scores: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    for policy, (name, time_s, steps) in kept_policies(options.out).items():
        if policy in scores or (options.only and not name.startswith(options.only)):
            continue
        figures = {scenario: figures_of(policy, scenario, options) for scenario in SCENARIOS}
        scores[policy] = {"training": name, "time_s": time_s, "steps": steps, **figures}
        path.write_text(json.dumps(scores, indent=1) + "\n")
        print(one_line(scores[policy]), flush=True)


def kept_policies(folder: Path) -> dict[str, tuple[str, float, int]]:
    """Every kept policy by the name that `_run` accepts: training, seconds, environment steps."""
    found = {}
    for index in sorted(folder.glob(f"{FOOTFALL}-*/kept.json")):
        for entry in json.loads(index.read_text()):
            policy = str(index.parent / entry["file"])
            found[policy] = (index.parent.name, entry["time_s"], entry["steps"])
    playground_file = folder / f"{PLAYGROUND}.npz"
    if playground_file.exists():
        saved = load_actors(playground_file)
        for snapshot in range(1, len(saved.time_s)):  # the first policy is untrained
            found[f"{playground_file}#{snapshot}"] = (
                PLAYGROUND,
                float(saved.time_s[snapshot]),
                int(saved.steps[snapshot]),
            )
    return found


def figures_of(policy: str, scenario: str, options: argparse.Namespace) -> dict[str, Any]:
    """Figures of the policy in a scenario."""
    file = load_scenarios(load_robot(ROBOT))
    plans = plan_episodes(scenario, file.scenarios[scenario], seed=0, episodes=SCENARIOS[scenario])
    tasks = [
        EpisodeTask(policy, ROBOT, plan, file.noise, options.plant, ground_truth="#" in policy)
        for plan in plans
    ]
    return summarise(file.scenarios[scenario], run_all(_run, tasks, options.workers), seed=0)


def _run(task: EpisodeTask) -> EpisodeOutcome:
    """Run an episode in a worker process, with either kind of policy."""
    file, _, snapshot = task.policy.partition("#")
    return run_with(_playground(file, int(snapshot)), task) if snapshot else run_task(task)


@cache
def _playground(file: str, snapshot: int) -> PlaygroundPolicy:
    return PlaygroundPolicy(_actors(file), snapshot, load_robot(ROBOT))


@cache
def _actors(file: str) -> SavedActors:
    return load_actors(Path(file))


# -- plot ----------------------------------------------------------------------------------------------------


def plot(options: argparse.Namespace) -> None:
    """Print every score and the time to equal quality, and plot both."""
    scores = json.loads((options.out / "scores.json").read_text())
    runs: dict[str, list[dict[str, Any]]] = {}
    for entry in sorted(scores.values(), key=lambda entry: entry["time_s"]):
        runs.setdefault(entry["training"], []).append(entry)
    table = Table("training", "s", "M steps", "fell", "m/s", "rad/s", "push, m/s", box=None)
    for entries in runs.values():
        for entry in entries:
            table.add_row(*cells(entry))
    Console(width=110).print(table)
    goal = runs[PLAYGROUND][-1]
    print(f"Playground's last policy: {one_line(goal)}")
    for name, entries in runs.items():
        if name == PLAYGROUND:
            continue
        reached = first_as_good(entries, goal)
        if reached is None:
            print(f"{name}: not reached within {entries[-1]['time_s']:.0f} s")
        else:
            share = reached["time_s"] / goal["time_s"]
            print(f"{name}: as good after {reached['time_s']:.1f} s, {share:.2f} of Playground's time")
    draw(runs, goal, options.out / "time_to_quality.svg")


def first_as_good(entries: list[dict[str, Any]], goal: dict[str, Any]) -> dict[str, Any] | None:
    """First policy from which on all policies are as good as the goal."""
    reached = None
    for entry in reversed(entries):
        if not as_good(entry, goal):
            break
        reached = entry
    return reached


def as_good(entry: dict[str, Any], goal: dict[str, Any]) -> bool:
    """Whether falls and velocity error are at most the goal's, and half survive at least the same push."""
    walk, target = entry["walk"], goal["walk"]
    return (
        walk["falls"] <= target["falls"]
        and walk["lin_vel_rmse"] is not None
        and walk["lin_vel_rmse"] <= target["lin_vel_rmse"]
        and push_of(entry) >= push_of(goal)
    )


def push_of(entry: dict[str, Any]) -> float:
    """Push that half survive, m/s: 0 if most fall at the weakest push, the strongest if most survive it."""
    push = entry["push"]
    if push["dv50"] is not None:
        return float(push["dv50"])
    return float(push["strongest_push"]) if push["falls"] < push["episodes"] / 2 else 0.0


def cells(entry: dict[str, Any]) -> list[str]:
    """Table row of one policy."""
    walk = entry["walk"]
    errors = [
        "-" if walk[name] is None else f"{walk[name]:.3f}" for name in ("lin_vel_rmse", "yaw_rate_rmse")
    ]
    falls = f"{walk['falls']} of {walk['episodes']}"
    return [
        entry["training"], f"{entry['time_s']:.0f}", f"{entry['steps'] / 1e6:.0f}", falls, *errors,
        f"{push_of(entry):.2f}",
    ]  # fmt: skip


def one_line(entry: dict[str, Any]) -> str:
    """A line of text about one policy."""
    name, seconds, steps, falls, linear, yaw, push = cells(entry)
    return (
        f"{name} after {seconds} s, {steps} M steps: {falls} fell, {linear} m/s, {yaw} rad/s,"
        f" half survive {push} m/s"
    )


def draw(runs: dict[str, list[dict[str, Any]]], goal: dict[str, Any], path: Path) -> None:
    """Plot both qualities over wall-clock time, with 95 % intervals."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    colours = dict(zip(runs, plt.rcParams["axes.prop_cycle"].by_key()["color"], strict=False))
    for name, entries in runs.items():
        walked = [entry for entry in entries if entry["walk"]["lin_vel_rmse"] is not None]
        panels = (
            (axes[0], walked, lambda entry: entry["walk"]["lin_vel_rmse"], error_interval),
            (axes[1], entries, push_of, push_interval),
        )
        for axis, shown, value, interval in panels:
            seconds = [entry["time_s"] for entry in shown]
            low, high = zip(*map(interval, shown), strict=True)
            style = {"color": colours[name], "marker": "o", "markersize": 3, "linewidth": 1.2}
            axis.plot(seconds, [value(entry) for entry in shown], label=name.replace("-", ", seed "), **style)
            axis.fill_between(seconds, low, high, color=colours[name], alpha=0.15, linewidth=0)
    axes[0].axhline(goal["walk"]["lin_vel_rmse"], color="0.6", linewidth=1, linestyle=":")
    axes[1].axhline(push_of(goal), color="0.6", linewidth=1, linestyle=":", label="Playground's last")
    axes[0].set(yscale="log", xlabel="wall-clock, s", ylabel="velocity error, m/s", title="Tracking")
    axes[1].set(xlabel="wall-clock, s", ylabel="push that half survive, m/s", title="Pushes")
    for axis in axes:
        quarter = "a quarter of Playground's time"
        axis.axvline(goal["time_s"] / 4, color="0.6", linewidth=1, linestyle="--", label=quarter)
        axis.set_xlim(left=0)
    axes[0].yaxis.set_major_formatter("{x:g}")
    axes[0].yaxis.set_minor_formatter("{x:g}")
    figure.legend(*axes[1].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.savefig(path)
    figure.savefig(path.with_suffix(".png"), dpi=150)
    plt.close(figure)


def error_interval(entry: dict[str, Any]) -> tuple[float, float]:
    """95 % interval of the velocity error, m/s."""
    low, high = entry["walk"]["lin_vel_rmse_interval"]
    return low, high


def push_interval(entry: dict[str, Any]) -> tuple[float, float]:
    """95 % interval of the push that half survive, m/s; an edge above all pushes counts as the strongest."""
    push = entry["push"]
    edges = push["dv50_interval"] if push["dv50"] is not None else (push_of(entry),) * 2
    low, high = (push["strongest_push"] if edge is None else edge for edge in edges)
    return low, high


if __name__ == "__main__":
    main()
