"""Paired comparison of policies' walks: tracking, energy and falls, with intervals over seeds and walks.

    python benchmarks/compared_policies.py walks.jsonl --pair identified wide --pair identified-1.3 wide
    python benchmarks/compared_policies.py walks.jsonl --against wide --plot figure.png

The walks are written by `identified_policies.py judge --walks walks.jsonl`. A run folder's name is its
condition and its seed: `identified-1.3-0` is seed 0 of `identified-1.3`. Only walks that all policies of a
seed have in common count. Intervals are 95 % of a bootstrap over seeds and, within a seed, over walks; both
policies of a pair have the same draws.
"""

import argparse
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

FIELDS = ("fell", "lin_vel_mse", "yaw_rate_mse", "scored_s", "electrical_j", "weight_n", "distance_m")
FIGURES = ("velocity error", "yaw-rate error", "cost of transport")
FIRST = "wide-first"  # condition whose policy the others continue
TRUE = "true"  # condition that trains on the hidden robot's own ranges
WITHOUT_PUSHES, PUSHED = "nominal", "push"
DRAWS = 4_000
INTERVAL = (2.5, 97.5)  # percentiles
# Limits of `Difference.as_good`: largest relative rise, by the mean or by the upper end of the interval.
MAX_TRACKING_RISE_END, MAX_ENERGY_RISE, MAX_ENERGY_RISE_END = 0.03, 0.005, 0.02
MAX_PUSH_FALLS_RISE = 0.02  # of the share of falls

Walks = dict[int, np.ndarray]  # (walks, FIELDS) of one condition and scenario, by seed


class Difference(NamedTuple):
    """One condition against another: relative differences of `FIGURES`, and falls."""

    relative: np.ndarray  # (3,)
    interval: np.ndarray  # (2, 3): lower and upper end for each figure
    falls: tuple[int, int]  # without pushes, of the condition and of the other
    push_falls: float  # difference of the share of falls; NaN without pushed walks
    push_interval: np.ndarray  # (2,): lower and upper end

    @property
    def as_good(self) -> tuple[bool, bool, bool]:
        """Whether tracking, energy and falls are at least as good, by the rule fixed for this benchmark."""
        (velocity, yaw, energy), high = self.relative, self.interval[1]
        tracks = max(velocity, yaw) <= 0.0 and max(high[:2]) <= MAX_TRACKING_RISE_END
        pushed = np.isnan(self.push_falls) or (
            self.push_interval[0] <= 0.0 and self.push_falls <= MAX_PUSH_FALLS_RISE
        )
        return (
            bool(tracks),
            bool(energy <= MAX_ENERGY_RISE and high[2] <= MAX_ENERGY_RISE_END),
            bool(self.falls[0] <= self.falls[1] and pushed),
        )


def read(path: Path) -> dict[str, dict[str, Walks]]:
    """Walks by condition and scenario, cut down to those that all policies of a seed have."""
    rows: dict[tuple[str, int, str], dict[int, list[float]]] = {}
    for line in path.read_text().splitlines():
        row = json.loads(line)
        condition, _, seed = row["policy"].rpartition("-")
        numbers = [np.nan if row[name] is None else float(row[name]) for name in FIELDS]
        rows.setdefault((condition, int(seed), row["scenario"]), {})[row["index"]] = numbers
    found: dict[str, dict[str, Walks]] = {}
    for condition, seed, scenario in rows:
        of_policies = [by_index for (_, *key), by_index in rows.items() if key == [seed, scenario]]
        common = sorted(set.intersection(*map(set, of_policies)))
        walks = np.array([rows[condition, seed, scenario][index] for index in common])
        found.setdefault(condition, {}).setdefault(scenario, {})[seed] = walks.reshape(-1, len(FIELDS))
    return found


def figures(walks: Iterable[np.ndarray]) -> np.ndarray:
    """`FIGURES` over all walks, (3,)."""
    _, velocity, yaw, scored, joules, weight, distance = np.concatenate(list(walks)).T
    known = np.isfinite(velocity) & (scored > 0.0)
    errors = [np.sqrt(np.average(each[known], weights=scored[known])) for each in (velocity, yaw)]
    return np.array([*errors, (joules / weight).sum() / distance.sum()])


def compare(one: dict[str, Walks], other: dict[str, Walks], draws: int = DRAWS) -> Difference:
    """One condition's walks against another's."""
    rng, seeds = np.random.default_rng(0), sorted(one[WITHOUT_PUSHES])
    unpushed, pushed = (one[WITHOUT_PUSHES], other[WITHOUT_PUSHES]), (one.get(PUSHED), other.get(PUSHED))
    relative, fall_differences = [], []
    for _ in range(draws):
        chosen = rng.choice(seeds, len(seeds))
        drawn = [(seed, _draw_indices(rng, unpushed[0][seed])) for seed in chosen]
        first, second = (figures(walks[seed][index] for seed, index in drawn) for walks in unpushed)
        relative.append(first / second - 1.0)
        if pushed[0] and pushed[1]:
            drawn = [(seed, _draw_indices(rng, pushed[0][seed])) for seed in chosen]
            fallen = [_falls([walks[seed][index] for seed, index in drawn]) for walks in pushed if walks]
            fall_differences.append(fallen[0].mean() - fallen[1].mean())
    of_all_walks = figures(unpushed[0].values()) / figures(unpushed[1].values()) - 1.0
    falls = [int(_falls(walks.values()).sum()) for walks in unpushed]
    shares = [float(_falls(walks.values()).mean()) for walks in pushed if walks]
    return Difference(
        of_all_walks,
        np.percentile(relative, INTERVAL, axis=0),
        (falls[0], falls[1]),
        shares[0] - shares[1] if fall_differences else np.nan,
        np.percentile(fall_differences, INTERVAL) if fall_differences else np.full(2, np.nan),
    )


def _draw_indices(rng: np.random.Generator, walks: np.ndarray) -> np.ndarray:
    return rng.integers(0, len(walks), len(walks))


def _falls(walks: Iterable[np.ndarray]) -> np.ndarray:
    return np.concatenate(list(walks))[:, FIELDS.index("fell")]


def show(found: dict[str, dict[str, Walks]], pairs: Sequence[tuple[str, str]]) -> None:
    """Print a table of conditions, then one line for each pair."""
    for condition, scenarios in found.items():
        unpushed, pushed = scenarios[WITHOUT_PUSHES], scenarios.get(PUSHED, {})
        numbers = "; ".join(f"{each:.4f}" for each in figures(unpushed.values()))
        falls = [
            f"{int(_falls(w.values()).sum())} of {sum(map(len, w.values()))}" for w in (unpushed, pushed) if w
        ]
        print(f"{condition}: {numbers}; falls {', pushed '.join(falls)}")
    for one, other in pairs:
        difference = compare(found[one], found[other])
        parts = [
            f"{name} {100 * value:+.1f} [{100 * low:.1f}, {100 * high:.1f}] %"
            for name, value, low, high in zip(FIGURES, difference.relative, *difference.interval, strict=True)
        ]
        low, high = 100 * difference.push_interval
        parts += [f"falls {difference.falls[0]} against {difference.falls[1]}"]
        parts += [f"pushed {100 * difference.push_falls:+.1f} [{low:.1f}, {high:.1f}] points"]
        verdicts = zip(("tracking", "energy", "falls"), difference.as_good, strict=True)
        worse = [name for name, good in verdicts if not good]
        verdict = f"fails in {', '.join(worse)}" if worse else "at least as good"
        print(f"{one} against {other}: {'; '.join(parts)}: {verdict}")


def plot(found: dict[str, dict[str, Walks]], against: str, path: Path) -> None:
    """Velocity error over cost of transport, both relative to one condition, with paired intervals."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    with plt.rc_context({"font.size": 12, "axes.spines.top": False, "axes.spines.right": False}):
        figure, axes = plt.subplots(figsize=(7.0, 4.6), layout="constrained")
        colours = {name: f"C{i}" for i, name in enumerate(dict.fromkeys(map(_kind, found)))}
        lines: dict[str, list[tuple[float, float]]] = {}
        for condition, scenarios in found.items():
            difference = compare(scenarios, found[against])
            across, up = (100 * float(difference.relative[axis]) for axis in (2, 0))
            centre = (across, up)
            reach = np.abs(100 * difference.interval[:, [2, 0]] - centre)
            colour = colours[_kind(condition)]
            style: dict[str, Any] = {"fmt": "o", "color": colour, "ms": 8, "capsize": 3, "lw": 1}
            axes.errorbar([across], [up], reach[:, 1:], reach[:, :1], **style)
            place: dict[str, Any] = {"xytext": (7, 7)}
            if condition == TRUE:  # lies close to `identified`
                place = {"xytext": (-7, -15), "ha": "right"}
            axes.annotate(condition, centre, textcoords="offset points", color=colour, **place)
            if condition != FIRST:  # fewer steps than the others
                lines.setdefault(_kind(condition), []).append(centre)
        for kind, points in lines.items():
            axes.plot(*np.array(sorted(points)).T, color=colours[kind], lw=1, alpha=0.5)
        axes.axhline(0.0, color="grey", lw=0.6)
        axes.axvline(0.0, color="grey", lw=0.6)
        axes.set_xlabel(f"cost of transport, % from {against}")
        axes.set_ylabel(f"velocity error, % from {against}")
        axes.margins(0.12)
        figure.savefig(path, dpi=160)
        plt.close(figure)


def _kind(condition: str) -> str:
    return condition.partition("-")[0]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("walks", type=Path)
    parser.add_argument("--pair", nargs=2, action="append", default=[], metavar=("ONE", "OTHER"))
    parser.add_argument("--plot", type=Path, help="image to write")
    parser.add_argument("--against", default="wide", help="condition at the plot's origin")
    options = parser.parse_args()
    found = read(options.walks)
    show(found, [(one, other) for one, other in options.pair])
    if options.plot:
        plot(found, options.against, options.plot)


if __name__ == "__main__":
    main()
