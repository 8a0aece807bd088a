"""`footfall compare`."""

from footfall.evaluation import NOMINAL, EvaluationOptions
from footfall.options import HtmlFile, PolicyName
from footfall.outputs import check_outputs


def compare(
    *policies: PolicyName,
    options: EvaluationOptions = NOMINAL,
    html: HtmlFile = None,
) -> None:
    """Put several policies through the same scenarios, and write a table, JSON and an HTML report."""
    check_outputs(options.json, html)
