"""`footfall compare`."""

from footfall.evaluation import NOMINAL, EvaluationOptions, arguments
from footfall.options import HtmlFile, PolicyName
from footfall.outputs import check_outputs, is_device, write_json
from robots.errors import UserError


def compare(*policies: PolicyName, options: EvaluationOptions = NOMINAL, html: HtmlFile = None) -> None:
    """Put several policies through the same scenarios, and write a table, JSON and an HTML report."""
    check_outputs(options.json, html)
    if html is not None and is_device(html):
        raise UserError(f"cannot write the report to {html}: give a file name")
    from evaluate.api import compare_policies

    write_json(options.json, compare_policies(policies, **arguments(options), html_path=html))
