"""One HTML page, complete in itself, of a run's log."""

from datetime import UTC, datetime
from importlib.metadata import version

from jinja2 import Environment, PackageLoader, StrictUndefined

from footfall.deploy.log_analysis.findings import LogFindings
from footfall.evaluate.report.log_plots import plots

MOST_EVENTS = 500  # in the table


def render(found: LogFindings, headline: str) -> str:
    """The page, under a headline of one line."""
    environment = Environment(
        loader=PackageLoader("footfall.evaluate.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    columns = found.columns
    return environment.get_template("log.html").render(
        title=columns.log.path.name,
        headline=headline,
        good=found.good,
        verdicts=found.verdicts(),
        extremes=found.extremes(),
        states=columns.states(),
        plots=plots(found),
        events=columns.events[:MOST_EVENTS],
        metadata={key: value for key, value in columns.log.metadata.items() if key != "contract"},
        version=version("footfall"),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )
