"""A self-contained HTML page of a run's log."""

from footfall.deploy.log_analysis.findings import LogFindings
from footfall.evaluate.report.log_plots import plots
from footfall.evaluate.report.sheet import rendered

MAX_EVENTS = 500  # in the table


def render(findings: LogFindings, headline: str) -> str:
    """The page, under a headline of one line."""
    columns = findings.columns
    return rendered(
        "log.html",
        title=columns.log.path.name,
        headline=headline,
        good=findings.good,
        verdicts=findings.verdicts(),
        extremes=findings.extremes(),
        states=columns.states(),
        plots=plots(findings),
        events=columns.events[:MAX_EVENTS],
        metadata={key: value for key, value in columns.log.metadata.items() if key != "contract"},
    )
