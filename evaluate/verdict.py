"""The verdict in one sentence: which policy leads in which figure, and how certain that is."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from footfall.evaluate.figures import (
    MIN_EPISODES,
    Figure,
    Summary,
    figures,
    interval_text,
    leaders,
    measured,
    text,
    value,
)

Summaries = Mapping[str, Summary]  # by policy
Headline = tuple[Figure, str]  # a figure and the scenario that it is taken from


def headlines(by_scenario: Mapping[str, Summaries]) -> list[Headline]:
    """The figures at the top of a report: of the first scenario, and of the first one with pushes.

    Args:
        by_scenario: {scenario: {policy: summary}}.
    """
    first = next(iter(by_scenario))
    rows = []
    for key, figure in figures().items():
        measured_in = (name for name, each in by_scenario.items() if measured(figure, list(each.values())))
        scenario = next(measured_in, first) if key == "dv50" else first
        if figure.is_headline and measured(figure, list(by_scenario[scenario].values())):
            rows.append((figure, scenario))
    return rows


def verdict(by_scenario: Mapping[str, Summaries]) -> str:
    """One sentence that follows from the figures and their 95 % intervals alone.

    Args:
        by_scenario: {scenario: {policy: summary}}, the same policies in each.
    """
    rows = headlines(by_scenario)
    if not rows:
        return "Nothing could be measured: every episode failed."
    used = {scenario: by_scenario[scenario] for _, scenario in rows}
    if len(next(iter(used.values()))) == 1:
        return _alone(rows, used)
    if min(_episodes(each) for each in used.values()) < MIN_EPISODES:
        return (
            f"Too few episodes to rank the policies ({_counted(used)}): an interval over fewer than"
            f" {MIN_EPISODES} is too narrow."
        )
    return _ranking([row for row in rows if row[0].better], used)


def _alone(rows: Sequence[Headline], by_scenario: Mapping[str, Summaries]) -> str:
    phrases = []
    for figure, scenario in rows:
        ((name, summary),) = by_scenario[scenario].items()
        interval = interval_text(figure, summary)
        verb = "fell in" if figure.key == "falls" else _lower(figure.label)
        phrases.append(
            f"{verb} {text(figure, summary)} {figure.unit}".strip() + (f" ({interval})" if interval else "")
        )
    return f"Over {_counted(by_scenario)}, {name} {'; '.join(phrases)} (95 % intervals in brackets)."


def _ranking(rows: Sequence[Headline], by_scenario: Mapping[str, Summaries]) -> str:
    clear: dict[tuple[str, ...], list[str]] = {}
    qualified: list[str] = []  # leads of policies that fall more often
    unclear: list[str] = []
    for figure, scenario in rows:
        names, summaries = list(by_scenario[scenario]), list(by_scenario[scenario].values())
        leading = leaders(figure, summaries)
        if leading:
            group = tuple(names[index] for index in sorted(leading))
            claim = figure.claim if len(group) == 1 else _plural(figure.claim)
            clear.setdefault(group, []).append(f"{claim} ({_evidence(figure, names, summaries)})")
        elif blocked := leaders(replace(figure, blocked_by_falls=False), summaries):
            listed = _listed([names[index] for index in sorted(blocked)])
            is_single = len(blocked) == 1
            qualified.append(
                f"{listed} {'leads' if is_single else 'lead'} in {_lower(figure.label)}"
                f" but {'falls' if is_single else 'fall'} more often than others"
            )
        else:
            # Falls are counted in every scenario: name the scenario, or a reader would take these for all.
            name_scenario = figure.key == "falls" and len(by_scenario) > 1
            unclear.append(_lower(figure.label) + (f" in {scenario}" if name_scenario else ""))
    claims = [f"{_listed(group)} {_listed(phrases)}" for group, phrases in clear.items()] + qualified
    no_difference = f"no clear difference in {_listed(unclear, 'or')}" if unclear else ""
    if not claims:
        return f"Over {_counted(by_scenario)} there is {no_difference}: the 95 % intervals overlap."
    return f"Over {_counted(by_scenario)}, {'; '.join(claims)}; these 95 % intervals lie apart" + (
        f", and there is {no_difference}." if no_difference else "."
    )


def _evidence(figure: Figure, names: Sequence[str], summaries: Sequence[Summary]) -> str:
    """The leaders' values and the best value of the others."""
    leading = leaders(figure, summaries)
    values = _listed([text(figure, summaries[index]) for index in sorted(leading)])
    others = [index for index in range(len(names)) if index not in leading]
    nearest = min(others, key=lambda index: _badness(figure, summaries[index]))
    unit = f" {figure.unit}" if figure.unit else ""
    return f"{values}{unit}, against {text(figure, summaries[nearest])} of {names[nearest]}"


def _badness(figure: Figure, summary: Summary) -> float:
    number = value(figure, summary)
    if number is None:
        return math.inf
    return -number if figure.better == "high" else number


def _counted(by_scenario: Mapping[str, Summaries]) -> str:
    counts = [(_episodes(each), scenario) for scenario, each in by_scenario.items()]
    return _listed([f"{n} episode{'s' * (n != 1)} of {scenario}" for n, scenario in counts])


def _episodes(summaries: Summaries) -> int:
    return min(summary["episodes"] for summary in summaries.values())


def _plural(phrase: str) -> str:
    """'fall least often' for 'falls least often'."""
    verb, _, rest = phrase.partition(" ")
    return f"{verb.removesuffix('s')} {rest}"


def _lower(label: str) -> str:
    return label[0].lower() + label[1:]


def _listed(parts: Sequence[str], word: str = "and") -> str:
    """'a', 'a and b', 'a, b and c'."""
    return f" {word} ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))
