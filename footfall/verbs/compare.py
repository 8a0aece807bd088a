"""`footfall compare`."""

from footfall.evaluation import NOMINAL, EvaluationOptions, arguments
from footfall.options import HtmlFile, PolicyName


def compare(*policies: PolicyName, options: EvaluationOptions = NOMINAL, html: HtmlFile = None) -> None:
    """Put several policies through the same scenarios, and write a table, JSON and an HTML report."""
    from footfall.evaluate.api import compare_policies

    compare_policies(policies, **arguments(options), html_path=html)
