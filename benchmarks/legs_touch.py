"""How often a robot's legs touch each other in nominal episodes, which legs, and under which commands.

    python benchmarks/legs_touch.py go1-flat --seeds 10 --out legs.jsonl
    python benchmarks/legs_touch.py hexapod-flat --robot hexapod --seeds 10 --out legs.jsonl

Episodes are those of `footfall evaluate --scenarios nominal --seed SEED`. Writes one line for each: whether
it fell, the share of the time in which two legs press on each other, the number of ticks for each pair of
bodies, and the commands at these ticks. Prints totals. Episodes in the file are not run again.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import mujoco

from footfall.evaluate.episodes import EpisodeTask, run_task
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.pool import run_all
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.trace import Trace
from footfall.robots.description import load_robot
from footfall.robots.leg_bodies import NO_LEG
from footfall.robots.model import read_plant

SCENARIO = "nominal"
EPISODES_PER_WRITE = 200


def main() -> None:
    """Run the missing episodes, and print totals."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("policy")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds, from 0")
    parser.add_argument("--episodes", type=int, default=100, help="episodes per seed")
    parser.add_argument("--workers", type=int)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    lines = options.out.read_text().splitlines() if options.out.exists() else []
    records = [record for record in map(json.loads, lines) if record["policy"] == options.policy]
    done = {(record["seed"], record["episode"]) for record in records}
    file = load_scenarios(load_robot(options.robot))
    missing = [
        (seed, EpisodeTask(options.policy, options.robot, plan, file.noise, keep_trace=True))
        for seed in range(options.seeds)
        for plan in plan_episodes(SCENARIO, file.scenarios[SCENARIO], seed, options.episodes)
        if (seed, plan.index) not in done
    ]
    for start in range(0, len(missing), EPISODES_PER_WRITE):
        results = run_all(record_of, missing[start : start + EPISODES_PER_WRITE], options.workers)
        new = [result.value for result in results if result.value is not None]
        with options.out.open("a") as log:
            log.writelines(json.dumps(record) + "\n" for record in new)
        records += new
        print(one_line(options.policy, records, sum(result.value is None for result in results)), flush=True)


def record_of(seed_and_task: tuple[int, EpisodeTask]) -> dict[str, Any]:
    """Run one episode in a worker process."""
    seed, task = seed_and_task
    outcome = run_task(task)
    trace = outcome.trace
    assert trace is not None
    ticks = trace.legs_touch.nonzero()[0].tolist()
    pairs = Counter(pair for tick in ticks for pair in touching(trace, tick, task.robot))
    commands = {tuple(trace.command[tick].round(2).tolist()) for tick in ticks}
    return {
        "policy": task.policy,
        "seed": seed,
        "episode": task.plan.index,
        "trouble": outcome.trouble,
        "share": outcome.metrics.legs_touch_share,
        "pairs": pairs,
        "commands": sorted(commands),
    }


def touching(trace: Trace, tick: int, robot: str) -> Iterator[str]:
    """Names of pairs of bodies of two legs that overlap at a tick."""
    plant = read_plant(load_robot(robot))
    model, data = plant.model, mujoco.MjData(plant.model)
    data.qpos[: trace.qpos.shape[1]] = trace.qpos[tick]
    mujoco.mj_fwdPosition(model, data)
    for contact in data.contact[: data.ncon]:
        bodies = [int(model.geom_bodyid[geom]) for geom in contact.geom]
        legs = [plant.leg_of_body[body] for body in bodies]
        if legs[0] != legs[1] and NO_LEG not in legs:
            yield " ".join(sorted(model.body(body).name for body in bodies))


def one_line(policy: str, records: list[dict[str, Any]], failed: int) -> str:
    """Totals of the episodes in the file."""
    pairs: Counter[str] = sum((Counter(record["pairs"]) for record in records), Counter())
    share = sum(record["share"] for record in records) / max(len(records), 1)
    return (
        f"{policy}: {len(records)} episodes ({failed} could not be run),"
        f" {sum(bool(record['trouble']) for record in records)} fell or were stopped;"
        f" legs touched in {sum(record['share'] > 0.0 for record in records)}, {share:.3%} of the time,"
        f" ticks: {dict(pairs.most_common(6))}"
    )


if __name__ == "__main__":
    main()
