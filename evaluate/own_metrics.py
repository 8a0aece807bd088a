"""The user's own metrics: functions of a trace, named MODULE:NAME.

    def highest_base_m(trace: Trace, robot: Robot) -> float:
        '''Highest point of the base, m.'''
        return float(trace.base_position[:, 2].max())

The mean over episodes is reported under the function's name, with the first line of its docstring.
"""

from collections.abc import Callable, Sequence
from functools import cache

from footfall.common.errors import UserError
from footfall.common.outside import find, one_line
from footfall.evaluate.figures import Figure, Summary
from footfall.plant.trace import Trace
from footfall.robots.description import Robot

Metric = Callable[[Trace, Robot], float]
SECTION = "own"  # part of a scenario's summary: {name: mean over episodes}


@cache
def load_metric(import_path: str) -> Metric:
    """The function at MODULE:NAME.

    Raises:
        UserError: there is no such module or function.
    """
    metric: Metric = find(import_path, "metric")
    if not callable(metric):
        raise UserError(f"no metric '{import_path}': it is not a function")
    return metric


def name_of(import_path: str) -> str:
    """The name under which a metric is reported."""
    return import_path.partition(":")[2]


def score_own(import_paths: Sequence[str], trace: Trace, robot: Robot) -> dict[str, float]:
    """Value of each metric for one episode, NaN if there was nothing to measure.

    Raises:
        UserError: a metric raises, or returns something else than a number.
    """
    values = {}
    for import_path in import_paths:
        try:
            values[name_of(import_path)] = float(load_metric(import_path)(trace, robot))
        except UserError:
            raise
        except Exception as error:  # any error of the user's function
            raise UserError(f"metric {import_path} fails: {one_line(error)}") from error
    return values


def check_metrics(import_paths: Sequence[str]) -> None:
    """Raise UserError for a metric that cannot be loaded, or for two metrics with one name."""
    names = [name_of(import_path) for import_path in import_paths]
    for import_path, name in zip(import_paths, names, strict=True):
        load_metric(import_path)
        if names.count(name) > 1:
            raise UserError(f"two metrics are called '{name}': give one of them another name")


def own_figures(summaries: Sequence[Summary]) -> list[Figure]:
    """A table row for each of the user's metrics in the summaries."""
    names = dict.fromkeys(name for summary in summaries for name in summary.get(SECTION, {}))
    return [_figure(name, "") for name in names]


def definitions(import_paths: Sequence[str]) -> list[Figure]:
    """Definition of each metric: the first line of its docstring."""
    lines = [(load_metric(import_path).__doc__ or "").strip().splitlines() for import_path in import_paths]
    return [
        _figure(name_of(import_path), next(iter(each), ""))
        for import_path, each in zip(import_paths, lines, strict=True)
    ]


def _figure(name: str, about: str) -> Figure:
    return Figure(f"{SECTION}.{name}", name.replace("_", " "), about, digits=3)
